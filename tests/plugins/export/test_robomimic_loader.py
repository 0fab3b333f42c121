"""robomimic's own loader reads an exported data set, and its behaviour cloning trains on it.

`make test-robomimic` runs these, in an environment with robomimic 0.3.
"""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.record.reader import open_trajectory
from anysim_export.api import Episode
from anysim_export.job import export
from anysim_export.streams import channels_of
from tests.plugins.export.runs import committed, import_torchvision, record

pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec("robomimic") is None, reason="needs robomimic: make test-robomimic"),
    pytest.mark.filterwarnings("ignore"),  # those of robomimic and what it imports
]
IMAGES, NUMBERS = ("front_image", "wrist_image"), ("policy", "privileged")
ROWS = ("actions", "rewards", "dones")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five episodes, two cameras."""
    return record(tmp_path_factory.mktemp("recorded") / "run", 5)


@pytest.fixture(scope="module")
def file(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set, two of its five episodes for validation; robomimic knows which observations are images."""
    import_torchvision()
    import robomimic.utils.obs_utils as observations  # pyright: ignore[reportMissingImports]

    observations.initialize_obs_utils_with_obs_specs({"obs": {"low_dim": list(NUMBERS), "rgb": list(IMAGES)}})
    out = tmp_path_factory.mktemp("data") / "robomimic"
    export([run], "robomimic", out, {"valid": 0.4})
    return out / "demo.hdf5"


def opened(file: Path, part: str, keys: tuple[str, ...], length: int) -> Any:
    """Its sequences, as robomimic's training reads them."""
    from robomimic.utils.dataset import SequenceDataset  # pyright: ignore[reportMissingImports]

    return SequenceDataset(
        str(file), obs_keys=keys, dataset_keys=ROWS, seq_length=length, hdf5_cache_mode=None, filter_by_attribute=part
    )


def test_it_reads_every_number_and_image(run: Path, file: Path) -> None:
    recorded = [Episode(i, open_trajectory(path)) for i, path in enumerate(committed(run))]
    assert len(recorded) == 5
    for part, members in (("train", recorded[:3]), ("valid", recorded[3:])):
        data = opened(file, part, NUMBERS + IMAGES, 1)
        assert (data.n_demos, len(data)) == (len(members), sum(one.steps for one in members))
        item = 0
        for one in members:
            images = {name: list(one.images(name.removesuffix("_image"))) for name in IMAGES}
            for t in range(0, one.steps, 9):
                found = data[item + t]
                np.testing.assert_array_equal(found["actions"][0], one.actions[t])
                np.testing.assert_array_equal(found["rewards"][0], one.rewards[t])
                assert found["dones"][0] == (t == one.steps - 1)
                for group, then in (("obs", t), ("next_obs", t + 1)):
                    for name in NUMBERS:
                        np.testing.assert_array_equal(found[group][name][0], one.obs[name][then])
                    for name in IMAGES:
                        np.testing.assert_array_equal(found[group][name][0], images[name][then])
            item += one.steps


def test_depth_is_what_was_recorded_and_its_modality_takes_it_by_the_scale(run: Path, tmp_path: Path) -> None:
    import robomimic.utils.obs_utils as observations  # pyright: ignore[reportMissingImports]

    scale, keys = 32.0, ("front_depth", "front_segmentation")
    specs = {"low_dim": ["front_segmentation"], "depth": ["front_depth"]}
    observations.initialize_obs_utils_with_obs_specs({"obs": specs})
    export([run], "robomimic", tmp_path / "out", {"depth_scale": scale})
    data = opened(tmp_path / "out" / "demo.hdf5", "train", keys, 1)
    one = Episode(0, open_trajectory(committed(run)[0]))
    channels = {channel.key: list(one.channel(channel)) for channel in channels_of(one.manifest)}
    worst = 0.0
    for t in range(0, one.steps, 9):
        found = data[t]["obs"]
        np.testing.assert_array_equal(found["front_depth"][0, ..., 0] * scale, channels["front_depth"][t])
        np.testing.assert_array_equal(found["front_segmentation"][0, ..., 0], channels["front_segmentation"][t])
        seen = observations.process_obs(found["front_depth"], obs_key="front_depth")
        assert seen.shape == (1, 1, 32, 48)
        worst = max(worst, float(np.abs(seen[0, 0] * scale - channels["front_depth"][t]).max()))
    assert worst == 0.0, "robomimic's modality clips at 1"
    assert max(float(image.max()) for image in channels["front_depth"]) > 1.0  # which metres would have met
    numbers = {"low_dim": list(NUMBERS), "rgb": list(IMAGES)}
    observations.initialize_obs_utils_with_obs_specs({"obs": numbers})


def test_its_tools_know_the_env_and_the_shapes(file: Path) -> None:
    import robomimic.utils.file_utils as files  # pyright: ignore[reportMissingImports]

    env = files.get_env_metadata_from_dataset(str(file))
    assert env["env_name"] == "anysim_learning.envs:anysim/pick_cube-v0"
    shapes = files.get_shape_metadata_from_dataset(str(file), all_obs_keys=list(NUMBERS + IMAGES))
    assert shapes["ac_dim"] == 8
    assert shapes["all_shapes"]["front_image"] == [3, 32, 48]
    assert shapes["use_images"]


def test_a_training_step_runs(file: Path) -> None:
    """Behaviour cloning by robomimic: its loss is finite, and less after some steps on the same batch."""
    import robomimic.utils.file_utils as files  # pyright: ignore[reportMissingImports]
    import robomimic.utils.obs_utils as observations  # pyright: ignore[reportMissingImports]
    import torch  # pyright: ignore[reportMissingImports]
    from robomimic.algo import algo_factory  # pyright: ignore[reportMissingImports]
    from robomimic.config import config_factory  # pyright: ignore[reportMissingImports]

    config = config_factory("bc")
    config.observation.modalities.obs.low_dim = ["policy"]
    config.algo.actor_layer_dims = (64, 64)
    observations.initialize_obs_utils_with_config(config)
    shapes = files.get_shape_metadata_from_dataset(str(file), all_obs_keys=["policy"])
    torch.manual_seed(0)
    model = algo_factory("bc", config, shapes["all_shapes"], shapes["ac_dim"], torch.device("cpu"))
    model.set_train()
    batch = next(iter(torch.utils.data.DataLoader(opened(file, "train", ("policy",), 1), batch_size=32, shuffle=True)))
    losses: list[float] = []
    for _ in range(20):
        found = model.train_on_batch(model.process_batch_for_training(batch), epoch=0)
        losses.append(float(found["losses"]["action_loss"]))
    print(f"\nlosses of behaviour cloning: {losses[0]:.4f} -> {losses[-1]:.4f}")
    assert np.isfinite(losses).all()
    assert losses[-1] < losses[0]
