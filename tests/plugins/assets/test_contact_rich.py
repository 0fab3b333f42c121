"""Taps, switches, plugs and sockets: joints stay in range on each engine, plugs fit, and what cannot be is said."""

from typing import Any

import numpy as np
import pytest

from anysim.api import make
from anysim.assets.procedural import build
from anysim.model.world import Box, Geom
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.assets.test_procedural import complaints
from tests.tasks.states import set_opening

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
JOINTS = {"tap.lever": 1.745, "switch.rocker": 0.6}


def on_a_plane(engine: str, objects: dict[str, Any], layout: dict[str, Any], jointed: str) -> TaskEnv:
    """One env with objects, of which one has joints."""
    require_engine(engine)
    world = {"terrain": {"kind": "plane"}, "objects": objects, "layout": layout}
    task = {"observations": {"policy": [{"term": "object_joint_pos", "object": jointed}]}}
    file = {"physics": {"dt": 0.001, "control_dt": 0.02}, "world": world, "task": task}
    return make(file, engine=engine, num_envs=1)


def scene(engine: str) -> TaskEnv:
    """A tap, a switch, and a charger in its socket."""
    objects = {
        "tap": {"source": "procedural:faucet", "fixed": True},
        "switch": {"source": "procedural:rocker_switch", "fixed": True},
        "socket": {"source": "procedural:socket", "fixed": True},
        "charger": {"source": "procedural:plug"},
    }
    layout = {
        "tap": {"position": [0.0, 0.0, 0.0]},
        "switch": {"position": [0.3, 0.0, 0.0]},
        "socket": {"position": [0.6, 0.0, 0.0]},
        "charger": {"position": [0.6, 0.0, 0.04], "checked": False},
    }
    return on_a_plane(engine, objects, layout, "tap")


@pytest.mark.parametrize("engine", ENGINES)
def test_joints_stay_where_friction_holds_them_and_a_plug_in_its_socket(engine: str) -> None:
    with scene(engine) as env:
        env.reset(seed=0)
        for name in JOINTS:
            set_opening(env, name, 0.5)
        for _ in range(25):
            env.step(np.zeros((1, env.action_dim)))
        state, index = env.engine.get_state(), env.engine.index
        for name, reach in JOINTS.items():
            assert state.joint_pos[0, index.joint(name)] == pytest.approx(reach / 2, abs=0.02), name
        assert state.body_pose[0, index.body("charger"), :3] == pytest.approx([0.6, 0.0, 0.04], abs=1e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_joints_that_are_thrown_stop_at_their_ends(engine: str) -> None:
    with scene(engine) as env:
        env.reset(seed=0)
        numbers = [env.engine.index.joint(name) for name in JOINTS]
        for way in (1.0, -1.0):
            middle = np.array([[reach / 2 for reach in JOINTS.values()]])
            env.engine.set_joint_state(middle, np.full((1, len(JOINTS)), 30.0 * way), None, numbers)
            for _ in range(25):
                env.step(np.zeros((1, env.action_dim)))
            ended = env.engine.get_state().joint_pos[0, numbers]
            for at, (name, reach) in zip(ended, JOINTS.items(), strict=True):
                assert -0.05 <= at <= reach + 0.05, name
                assert way * (at - reach / 2) > 0, name


def solid_at(geoms: tuple[Geom, ...], point: np.ndarray) -> bool:
    """Whether a point is inside of one of the boxes, none of which is turned."""
    for geom in geoms:
        assert isinstance(geom.shape, Box)
        if (np.abs(point - np.array(geom.position)) < np.array(geom.shape.half_size)).all():
            return True
    return False


@pytest.mark.parametrize(("prongs", "prong"), [(2, (0.0015, 0.0064, 0.016)), (1, (0.012, 0.0045, 0.014))])
def test_a_slot_has_the_clearance_on_each_side(prongs: int, prong: tuple[float, float, float]) -> None:
    params: dict[str, Any] = {"prongs": prongs, "prong": list(prong)}
    slots = build("socket", {**params, "clearance": 0.0005}).geoms
    plugged = [geom for geom in build("plug", params).geoms if "prong" in geom.name]
    assert len(plugged) == prongs
    for geom in plugged:
        assert isinstance(geom.shape, Box)
        for axis in (0, 1):
            for way in (-1.0, 1.0):
                beside = np.array([geom.position[0], 0.0, 0.01])
                beside[axis] += way * (geom.shape.half_size[axis] + 0.0004)
                assert not solid_at(slots, beside)
                beside[axis] += way * 0.0002
                assert solid_at(slots, beside)


@pytest.mark.parametrize(
    ("name", "params", "key"),
    [
        ("door", {"lever": 0.8, "handle": {"style": "knob"}}, "handle.style"),
        ("door", {"lever": 0.8, "handle": {"length": 0.8}}, "handle.length"),
        ("door", {"lever": 0.8, "handle": {"standoff": 0.008}}, "handle.standoff"),
        ("faucet", {"height": 0.05}, "height"),
        ("faucet", {"base": 0.03}, "base"),
        ("faucet", {"lever": 0.04}, "lever"),
        ("faucet", {"spout": 0.04}, "spout"),
        ("rocker_switch", {"length": 0.2}, "length"),
        ("rocker_switch", {"range": 1.6}, "range"),
        ("rocker_switch", {"thickness": 0.5}, "thickness"),
        ("plug", {"spacing": 0.001}, "spacing"),
        ("plug", {"spacing": 0.04}, "size"),
        ("socket", {"clearance": 0.003}, "spacing"),
        ("socket", {"size": [0.1, 0.1, 0.01]}, "size"),
        ("socket", {"prongs": 1, "size": [0.1, 0.007, 0.02]}, "size"),
    ],
)
def test_what_does_not_fit_is_said_with_its_key(name: str, params: dict[str, Any], key: str) -> None:
    [text] = complaints(source={"procedural": name, "params": params})
    assert text.startswith(f"objects.it.source.params.{key}: "), text
