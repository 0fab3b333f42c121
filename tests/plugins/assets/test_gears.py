"""Gears: what is in mesh turns what it meshes with, on every engine, and what does not fit is said."""

import numpy as np
import pytest

from anysim import compile_world, create_simulation
from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.math import pose as P
from anysim.model.world import World
from tests.plugins.assets.test_procedural import complaints


def over_the_shaft(height: float, yaw: float = 0.0) -> World:
    """A stand on the ground, and a gear over its shaft, the gear's bottom at a height."""
    parts = {"stand": "gear_stand", "gear": "gear"}
    objects = {name: {"source": {"procedural": part}, "friction": 0.3} for name, part in parts.items()}
    objects["stand"] |= {"fixed": True}
    layout = {"stand": {"position": [0, 0, 0]}, "gear": {"position": [0, 0, height], "yaw": yaw}}
    return compile_world({"world": {"terrain": {"kind": "plane"}, "objects": objects, "layout": layout}})


@pytest.mark.parametrize("engine", runnable(Capability.DYNAMICS))
def test_a_gear_on_the_shaft_turns_with_both_of_its_neighbours(engine: str) -> None:
    world = over_the_shaft(0.011)
    with create_simulation(engine) as simulation:
        simulation.create_world(world, 1)
        left, gear = (simulation.index.body(name) for name in ("stand.left", "gear"))
        for _ in range(150):
            simulation.apply_wrench([[[0.0, 0.0, 0.0, 0.0, 0.0, 0.02]]], [left])
            simulation.step(1)
        state = simulation.get_state()
        turned = dict(zip((joint.name for joint in world.joints), state.joint_pos[0], strict=True))
        pose = state.body_pose[0, gear]
    yaw = 2.0 * np.arctan2(pose[5], pose[6])
    assert turned["stand.left"] > 0.3
    assert turned["stand.right"] == pytest.approx(turned["stand.left"], abs=0.45)  # twice the play of a tooth
    assert np.sin(yaw + turned["stand.left"]) == pytest.approx(0.0, abs=0.4)
    assert P.rotate(pose[3:], np.array([0.0, 0.0, 1.0]))[2] > 0.99


@pytest.mark.parametrize("engine", runnable(Capability.DYNAMICS))
@pytest.mark.parametrize(("yaw", "seated"), [(0.0, True), (np.pi / 12, False)])
def test_it_sinks_into_mesh_only_where_its_teeth_fit(engine: str, yaw: float, seated: bool) -> None:
    with create_simulation(engine) as simulation:
        simulation.create_world(over_the_shaft(0.03, yaw), 1)
        simulation.step(300)
        height = simulation.get_state().body_pose[0, simulation.index.body("gear"), 2]
    assert (abs(height - 0.01) < 0.002) == seated
    assert seated or height > 0.023  # on the teeth of its neighbours


def test_what_does_not_fit_is_said_with_its_key() -> None:
    for name, params, key in (
        ("gear", {"hub": 0.019}, "hub"),
        ("gear", {"hub": 0.05}, "hub"),
        ("gear", {"hub_height": 0.01}, "hub_height"),
        ("gear_stand", {"shaft": 0.04}, "shaft"),
    ):
        [text] = complaints(source={"procedural": name, "params": params})
        assert text.startswith(f"objects.it.source.params.{key}: ")
