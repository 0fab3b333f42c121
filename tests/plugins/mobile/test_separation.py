"""Distances between a robot's outline and discs over others, and the terms that are made of them."""

from collections.abc import Iterator

import numpy as np
import pytest

import anysim
from anysim.errors import NameLookupError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_mobile.separation import Separation
from tests.tasks.states import put, seen

RUN = {
    "engine": "null",
    "world": {
        "robots": {"base": {"robot": "differential_base", "actions": {"base": "differential_drive"}}},
        "objects": {"ball": {"source": {"sphere": 0.2}}, "rod": {"source": {"capsule": [0.1, 0.4]}}},
        "layout": {"ball": {"position": [2.0, 0.0, 0.2]}, "rod": {"position": [0.0, 3.0, 0.5]}},
    },
    "task": {"observations": {"policy": [{"term": "mobile.gap", "robot": "base", "entity": "ball"}]}},
}


@pytest.fixture(scope="module")
def env() -> Iterator[TaskEnv]:
    with anysim.make(RUN) as env:
        env.reset(seed=0)
        yield env


def _turned(pose: np.ndarray, yaw: float) -> np.ndarray:
    pose = pose.copy()
    pose[:, 3:] = P.from_roll_pitch_yaw(np.array([0.0, 0.0, yaw]))
    return pose


def test_a_gap_is_measured_from_the_outline_of_the_robot(env: TaskEnv) -> None:
    separation = Separation(env.scene, env.scene.robot("base"), ["ball"])
    low, high = separation.low, separation.high
    start = seen(env, "base")
    assert separation.nearest() == pytest.approx(2.0 - high[0] - 0.2 - start[0, 0], abs=1e-6)
    put(env, "base", _turned(start, np.pi / 2))  # now its side looks there
    assert separation.nearest() == pytest.approx(2.0 + low[1] - 0.2 - start[0, 0], abs=1e-6)
    put(env, "base", _turned(start, 0.0))
    ball = seen(env, "ball")
    ball[:, :2] = start[:, :2]
    put(env, "ball", ball)
    assert separation.nearest() == 0.0


def test_nobody_is_infinitely_far_and_unknown_names_are_refused(env: TaskEnv) -> None:
    robot = env.scene.robot("base")
    assert np.isinf(Separation(env.scene, robot, []).nearest()).all()
    assert Separation(env.scene, robot, ["rod"]).count == 3
    with pytest.raises(NameLookupError, match="there is no entity 'bal'"):
        Separation(env.scene, robot, ["bal"])
