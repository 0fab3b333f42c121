"""Episodes for builders of RLDS: their files, and what TFDS reads where it is installed."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from anysim.record.reader import open_trajectory
from anysim_export.api import Episode
from anysim_export.job import export
from anysim_export.streams import channels_of
from tests.plugins.export.runs import committed

pytestmark = pytest.mark.xdist_group("export")
BUILDER = Path(__file__).parents[3] / "docs" / "examples" / "rlds" / "anysim_rlds.py"


def test_its_files_say_all_that_a_builder_needs(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "rlds"
    export([run], "rlds-ready", out, {"valid": 0.34})
    about = json.loads((out / "features.json").read_text())
    assert about["splits"] == {"train": [0, 2], "val": [2, 3]}
    assert about["robot"] == "panda"
    assert about["images"]["observation/wrist"] == {"camera": "wrist", "shape": [31, 33, 3], "dtype": "uint8"}
    for i, path in enumerate(committed(run)):
        one, folder = Episode(i, open_trajectory(path)), out / "episodes" / f"{i:06d}"
        with np.load(folder / "steps.npz") as arrays:
            rows = dict(arrays)
        for name, said in about["steps"].items():
            assert (rows[name].dtype, rows[name].shape) == (said["dtype"], (one.steps, *said["shape"])), name
        assert set(rows) == set(about["steps"])
        np.testing.assert_array_equal(rows["observation/policy"], one.obs["policy"][:-1].astype(np.float32))
        np.testing.assert_array_equal(rows["action"], one.actions.astype(np.float32))
        np.testing.assert_array_equal(rows["reward"], one.rewards.astype(np.float32))
        for name, at in (("is_first", [0]), ("is_last", [one.steps - 1]), ("is_terminal", [one.steps - 1])):
            assert np.flatnonzero(rows[name]).tolist() == at
        words = json.loads((folder / "words.json").read_text())
        assert (words["language_instruction"], words["sub_task"]) == (list(one.tasks), list(one.segments))
        for camera in ("front", "wrist"):
            files = sorted((folder / camera).iterdir())
            assert len(files) == one.steps
            for file, image in list(zip(files, one.images(camera), strict=False))[::20]:
                np.testing.assert_array_equal(np.asarray(Image.open(file)), image)


READ = """
import json, sys
import numpy as np
import tensorflow_datasets as tfds
builder = tfds.builder_from_directory(sys.argv[1])
found = {}
for split in builder.info.splits:
    for episode in builder.as_dataset(split=split):
        steps = list(episode["steps"].as_numpy_iterator())
        found[episode["episode_metadata"]["episode_seed"].numpy().decode()] = {
            "steps": len(steps),
            "action": np.stack([step["action"] for step in steps]).tolist(),
            "image": steps[5]["observation"]["wrist"].tolist(),
            "depth": steps[5]["observation"]["front_depth"][..., 0].tolist(),
            "entities": steps[5]["observation"]["front_segmentation"][..., 0].tolist(),
            "types": [str(steps[5]["observation"][f"front_{name}"].dtype) for name in ("depth", "segmentation")],
            "said": steps[5]["language_instruction"].decode(),
            "segment": steps[5]["sub_task"].decode(),
            "last": [bool(step["is_last"]) for step in steps].index(True),
        }
print(json.dumps(found))
"""


@pytest.mark.skipif(
    importlib.util.find_spec("tensorflow_datasets") is None, reason="needs tensorflow-datasets: make test-rlds"
)
def test_the_builder_of_the_page_makes_what_tfds_reads(run: Path, tmp_path: Path) -> None:
    """Every episode, by its seed: TFDS shuffles them."""
    export([run], "rlds-ready", tmp_path / "rlds")
    made = [sys.executable, str(BUILDER), str(tmp_path / "rlds"), str(tmp_path / "tfds")]
    subprocess.run(made, check=True, capture_output=True, timeout=300)
    reading = [sys.executable, "-c", READ, str(tmp_path / "tfds" / "anysim_rlds" / "1.0.0")]
    found = json.loads(subprocess.run(reading, check=True, capture_output=True, text=True, timeout=300).stdout)
    assert len(found) == 3
    for i, path in enumerate(committed(run)):
        one = Episode(i, open_trajectory(path))
        read = found[str(one.manifest.episode_seed)]
        assert (read["steps"], read["last"]) == (one.steps, one.steps - 1)
        np.testing.assert_array_equal(np.array(read["action"], np.float32), one.actions.astype(np.float32))
        np.testing.assert_array_equal(read["image"], list(one.images("wrist"))[5])
        assert read["types"] == ["float32", "uint16"]
        channels = {channel.name: list(one.channel(channel))[5] for channel in channels_of(one.manifest)}
        np.testing.assert_array_equal(np.array(read["depth"], np.float32), channels["depth"])
        np.testing.assert_array_equal(read["entities"], channels["segmentation"])
        assert (read["said"], read["segment"]) == (one.tasks[5], one.segments[5])
