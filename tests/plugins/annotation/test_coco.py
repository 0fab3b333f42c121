"""Recorded runs as COCO: masks over what their images show, categories by label, words, and the same bytes again."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import anysim
from anysim.errors import RecordError
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_drawing
from anysim_annotation.files import read_array
from anysim_annotation.orders import read_orders
from anysim_annotation.render import AnnotationMaker
from anysim_annotation.sheet import read_annotations
from anysim_export.job import export
from anysim_film.stage import FilmOrder
from anysim_recording.collector import Collector
from tests.plugins.annotation.scenes import decoded

pytestmark = pytest.mark.xdist_group("coco")
SMALL = ("record.cameras=[front]", "world.cameras.front.size=[64, 48]", "task.horizon=7", "record.keep=all")
OPTIONS = {"every": 3, "least_pixels": 4, "labels": "geometry"}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short episodes with the images of one camera; not to be written to."""
    require_drawing("mujoco")
    out = tmp_path_factory.mktemp("run")
    with anysim.make("pick_cube", engine="mujoco", num_envs=2, overrides=SMALL) as env:
        list(Collector(env, SkillPolicy(env), out, 2, 0).run())
    return out


def coco(run: Path, out: Path, **options: Any) -> dict[str, Any]:
    """The file of labels of an export."""
    export([run], "coco", out, OPTIONS | options, failed_too=True)
    return json.loads((out / "coco.json").read_text())


def test_masks_boxes_and_words_are_those_of_the_moments(run: Path, tmp_path: Path) -> None:
    """Against the annotators' own files of the same episodes, and against the recorded images."""
    said = coco(run, tmp_path / "coco")
    assert [kind["name"] for kind in said["categories"]] == ["cube", "panda", "table"]
    assert len(said["images"]) == 2 * 3
    kinds = {kind["id"]: kind["name"] for kind in said["categories"]}
    readers = [open_trajectory(path) for path in trajectories(run)]
    with AnnotationMaker(FilmOrder(("front",), fps=50.0), read_orders("instance"), "geometry") as maker:
        made = [maker.annotate(path, tmp_path / path.name).directory for path in trajectories(run)]
    compared = 0
    for image in said["images"]:
        reader, own = readers[image["episode"]], made[image["episode"]]
        assert (image["width"], image["height"]) == (64, 48)
        assert image["instruction"] == reader.manifest.instruction
        assert image["sub_task"] == "pick: grasp: approach"
        assert image["episode_seed"] == str(reader.manifest.episode_seed)
        shown = np.asarray(Image.open(tmp_path / "coco" / "images" / image["file_name"]))
        filmed = dict(reader.images("front"))
        if image["step"] in filmed:
            assert np.abs(shown.astype(int) - filmed[image["step"]]).mean() < 6.0  # a lossy video
            compared += 1
        sheet = read_annotations(own)
        assert sheet is not None
        ids = read_array(own, sheet.cameras["front"].annotators["instance"].files["instance"], image["step"])
        for one in (a for a in said["annotations"] if a["image_id"] == image["id"]):
            mask = decoded(one["segmentation"]["counts"], one["segmentation"]["size"])
            assert one["area"] == mask.sum()
            [number] = set(ids[mask].tolist())
            assert (mask == (ids == number)).all()
            lines, columns = np.nonzero(mask)
            box = [columns.min(), lines.min(), np.ptp(columns) + 1, np.ptp(lines) + 1]
            assert one["bbox"] == box
            assert kinds[one["category_id"]] == one["name"]  # in this world things are called as their kind
    assert compared >= 4


def test_a_run_needs_no_videos_and_bytes_are_the_same_again(run: Path, tmp_path: Path) -> None:
    wanted = {"cameras": ["wrist"], "ignore": ["table"]}
    said = coco(run, tmp_path / "one", **wanted)
    coco(run, tmp_path / "two", **wanted)
    assert {image["camera_name"] for image in said["images"]} == {"wrist"}
    assert "table" not in {kind["name"] for kind in said["categories"]}
    one, two = (
        {file.name: file.read_bytes() for file in sorted((tmp_path / name).rglob("*")) if file.is_file()}
        for name in ("one", "two")
    )
    assert len(one) == 6 + 2
    assert one == two


def test_a_camera_that_is_not_there_is_refused_before_anything_is_written(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"there is no camera 'wirst'.*did you mean 'wrist'"):
        coco(run, tmp_path / "coco", cameras=["wirst"])
    assert list(tmp_path.iterdir()) == []
