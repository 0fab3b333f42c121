"""Frames of affordances in terms, what is in a hole, and what is inside of something."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.task.env import TaskEnv
from tests.task.test_place_terms import put, term

WORLD: dict[str, Any] = {
    "engine": "null",
    "world": {
        "name": "holes",
        "objects": {
            "block": {"source": {"procedural": "hole_block", "params": {"clearance": 0.003}}, "fixed": True},
            "cabinet": {"source": "procedural:cabinet", "fixed": True},
            "peg": {"source": "procedural:peg"},
            "bin": {"source": "procedural:tray"},
            "bead": {"source": {"sphere": 0.01}},
        },
        "layout": {
            "block": {"position": [0.5, 0.0, 0.0], "yaw": 0.7},
            "cabinet": {"position": [-1.0, 0.0, 0.0]},
            "peg": {"position": [0.5, 0.0, 0.5]},
            "bin": {"position": [0.0, 1.0, 0.0]},
            "bead": {"position": [0.0, 2.0, 1.0]},
        },
    },
    "task": {"horizon": 5, "observations": {"policy": [{"term": "frame_pose", "frame": "block/mouth"}]}},
}


@pytest.fixture(scope="module")
def env() -> Any:
    with anysim.make(WORLD, num_envs=1) as made:
        made.reset(seed=0)
        yield made


def test_an_affordance_is_a_frame(env: TaskEnv) -> None:
    for name, frame in (("block/mouth", "block.mouth"), ("cabinet/drawer_1.handle", "cabinet.drawer_1.handle")):
        np.testing.assert_allclose(env.scene.frame(name).pose, env.scene.frame(frame).pose)
    assert env.scene.frame("peg/body").position.tolist() == env.scene.frame("peg").position.tolist()


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("block/hole", "'block' has no affordance 'hole'.*affordances: mouth"),
        ("blok/mouth", "'blok' is no entity; did you mean 'block'"),
        ("cabinet/drawer_1", r"'cabinet' has no affordance 'drawer_1'.*drawer_1\.handle, drawer_2\.handle"),
        ("/mouth", "a reference is a name"),
    ],
)
def test_an_affordance_that_there_is_not_is_told_when_the_env_is_built(frame: str, words: str) -> None:
    task = {**WORLD["task"], "observations": {"policy": [{"term": "frame_pose", "frame": frame}]}}
    with pytest.raises(SpecError, match=words):
        anysim.make({**WORLD, "task": task})


@pytest.mark.parametrize(
    ("depth", "aside", "said"),
    [(0.046, 0.0, True), (0.044, 0.0, False), (0.046, 0.0029, True), (0.046, 0.0031, False), (-0.01, 0.0, False)],
)
def test_inserted_is_a_share_of_the_depth_near_the_axis(env: TaskEnv, depth: float, aside: float, said: bool) -> None:
    place = env.scene.frame("block/mouth").position[0]
    put(
        env, "peg", place + np.array([aside, 0.0, 0.05 - depth])
    )  # its tip is 5 cm below its middle, the hole 5 cm deep
    assert term(env, "predicate", "inserted", a="peg.tip", hole="block/mouth").tolist() == [said]
    assert term(env, "predicate", "inserted", a="peg.tip", hole="block/mouth", lateral=1.0).tolist() == [depth > 0.045]


def test_nothing_is_inserted_into_what_is_no_hole(env: TaskEnv) -> None:
    with pytest.raises(SpecError, match=r"'cabinet/drawer_1\.handle' is a handle, and nothing goes into it"):
        term(env, "predicate", "inserted", a="peg", hole="cabinet/drawer_1.handle")


def test_contained_is_over_the_floor_within_the_walls_and_below_the_rim(env: TaskEnv) -> None:
    put(env, "bin", (0.2, 1.0, 0.3), (0.0, 0.0, np.pi / 2))  # 0.3 x 0.2 x 0.1 m, along the world's y
    for at, said, deep in (
        ((0.2, 1.0, 0.35), True, True),
        ((0.2, 1.14, 0.35), True, True),
        ((0.34, 1.0, 0.35), False, False),
        ((0.2, 1.0, 0.39), True, False),
        ((0.2, 1.0, 0.41), False, False),
        ((0.2, 1.0, 0.3), False, False),
    ):
        put(env, "bead", at)
        assert term(env, "predicate", "contained", a="bead", b="bin").tolist() == [said], at
        assert term(env, "predicate", "contained", a="bead", b="bin", rim=0.03).tolist() == [deep], at


def test_what_is_in_a_drawer_moves_with_it(env: TaskEnv) -> None:
    joint = env.engine.index.joint("cabinet.drawer_1")
    inside = {"a": "bead", "b": "cabinet", "part": "drawer_1"}
    middle = env.scene.frame("cabinet.drawer_1").position[0] + np.array([-0.2, 0.0, 0.02])
    put(env, "bead", middle)
    drawn = env.scene.engine.world.joints[joint].upper
    along = env.scene.frame("cabinet.drawer_1").position[0].copy()
    assert term(env, "predicate", "contained", **inside).tolist() == [True]
    env.engine.set_joint_state(np.array([[drawn]]), np.zeros((1, 1)), None, [joint])
    env.scene.look(None)
    moved = env.scene.frame("cabinet.drawer_1").position[0] - along
    assert np.linalg.norm(moved) == pytest.approx(drawn)
    assert term(env, "predicate", "contained", **inside).tolist() == [False]
    put(env, "bead", middle + moved)
    assert term(env, "predicate", "contained", **inside).tolist() == [True]


def test_what_has_no_inside_says_which_surfaces_it_has(env: TaskEnv) -> None:
    with pytest.raises(Exception, match=r"'peg' has no floor that walls surround \(surfaces: top\)"):
        term(env, "predicate", "contained", a="bead", b="peg")
