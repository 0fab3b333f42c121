"""Models and worlds that are written as USD and read again: what was written is there, to the last digit."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr", reason="USD files are written by usd-core, which the dependency group `test` has")

from anysim.api import compile_world
from anysim.assets.load import import_asset
from anysim.model.world import Geom, World
from anysim_export_model.scene import scene_of_model, scene_of_world
from anysim_export_model.write import write
from tests.plugins.export_model.test_round_trip import FAST, LARGEST, SLOW, differences
from tests.plugins.export_model.test_scene_round_trip import WORLD, numbers

PARTS = ["bodies", "joints", "geoms", "sites", "lights", "cameras"]
NAMED = [FAST[0], *(pytest.param(file, marks=pytest.mark.slow) for file in SLOW[:6:2])]


@pytest.mark.parametrize("file", NAMED)
def test_a_robot_is_the_same_after_a_file(file: str, tmp_path: Path) -> None:
    model = import_asset(f"example-robot-data:{file}")
    written = write(scene_of_model(model), "usd", tmp_path)
    again = import_asset(str(written.files[0]))
    assert [body.name for body in again.bodies] == [body.name for body in model.bodies]
    assert [geom.name for geom in again.geoms if geom.collides] == [geom.name for geom in model.geoms if geom.collides]
    assert again.excluded_pairs == model.excluded_pairs
    for velocities in (True, False):
        found = differences(model, again, velocities=velocities)
        assert max(found.values()) < LARGEST, found


def test_a_number_that_another_program_has_changed_counts(tmp_path: Path) -> None:
    """What anysim writes beside a number of single precision is believed as long as both say the same."""
    from pxr import Usd

    model = import_asset(f"example-robot-data:{FAST[0]}")
    written = write(scene_of_model(model), "usd", tmp_path).files[0]
    stage = Usd.Stage.Open(str(written))
    prim = next(prim for prim in stage.Traverse() if prim.GetName() == "panda_joint1")
    assert prim.GetAttribute("anysim:limits").Get()[1] == model.joints[0].upper
    prim.GetAttribute("physics:upperLimit").Set(45.0)
    body = next(prim for prim in stage.Traverse() if prim.GetName() == "panda_link1")
    body.GetAttribute("physics:mass").Set(9.0)
    prim.GetAttribute("physics:localPos0").Set((0.0, 0.0, 1.0))
    stage.Save()
    del stage, prim, body
    again = import_asset(str(written))
    assert again.joints[0].upper == pytest.approx(np.pi / 4, rel=1e-12)
    assert again.bodies[1].inertial.mass == 9.0
    assert again.bodies[1].position == (0.0, 0.0, 1.0)
    assert again.bodies[2].inertial == model.bodies[2].inertial


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[World, World]:
    """A world, and the world of the file that it was written to."""
    world = compile_world(WORLD)
    written = write(scene_of_world(world), "usd", tmp_path_factory.mktemp("written"))
    return world, compile_world({"world": {"source": str(written.files[0])}})


@pytest.mark.parametrize("kind", PARTS)
def test_a_world_is_the_same_after_a_file(pair: tuple[World, World], kind: str) -> None:
    one, other = (getattr(world, kind) for world in pair)
    assert [part.name for part in one] == [part.name for part in other]
    for part, back in zip(one, other, strict=True):
        if isinstance(part, Geom) and np.dot(part.quaternion, back.quaternion) < 0:
            continue  # the same turn, with the other sign; its poses are compared with those of the bodies
        assert np.allclose(
            *([v for v in numbers(p) if isinstance(v, float) and abs(v) < 1e300] for p in (part, back)),
            rtol=0,
            atol=1e-12,
        ), part.name


def test_what_is_around_them_is_the_same(pair: tuple[World, World]) -> None:
    one, other = pair
    assert (one.name, one.physics, one.excluded_pairs) == (other.name, other.physics, other.excluded_pairs)
    assert [entity.name for entity in one.entities] == [entity.name for entity in other.entities]
    assert np.abs(one.initial_body_pose - other.initial_body_pose).max() < 1e-12
