"""Hands of the catalogue close on a thing and carry it on every engine, by the synergies of their entries."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import pytest

import anysim
from anysim.assets.catalogue import load_robot, missing_source
from anysim.conventions import Array
from anysim.task.env import TaskEnv

ENGINES = ("mujoco", "pybullet", "sapien")
HEIGHT = 0.6
"""[m] of the hand's origin above the ground."""
CLOSING, CARRYING = 1.0, 3.0
"""[s] with the thing supported, and without."""
SUPPORT = 0.02
"""[m] of the thing's ends that lie on the posts."""


class Grasp(NamedTuple):
    """A thing in a hand: its place relative to the hand's origin [m], and how far it may move [m]."""

    robot: str
    lift: float
    """[m] from the ground point of the robot to the hand's origin."""
    synergy: str
    source: dict[str, Any]
    length: float
    """[m] along y; where it lies on posts, its ends reach beyond the hand."""
    mass: float
    place: tuple[float, float, float]
    tolerance: float
    roll: float = 0.0
    held: bool = False
    """Somebody holds it until the hand is closed, instead of the posts: finger tips do not arrive all at once."""


def rod(robot: str, place: tuple[float, float, float]) -> Grasp:
    """A rod of 60 mm and 300 g across the palm.

    What is allowed is a sixth of its diameter: that much the fingers, whose drives are springs with a limit, give way
    when the posts go.
    """
    return Grasp(robot, 0.095, "power", {"cylinder": [0.03, 0.22]}, 0.22, 0.3, place, 0.01, np.pi / 2)


def block(robot: str, place: tuple[float, float, float]) -> Grasp:
    """A block of 35 mm and 100 g between the tips of two fingers and the thumb."""
    return Grasp(robot, 0.095, "pinch", {"box": [0.04, 0.07, 0.035]}, 0.07, 0.1, place, 0.01, held=True)


GRASPS = {
    "allegro_right power": rod("allegro_right", (0.0415, 0.0, -0.014)),
    "allegro_left power": rod("allegro_left", (0.0415, 0.0, -0.014)),
    "allegro_right pinch": block("allegro_right", (0.08, 0.022, 0.02)),
    "allegro_left pinch": block("allegro_left", (0.079, -0.0225, 0.02)),
    # upright between the three finger tips
    "dclaw power": Grasp(
        "dclaw", 0.009, "power", {"cylinder": [0.03, 0.12]}, 0.06, 0.2, (0.0, 0.0, 0.19), 0.01, held=True
    ),
}


@contextmanager
def world(grasp: Grasp, engine: str) -> Iterator[TaskEnv]:
    """The hand, and the thing on two posts beside it."""
    x, y, z = grasp.place
    z += HEIGHT
    half = grasp.source["box"][2] / 2 if "box" in grasp.source else grasp.source["cylinder"][0]
    beside = grasp.length / 2 + (0.2 if grasp.held else -SUPPORT / 2)
    posts = {
        name: {"position": [x, y + side * beside, z - half - 0.05]}
        for name, side in (("left_post", 1), ("right_post", -1))
    }
    post = {"source": {"box": [0.05, SUPPORT, 0.1]}, "fixed": True}
    action = {"controller": "gripper_multi_finger", "params": {"mode": "synergies", "synergies": [grasp.synergy]}}
    env = anysim.make(
        {
            "physics": {"dt": 0.002, "control_dt": 0.02},
            "world": {
                "robots": {
                    "hand": {"robot": grasp.robot, "position": [0, 0, HEIGHT - grasp.lift], "actions": {"eef": action}}
                },
                "objects": {
                    "thing": {"source": grasp.source, "mass": grasp.mass, "friction": 0.8},
                    "left_post": post,
                    "right_post": post,
                },
                "layout": {"thing": {"position": [x, y, z], "roll": grasp.roll}, **posts},
            },
            "task": {"horizon": 1000, "observations": {"policy": ["joint_pos"]}},
        },
        engine=engine,
    )
    try:
        env.reset(seed=0)
        yield env
    finally:
        env.close()


def carried(env: TaskEnv, closing: float, held: bool = False) -> tuple[Array, Array]:
    """Places (T, 3) of the thing from when its posts go on, relative to that moment; and the last joint positions."""
    names = [body.name for body in env.engine.world.bodies]
    thing, posts = names.index("thing"), [names.index("left_post"), names.index("right_post")]
    action = np.array([[closing]])
    start = env.engine.get_state().body_pose[:, [thing]].copy()
    for _ in range(round(CLOSING / 0.02)):
        if held:
            env.engine.set_body_state(start, np.zeros((1, 1, 6)), None, [thing])
        env.step(action)
    gone = env.engine.get_state().body_pose[:, posts].copy()
    gone[..., 2] = 0.05
    env.engine.set_body_state(gone, None, None, posts)
    start = env.engine.get_state().body_pose[0, thing, :3].copy()
    places = []
    for _ in range(round(CARRYING / 0.02)):
        env.step(action)
        places.append(env.engine.get_state().body_pose[0, thing, :3] - start)
    return np.array(places), env.engine.get_state().joint_pos[0].copy()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", GRASPS)
def test_a_closed_hand_carries_a_thing_for_three_seconds(name: str, engine: str) -> None:
    grasp = GRASPS[name]
    absent = missing_source(load_robot(grasp.robot))
    if absent:
        pytest.skip(f"{grasp.robot}: {absent}")
    with world(grasp, engine) as env:
        places, joints = carried(env, 1.0, grasp.held)
        moved = np.linalg.norm(places, axis=1)
        print(f"{name} {engine}: moved {1000 * moved.max():.2f} mm")
        assert moved.max() < grasp.tolerance, f"{name} on {engine}: it moved {1000 * moved.max():.1f} mm"
        lower = np.array([joint.lower for joint in env.engine.world.joints])
        upper = np.array([joint.upper for joint in env.engine.world.joints])
        assert (joints > lower - 0.02).all()
        assert (joints < upper + 0.02).all()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_an_open_hand_lets_it_fall(engine: str) -> None:
    """The posts alone carried it: without a grip it is gone, so what the test above sees is the grip."""
    with world(GRASPS["allegro_right power"], engine) as env:
        places, _ = carried(env, 0.0)
        assert places[-1, 2] < -0.1
