"""`anysim picture`: a world without a task on several engines, in one PNG."""

from pathlib import Path

import numpy as np
import pytest

from anysim.api import WATCHING as WATCHED, load, make as anysim_make
from anysim.errors import NameLookupError
from anysim.testing.engines import require_drawing
from anysim_parity.world_pictures import montage, pictures
from tests.cli.test_cli import anysim

WORLD = """
world:
  objects:
    ball: {source: {sphere: 0.1}, color: {choice: [red, blue]}}
  layout:
    ball: {on: terrain, x: {range: [-0.3, 0.3]}}
  cameras:
    front: {from: [1.0, 0.0, 0.8], look_at: ball, size: [64, 48]}
"""


@pytest.fixture
def world(tmp_path: Path) -> Path:
    path = tmp_path / "ball.yaml"
    path.write_text(WORLD)
    return path


def test_a_world_without_a_task_is_drawn_and_what_cannot_draw_is_named(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "ball.png"
    result = anysim("picture", str(world), "-e", "mujoco,null", "--out", str(out))
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == str(out)
    told = ["mujoco: building 4 envs…", *(f"mujoco: starting env {n} of 4…" for n in (1, 2, 3, 4))]
    assert result.stderr.splitlines()[1:6] == told, "silence for minutes helps nobody"
    assert "mujoco: drawing env 4 of 4…" in result.stderr
    assert "null took no part: null cannot run 'world': camera 'front' gives rgb" in result.stderr
    assert out.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_each_env_shows_its_own_episode_again(world: Path) -> None:
    once, again = (pictures(world, ["mujoco"], num_envs=4, seed=1).images["mujoco"] for _ in range(2))
    assert once.shape == (4, 48, 64, 3)
    assert (once == again).all()
    assert any((once[0] != other).any() for other in once[1:])


def test_envs_started_one_by_one_are_those_started_together(world: Path) -> None:
    shadows = ["world.scenery.shadows=true"]
    with anysim_make(load(WATCHED, world), engine="mujoco", num_envs=4, overrides=shadows) as env:
        env.reset(seed=1)
        together = env.engine.render("front")["rgb"]
    assert (pictures(world, ["mujoco"], num_envs=4, seed=1).images["mujoco"] == together).all()


def test_there_are_shadows_where_the_engine_has_them_and_the_file_says_nothing(world: Path) -> None:
    def drawn(engine: str, *overrides: str) -> np.ndarray:
        require_drawing(engine)
        found = pictures(world, [engine], num_envs=1, overrides=overrides)
        assert not found.refused
        return found.images[engine]

    said, without = (drawn("mujoco", f"world.scenery.shadows={word}") for word in ("true", "false"))
    assert (drawn("mujoco") == said).all()
    assert (said != without).any()
    assert drawn("sapien").any(), "an engine without shadows draws as ever"


def test_time_passes_before_the_image(world: Path) -> None:
    fall = ["world.layout.ball={position: [0, 0, 1.0]}"]
    before = pictures(world, ["mujoco"], num_envs=1, overrides=fall)
    after = pictures(world, ["mujoco"], num_envs=1, overrides=fall, seconds=1.0)
    assert (before.images["mujoco"] != after.images["mujoco"]).any()


def test_a_camera_that_is_not_there_is_named_with_those_that_are(world: Path) -> None:
    with pytest.raises(NameLookupError, match="no camera 'fornt'; did you mean 'front'"):
        pictures(world, ["mujoco"], camera="fornt")


def test_a_montage_has_its_images_row_by_row() -> None:
    images = np.arange(3, dtype=np.uint8)[:, None, None, None] * np.ones((1, 2, 2, 3), np.uint8)
    sheet = montage(images, columns=2, gap=1)
    assert sheet.shape == (5, 5, 3)
    assert sheet[::3, ::3, 0].tolist() == [[0, 1], [2, 255]]
