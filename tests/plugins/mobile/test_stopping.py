"""Stops in physics, against the formula; and what a base does for a person that one that does not look out fails to."""

import numpy as np
import pytest

from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from anysim_mobile.guarded_base import stopping_distance
from anysim_mobile.stopping import CLEAR, LESS, stop
from tests.tasks.states import blind

TOLERANCE = 0.015
"""[m] by which a stop may be longer or shorter than the formula says."""
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


def test_the_formula_is_that_of_uniform_braking() -> None:
    assert stopping_distance(np.array(0.8), 0.7, 0.2) == pytest.approx(0.8 * 0.2 + 0.64 / 1.4)
    assert np.allclose(stopping_distance(np.array([0.0, 1.0]), 0.5, 0.1), [0.0, 1.1])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_base_stops_within_the_distance_of_the_formula(engine: str) -> None:
    require_engine(engine)
    found = stop("mobile_panda", engine, 0.8, 0.2)
    assert found.speed == pytest.approx(0.8, abs=0.01)
    assert found.distance == pytest.approx(found.formula, abs=TOLERANCE)
    assert found.left == pytest.approx(CLEAR - LESS, abs=TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "latency"), [(0.3, 0.0), (0.8, 0.0), (0.5, 0.3)])
def test_it_does_so_at_other_speeds_and_latencies(speed: float, latency: float) -> None:
    require_engine("mujoco")
    found = stop("mobile_panda", "mujoco", speed, latency)
    assert found.distance == pytest.approx(found.formula, abs=TOLERANCE)


def test_a_base_that_does_not_look_out_comes_too_near() -> None:
    require_engine("mujoco")
    careless = ("task.expert.skill=navigate", "task.expert.people=null")
    with blind("stop_for_person", "mujoco", 1, *careless) as env:
        env.reset(seed=4001)
        policy, everyone = SkillPolicy(env), np.arange(1)
        policy.begin(everyone)
        for _ in range(450):
            running = np.flatnonzero(env.running)
            if not len(running):
                break
            env.step(policy.act(running), env.running)
        assert env.status.tolist() == ["failed"]
