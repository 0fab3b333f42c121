"""Jobs of still images: the same images whatever the batch, and labels that other readers decode."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask as coco_mask
import pytest
from PIL import Image
from pycocotools.coco import COCO

from anysim.errors import RecordError, SpecError
from anysim.testing.engines import require_drawing
from anysim_annotation.stills import maker
from anysim_annotation.stills.job import render_job
from anysim_annotation.stills.labels import kitti_line
from anysim_annotation.stills.masks import encoded, outlines, run_lengths
from tests.plugins.annotation.scenes import decoded

WORLD = """
world:
  objects:
    table: {source: {box: [1.0, 1.2, 0.04]}, fixed: true}
    block: {source: {box: [0.1, 0.1, 0.16]}, color: {choice: [yellow, white, red]}}
    ball: {source: {sphere: 0.07}, label: toy}
  layout:
    table: {position: [0.5, 0.0, 0.38]}
    block: {on: table, x: {range: [0.25, 0.75]}, y: {range: [-0.35, 0.35]}, yaw: {range: [-3.14, 3.14]}}
    ball: {on: table, x: {range: [0.25, 0.75]}, y: {range: [-0.35, 0.35]}}
  cameras:
    left: {from: {range: [[1.1, -0.5, 0.8], [1.5, -0.3, 1.2]]}, look_at: [0.5, 0, 0.4], fov: 50, size: [64, 48]}
    right: {from: [1.2, 0.5, 1.0], look_at: [0.5, 0, 0.4], fov: 50, size: [64, 48]}
"""
JOB = (
    "{source: desk.yaml, engine: mujoco, images: 7, seed: 5, formats: [coco, kitti], ignore: [table], least_pixels: 4}"
)


@pytest.fixture
def job(tmp_path: Path) -> Path:
    require_drawing("mujoco")
    (tmp_path / "desk.yaml").write_text(WORLD)
    (tmp_path / "job.yaml").write_text(JOB)
    return tmp_path / "job.yaml"


def made(path: Path, out: Path, *overrides: str, processes: int = 1, **changed: object) -> dict[str, bytes]:
    """Every file of a job that has run to its end."""
    for key, value in changed.items():
        path.write_text(path.read_text().replace("}", f", {key}: {value}}}"))
    list(render_job(path, out, overrides=overrides, jobs=processes))
    return {str(f.relative_to(out)): f.read_bytes() for f in out.rglob("*") if f.is_file() and f.name != ".lock"}


def test_masks_come_back() -> None:
    rng = np.random.default_rng(0)
    for share in (0.0, 0.02, 0.5, 0.98, 1.0):
        mask = rng.random((37, 53)) < share
        blob = np.zeros_like(mask)
        blob[5:30, 7:40] = True
        for one in (mask, blob, ~blob):
            assert (decoded(encoded(run_lengths(one)), [37, 53]) == one).all()


def test_outlines_have_the_pixels_of_a_mask_unless_it_has_a_hole() -> None:
    disc = np.hypot(*np.mgrid[-20:21, -25:26]) < 15.5
    two = disc.copy()
    two[:18, :24] = two[18:, 24:] = False  # two parts that touch in a corner
    for mask, parts in ((disc, 1), (two, 2), (np.zeros_like(disc), 0), (np.ones_like(disc), 1)):
        lines = outlines(mask)
        assert lines is not None
        assert len(lines) == parts
        assert (drawn(lines, mask.shape) == mask).all()
    ring = disc & (np.hypot(*np.mgrid[-20:21, -25:26]) > 6)
    assert outlines(ring) is None


def drawn(lines: list[list[int]], shape: tuple[int, int]) -> np.ndarray:
    """Pixels whose centres a ray from the left enters an odd number of times."""
    inside = np.zeros(shape, dtype=bool)
    for line in lines:
        corners = np.array(line).reshape(-1, 2)
        for (x, y), (to, down) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if x == to:
                inside[min(y, down) : max(y, down), x:] ^= True
    return inside


@pytest.mark.filterwarnings("ignore:__array__ implementation")  # of pycocotools with NumPy 2
@pytest.mark.parametrize("masks", ["rle", "polygons"])
def test_cocos_own_reader_finds_the_masks(job: Path, tmp_path: Path, masks: str) -> None:
    made(job, tmp_path / "out", masks=masks)
    read: Any = COCO(str(tmp_path / "out" / "coco.json"))
    kinds = set()
    for number in read.getAnnIds():
        [one] = read.loadAnns([number])
        mask = read.annToMask(one).astype(bool)
        [kind] = read.loadCats([one["category_id"]])
        [image] = read.loadImgs([one["image_id"]])
        said = json.loads((tmp_path / "out" / "labels" / f"{one['image_id'] - 1:07d}.json").read_text())
        thing = next(t for t in said["objects"] if t["name"] == one["name"])
        assert (image["file_name"], kind["name"]) == (said["file"], thing["label"])
        assert mask.sum() == one["area"] == thing["area"]
        assert coco_mask.toBbox(read.annToRLE(one)).tolist() == thing["bbox"]
        kinds.add(type(one["segmentation"]))
    assert kinds == ({dict} if masks == "rle" else {list})


def test_images_are_those_of_the_seed_whatever_the_batch(job: Path, tmp_path: Path) -> None:
    first = made(job, tmp_path / "a")
    second = made(job, tmp_path / "b", batch=1)
    assert first == second
    assert len([name for name in first if name.startswith("images/")]) == 7
    pictures = {first[name] for name in first if name.startswith("images/")}
    assert len(pictures) == 7
    coco = json.loads(first["coco.json"])
    assert [kind["name"] for kind in coco["categories"]] == ["block", "toy"]
    assert {image["camera_name"] for image in coco["images"]} == {"left", "right"}
    assert coco["images"][0]["seed"] == coco["images"][1]["seed"] != coco["images"][2]["seed"]
    assert len(coco["annotations"]) >= 12
    for one in coco["annotations"]:
        mask = decoded(one["segmentation"]["counts"], one["segmentation"]["size"])
        rows, columns = np.nonzero(mask)
        left, top, width, height = one["bbox"]
        assert mask.sum() == one["area"]
        assert [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1] == [left, top, left + width, top + height]


def test_a_mask_is_over_its_object_in_the_image(job: Path, tmp_path: Path) -> None:
    """The ball alone is red, and it is where its mask is."""
    red = "world.objects.ball.color=[1, 0, 0]"
    made(job, tmp_path / "out", red, "world.objects.block.color=[0.9, 0.9, 0.9]")
    coco = json.loads((tmp_path / "out" / "coco.json").read_text())
    kinds = {kind["id"]: kind["name"] for kind in coco["categories"]}
    seen = 0
    for one in coco["annotations"]:
        if kinds[one["category_id"]] != "toy":
            continue
        file = next(image["file_name"] for image in coco["images"] if image["id"] == one["image_id"])
        with Image.open(tmp_path / "out" / "images" / file) as picture:
            colours = np.array(picture).astype(int)
        reddish = (colours[..., 0] > 60) & (colours[..., 0] > 2 * colours[..., 1])
        mask = decoded(one["segmentation"]["counts"], one["segmentation"]["size"])
        assert (reddish & mask).sum() > 0.8 * max(reddish.sum(), mask.sum())
        seen += 1
    assert seen >= 5


def test_an_interrupted_job_goes_on_to_the_same_bytes(
    job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = made(job, tmp_path / "whole")
    out, real, count = tmp_path / "part", maker.write_png, [0]

    def full(path: Path, image: np.ndarray) -> None:
        count[0] += 1
        if count[0] == 4:
            path.write_bytes(b"half an image")
            raise OSError(28, "No space left on device", str(path))
        real(path, image)

    with monkeypatch.context() as patch:
        patch.setattr(maker, "write_png", full)
        with pytest.raises(RecordError, match=r"No space left on device .*start it again"):
            list(render_job(job, out))
    assert not (out / "coco.json").exists()
    assert len(list((out / "labels").iterdir())) == len(list((out / "images").glob("*.png"))) == 3
    progress = list(render_job(job, out))
    assert (progress[0].done, progress[-1].new) == (3, 4)
    assert {str(f.relative_to(out)): f.read_bytes() for f in out.rglob("*") if f.is_file()} == whole


@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_processes_make_the_bytes_of_one_and_go_on_where_another_stopped(
    job: Path, tmp_path: Path, processes: int
) -> None:
    whole, out = made(job, tmp_path / "whole"), tmp_path / "shared"
    job.write_text(JOB.replace("images: 7", "images: 7, batch: 1"))
    begun = render_job(job, out)
    for _ in range(3):
        next(begun)  # how many are there, and the two images of a scene
    begun.close()
    (out / "labels" / "0000000.json").unlink()
    (out / "images" / ".0000000.1").write_bytes(b"half an image")
    progress = list(render_job(job, out, jobs=processes))
    assert [step.new for step in progress] == list(range(len(progress)))
    assert progress[-1] == (7, 7, 6)
    assert {str(f.relative_to(out)): f.read_bytes() for f in out.rglob("*") if f.is_file()} == whole


@pytest.mark.slow
def test_a_fault_of_a_process_reaches_the_one_that_asked(job: Path, tmp_path: Path) -> None:
    (tmp_path / "out" / "images" / "0000004.png").mkdir(parents=True)
    with pytest.raises(RecordError, match=r"cannot write into .*0000004.*\. Images that were complete are there"):
        made(job, tmp_path / "out", processes=2)
    with pytest.raises(RecordError, match=r"null cannot run 'world': camera 'left'"):
        list(render_job(job, tmp_path / "other", engine="null", jobs=2))


@pytest.mark.slow
def test_a_job_whose_processes_are_killed_goes_on_to_the_same_bytes(job: Path, tmp_path: Path) -> None:
    job.write_text(JOB.replace("images: 7", "images: 60, batch: 1"))
    whole, out = made(job, tmp_path / "whole"), tmp_path / "out"
    command = [str(Path(sys.executable).with_name("anysim")), "render", str(job), "--out", str(out), "--jobs", "2"]
    for least in (5, 20):
        running = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while len(list((out / "labels").glob("*.json"))) < least:
            assert running.poll() is None
            time.sleep(0.01)
        running.kill()
        running.wait()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "60 of 60 there" in done.stdout
    assert int(done.stdout.split(" images made")[0].split()[-1]) <= 40
    assert {str(f.relative_to(out)): f.read_bytes() for f in out.rglob("*") if f.is_file()} == whole


def test_another_job_or_a_wrong_one_is_refused(job: Path, tmp_path: Path) -> None:
    made(job, tmp_path / "out")
    job.write_text(JOB.replace("seed: 5", "seed: 6"))
    with pytest.raises(RecordError, match=r"holds the images of another job, as job\.json says; choose another --out"):
        list(render_job(job, tmp_path / "out"))
    job.write_text(JOB.replace("seed: 5", "seeds: 5"))
    with pytest.raises(SpecError, match=r"job\.yaml:1:\d+: seeds: unknown key; did you mean 'seed'"):
        list(render_job(job, tmp_path / "new"))
    job.write_text(JOB.replace("seed: 5", "cameras: [top]"))
    with pytest.raises(RecordError, match=r"there is no camera 'top' \(cameras: left, right\)"):
        list(render_job(job, tmp_path / "new"))


def test_kitti_says_where_a_box_is_before_a_level_camera(job: Path, tmp_path: Path) -> None:
    made(
        job,
        tmp_path / "out",
        "world.cameras.right.from=[1.7, 0, 0.5]",
        "world.cameras.right.look_at=[0.5, 0, 0.5]",
        "world.layout.block={on: table, x: 0.5, y: 0.1, yaw: 0.3}",
        cameras="[right]",
    )
    lines = (tmp_path / "out" / "kitti" / "label_2" / "0000000.txt").read_text().splitlines()
    block = next(line.split() for line in lines if line.startswith("block"))
    high, wide, length, x, y, z, turn = map(float, block[8:])
    assert (high, wide, length) == (0.16, 0.1, 0.1)
    assert [x, y, z] == pytest.approx([0.1, 0.1, 1.2], abs=2e-3)  # the camera looks against x, and 0.1 m down
    assert turn == pytest.approx(np.pi / 2 - 0.3, abs=1e-3)
    p2 = np.array((tmp_path / "out" / "kitti" / "calib" / "0000000.txt").read_text().split()[1:], float).reshape(3, 4)
    middle = p2 @ [x, y - high / 2, z, 1]
    left, top, right, bottom = map(float, block[4:8])
    assert left < middle[0] / middle[2] < right
    assert top < middle[1] / middle[2] < bottom


def test_what_has_no_box_in_space_has_kittis_words_for_unknown() -> None:
    line = kitti_line({"label": "a b", "bbox": [1, 2, 3, 4], "occlusion": 0.6})
    assert line.startswith("a_b 0.00 2 -10.0000 1.0000 2.0000 4.0000 6.0000 -1.0000")
