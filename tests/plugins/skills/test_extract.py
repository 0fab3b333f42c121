"""The skill extract on real engines: a peg pulled out of its hole, and one that does not come."""

import pytest

from anysim.skills.base import Outcome
from tests.plugins.skills.test_honest_failures import given_up
from tests.plugins.skills.test_manipulation import solved


def test_a_peg_is_pulled_out_on_mujoco() -> None:
    assert solved("extract_peg", "mujoco", 4) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_peg_is_pulled_out_on_the_other_engines(engine: str) -> None:
    assert solved("extract_peg", engine, 4) >= 0.75


def test_the_fingers_slip_off_a_peg_that_is_too_heavy() -> None:
    outcomes, _ = given_up("extract_peg", "world.objects.peg.mass=60.0", "task.horizon=2500")
    assert outcomes == [Outcome.UNSTABLE_GRASP] * 2


def test_one_that_does_not_come_under_a_gentle_pull_is_jammed() -> None:
    gentle = ("world.objects.peg.mass=60.0", "task.expert.lead=0.006", "task.horizon=2500")
    outcomes, said = given_up("extract_peg", *gentle)
    assert outcomes == [Outcome.JAMMED] * 2
    assert said["ladder"] == ["jammed -> replan", "jammed -> replan", "jammed -> give up"]
