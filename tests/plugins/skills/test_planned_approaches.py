"""Skills that approach what they touch: with a planner around what is in the way, where a straight line is held up."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.tiers import others_in_turn

WORLD = Path(__file__).parent / "worlds/parts_behind_wall.yaml"
SKILLS = {
    "reach": "goal: goal",
    "push": "object: cube, goal: goal",
    "press": "button: button.cap.top, part: button.cap",
    "open": "part: cabinet.drawer_1, fraction: 0.5",
}
STEPS = 500


def ended(skill: str, planner: str, engine: str) -> list[tuple[Outcome, int]]:
    """The outcome in each env, and how often something else was tried."""
    expert = f"task.expert={{skill: {skill}, robot: panda, {SKILLS[skill]}, planner: {planner!r}}}"
    with make(WORLD, engine=engine, num_envs=2, overrides=[expert, "task.on_success=continue"]) as env:
        env.reset(seed=11)
        policy, everyone = SkillPolicy(env), np.arange(2)
        policy.begin(everyone)
        for _ in range(STEPS):
            if policy.skill.outcome.all():
                break
            env.step(policy.act(everyone))
        return [(OUTCOMES[policy.skill.outcome[i]], int(policy.skill.attempts[i])) for i in everyone]


@pytest.mark.parametrize(
    "skill", [skill if skill == "reach" else pytest.param(skill, marks=pytest.mark.slow) for skill in SKILLS]
)
def test_what_is_behind_a_wall_is_reached_with_a_planner_and_held_up_without(skill: str) -> None:
    assert [outcome for outcome, _ in ended(skill, "rrt", "mujoco")] == [Outcome.OK] * 2
    assert (Outcome.OK, 1) not in ended(skill, "", "mujoco")


@pytest.mark.parametrize(("skill", "engine"), others_in_turn(SKILLS))
def test_it_is_reached_on_the_other_engines(engine: str, skill: str) -> None:
    require_engine(engine)
    assert [outcome for outcome, _ in ended(skill, "rrt", engine)] == [Outcome.OK] * 2
