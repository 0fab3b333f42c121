"""Checks of requests that every solver shares, shown on a solver that answers with its question."""

from typing import Any

import numpy as np
import pytest

from anysim.errors import AnysimError, PluginError
from anysim.kinematics.chain import Chain
from anysim.planning.api import IkRequest, IkResult, IkStep, InverseKinematics, inverse_kinematics
from anysim.testing.arms import panda_arm


class Echo(InverseKinematics):
    """Keeps the request and returns the seeds."""

    def _solve(self, request: IkRequest, random_restarts: int, rng_seeds: np.ndarray) -> IkResult:
        self.request, self.rng_seeds = request, rng_seeds
        n = len(request.seeds)
        return IkResult(request.seeds, np.ones(n, bool), np.zeros(n), np.zeros(n), np.zeros(n, np.int64))

    def _step(self, request: IkRequest, max_step: Any, posture: Any, posture_gain: float, damping: float) -> IkStep:
        self.request, self.posture, self.max_step, self.gain = request, posture, max_step, posture_gain
        return IkStep(request.seeds, np.zeros(len(request.seeds)), np.zeros(len(request.seeds)))


@pytest.fixture
def echo() -> Echo:
    return Echo(Chain.from_world(panda_arm(), "panda", "arm", "tool"))


def question(n: int = 3) -> dict[str, Any]:
    pose = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (n, 1))
    return {
        "targets": pose,
        "base": pose.copy(),
        "seeds": np.zeros((n, 7)),
        "random_restarts": 2,
        "rng_seeds": np.arange(n, dtype=np.uint64),
    }


def test_the_request_is_a_copy_of_float64(echo: Echo) -> None:
    asked: dict[str, Any] = question() | {"seeds": np.zeros((3, 7), np.float32)}
    echo.solve(**asked)
    assert echo.request.seeds.dtype == np.float64
    assert not np.shares_memory(echo.request.targets, asked["targets"])
    assert echo.rng_seeds.dtype == np.uint64


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"targets": np.zeros(7)}, r"targets of panda.arm -> tool: expected shape \(7, 7\), got \(7,\)"),
        ({"base": np.zeros((2, 7))}, r"base of .*: expected shape \(3, 7\), got \(2, 7\)"),
        ({"seeds": np.zeros((3, 6))}, r"seeds of .*: expected shape \(3, 7\), got \(3, 6\)"),
        ({"seeds": np.full((3, 7), np.nan)}, r"seeds of .*: not finite in rows \[0, 1, 2\]"),
        ({"base": np.zeros((3, 7))}, r"base of .*: the quaternion of row 0 has length 0; expected a unit quaternion"),
        ({"rng_seeds": np.arange(2)}, r"rng_seeds of .*: expected 3 unsigned integers, one a row, got shape \(2,\)"),
        ({"rng_seeds": np.zeros(3)}, r"rng_seeds of .* of float64"),
        ({"random_restarts": -1}, r"random_restarts of .*: expected 0 or more, got -1"),
        ({"rotation_weight": (1.0, -1.0, 1.0)}, r"rotation_weight of .*: expected 3 numbers >= 0"),
        ({"rotation_weight": (1.0, 1.0)}, r"rotation_weight of .*: expected shape \(3,\), got \(2,\)"),
    ],
)
def test_a_wrong_question_is_refused_with_what_was_expected(echo: Echo, change: dict[str, Any], message: str) -> None:
    with pytest.raises(AnysimError, match=message):
        echo.solve(**(question() | change))


def test_a_step_broadcasts_posture_and_max_step(echo: Echo) -> None:
    asked = question()
    pose, q = asked["targets"], asked["seeds"]
    echo.step(pose, pose, q, max_step=0.1, posture=np.arange(7.0))
    assert echo.posture.shape == (3, 7)
    assert echo.max_step.tolist() == [0.1] * 7
    echo.step(pose, pose, q, max_step=np.inf)
    assert echo.gain == 0.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_step": 0.0}, r"max_step of .*: expected a positive number or 7 of them, got 0.0"),
        ({"max_step": np.ones(3)}, "max_step of"),
        ({"max_step": 1.0, "posture": np.zeros(6)}, r"posture of .*: expected shape \(7,\) or \(3, 7\), got \(6,\)"),
        ({"max_step": 1.0, "damping": 0.0}, "expected damping > 0"),
        ({"max_step": 1.0, "posture": np.zeros(7), "posture_gain": 2.0}, r"posture_gain in \[0, 1\]"),
    ],
)
def test_a_wrong_step_is_refused(echo: Echo, options: dict[str, Any], message: str) -> None:
    asked = question()
    with pytest.raises(AnysimError, match=message):
        echo.step(asked["targets"], asked["base"], asked["seeds"], **options)


def test_an_unknown_solver_lists_what_is_installed() -> None:
    chain = Chain.from_world(panda_arm(), "panda", "arm", "tool")
    with pytest.raises(PluginError, match="no planner named 'analytic' is installed"):
        inverse_kinematics(chain, "analytic")
