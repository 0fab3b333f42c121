"""A device, a rack and vials: parts that fit, a door and a button that stay and stop, and what cannot be."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from anysim.assets.procedural import build
from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.world import Cylinder
from anysim.task.env import TaskEnv
from tests.plugins.assets.test_contact_rich import on_a_plane
from tests.plugins.assets.test_procedural import complaints
from tests.tasks.states import put, seen, set_opening

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
ENDS = {"device.door": 0.292, "device.start": 0.01}


def bench(engine: str) -> TaskEnv:
    """A device, and a vial in a rack."""
    objects = {
        "device": {"source": "procedural:device", "fixed": True},
        "rack": {"source": "procedural:rack", "fixed": True},
        "vial": {"source": "procedural:vial"},
    }
    layout = {
        "device": {"position": [0.0, 0.0, 0.0]},
        "rack": {"position": [0.5, 0.0, 0.0]},
        "vial": {"position": [0.465, 0.07, 0.0], "checked": False},
    }
    return on_a_plane(engine, objects, layout, "device")


def run(env: TaskEnv, steps: int) -> None:
    for _ in range(steps):
        env.step(np.zeros((1, env.action_dim)))


@pytest.mark.parametrize("engine", ENGINES)
def test_vials_stand_in_wells_and_doors_and_buttons_stay_and_stop(engine: str) -> None:
    with bench(engine) as env:
        env.reset(seed=0)
        for name in ENDS:
            set_opening(env, name, 0.5)
        run(env, 25)
        state, index = env.engine.get_state(), env.engine.index
        for name, reach in ENDS.items():
            assert state.joint_pos[0, index.joint(name)] == pytest.approx(reach / 2, abs=0.002), name
        np.testing.assert_allclose(seen(env, "vial")[0, :3], seen(env, "rack.well_3")[0, :3], atol=3e-3)
        put(env, "vial", seen(env, "device.well") + np.array([0.0, 0.0, 0.002, 0.0, 0.0, 0.0, 0.0]))
        for way, end in ((1.0, 1.0), (-1.0, 0.0)):
            for name in ENDS:
                set_opening(env, name, 0.5, 2.0 * way)
            run(env, 25)
            joints = env.engine.get_state().joint_pos[0]
            for name, reach in ENDS.items():
                at = joints[index.joint(name)]
                assert -0.1 * reach <= at <= 1.1 * reach, name
                assert abs(at - end * reach) < 0.5 * reach, name
        vial, well = seen(env, "vial"), seen(env, "device.well")
        np.testing.assert_allclose(vial[0, :3], well[0, :3], atol=4e-3)
        assert P.rotate(vial[:, 3:], np.array([[0.0, 0.0, 1.0]]))[0, 2] > 0.97


def boxes(share: float) -> list[tuple[str, int, Array, Array]]:
    """Name, link and corners of each solid of a device whose door and button are at a share of their ranges."""
    model = build("device", {})
    found: list[tuple[str, int, Array, Array]] = []
    moved = {joint.body: share * joint.upper * np.array(joint.axis) for joint in model.joints}
    for geom in model.geoms:
        body = model.bodies[geom.body]
        place = P.pose(geom.position, geom.quaternion)
        low, high = shape_bounds(geom.shape, place, {})
        at = np.array(body.position) + moved.get(geom.body, 0.0)
        found.append((geom.name, geom.body, low + at, high + at))
    return found


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_parts_of_a_device_keep_apart_wherever_its_door_is(share: float) -> None:
    for (name, link, low, high), (other, second, least, most) in combinations(boxes(share), 2):
        apart = np.maximum(low - most, least - high).max()
        assert apart > 1e-3 if link != second else apart >= -1e-9 or "bar" in name + other, (name, other)


def test_an_open_door_leaves_the_chamber_free_and_a_closed_one_covers_it() -> None:
    model = build("device", {})
    well = next(site for site in model.sites if site.name == "well")
    for share, covered in ((0.0, True), (1.0, False)):
        parts = [(low, high) for name, _, low, high in boxes(share) if name.startswith("door.")]
        before = well.position[1]
        for side in (-0.13, 0.0, 0.13):  # a hand is 0.2 m wide
            assert any(low[1] < before + side < high[1] for low, high in parts) is covered


def width(builder: str, one: str, other: str) -> float:
    """Between two walls along x [m]."""
    solids = {geom.name.rpartition(".")[2]: geom for geom in build(builder, {}).geoms}
    ends = [shape_bounds(solids[name].shape, P.pose(solids[name].position, (0, 0, 0, 1)), {}) for name in (one, other)]
    return float(ends[1][0][0] - ends[0][1][0])


def test_a_vial_fits_into_the_wells_with_less_room_than_it_needs_to_fall_over() -> None:
    radii = [geom.shape.radius for geom in build("vial", {}).geoms if isinstance(geom.shape, Cylinder)]
    assert len(radii) == 2
    for gap in (width("device", "well_back", "well_front"), width("rack", "across_0", "across_1")):
        assert 0.001 < gap - 2 * max(radii) < 0.01


@pytest.mark.parametrize(
    ("builder", "params", "words"),
    [
        ("device", {"size": [0.22, 0.5, 0.36]}, "a door of 0.302 m cannot slide aside on a front of 0.5 m"),
        ("device", {"well_inset": 0.02}, "does not fit into the chamber"),
        ("device", {"radius": 0.05}, "larger than the console"),
        ("rack", {"wells": [0, 3]}, "at least one well"),
        ("rack", {"well": 0.08}, "have no walls"),
        ("vial", {"cap": 0.2}, "leaves nothing of a vial"),
    ],
)
def test_what_does_not_fit_is_said(builder: str, params: dict[str, Any], words: str) -> None:
    (complaint,) = complaints(source={"procedural": builder, "params": params})
    assert words in complaint
