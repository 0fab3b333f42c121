"""Walks that avatars begin of themselves in a task: a stroll, and a step into the way of a robot."""

import numpy as np
import pytest

import anysim
from anysim.task.env import TaskEnv
from tests.plugins.avatars.people import run_of, wait

QUARTER = np.pi / 2


def with_event(name: str, event: dict[str, object], **more: object) -> dict[str, object]:
    run = run_of([], **more)
    run["task"]["events"] = {name: {"term": f"avatars.{name}", "avatar": "ann", **event}}
    return run


def place(env: TaskEnv) -> np.ndarray:
    """(N, 2) of the avatar in its env [m]."""
    return env.scene.frame("ann").position[:, :2] - env.scene.origin[:, :2]


def test_a_stroll_has_legs_and_turns_and_stays_within_its_bounds() -> None:
    event = {"when": "reset", "legs": 2, "length": 1.0, "turn": QUARTER, "speed": 1.5, "wait": 0.2}
    ends = {}
    for within in (3.0, 0.6):
        with anysim.make(with_event("stroll", {**event, "within": within})) as env:
            env.reset(seed=0)
            for _ in range(10):
                wait(env)
            assert np.allclose(place(env), 0.0, atol=0.05), "it waits"
            for _ in range(190):
                wait(env)
            ends[within] = place(env)[0]
    assert np.allclose(ends[3.0], (1.0, 1.0), atol=0.05)
    assert np.allclose(ends[0.6], (0.6, 0.6), atol=0.05)


def test_strolls_are_drawn_for_each_env_and_the_same_by_seed() -> None:
    event = {"when": "reset", "length": {"range": [0.5, 1.5]}, "turn": {"range": [-1.0, 1.0]}, "within": 3.0}
    with anysim.make(with_event("stroll", event, num_envs=2)) as env:
        seen = []
        for _ in range(2):
            env.reset(seed=4)
            for _ in range(150):
                wait(env)
            seen.append(place(env))
    assert np.array_equal(*seen)
    assert np.hypot(*(seen[0][0] - seen[0][1])) > 0.1


@pytest.mark.parametrize("further", [1.0, -0.5])
def test_it_steps_out_once_a_robot_is_near_stands_and_goes_on(further: float) -> None:
    """In one env the robot comes near, in the other it stays away."""
    event = {"when": "step", "robot": "rover", "near": 1.5, "across": 0.8, "seconds": 0.6, "further": further}
    world = {"robots": {"rover": {"robot": "differential_base", "position": [4.0, 0.0, 0.0]}}}
    with anysim.make(with_event("step_out", event, world=world, num_envs=2)) as env:
        env.reset(seed=0)
        wait(env)
        assert np.allclose(place(env), 0.0, atol=0.05)
        rover = env.scene.index.body("rover")
        pose = env.engine.get_state().body_pose[:, [rover]].copy()
        pose[0, 0, 0] -= 2.0  # 1.2 m from the place that it walks to
        env.engine.set_body_state(pose, bodies=[rover])
        way = []
        for _ in range(250):
            wait(env)
            way.append(place(env)[:, 0])
    went, stayed = np.array(way).T
    assert np.abs(stayed).max() < 0.05
    stands = np.abs(went - 0.8) < 0.05
    assert stands.sum() * 0.02 >= 0.6
    assert went[-1] == pytest.approx(0.8 + further, abs=0.05)
