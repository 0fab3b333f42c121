"""Bases recover by another place: a way around, another stand, and a new line of the arm above them."""

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from anysim_skills.moving.approach import Approach
from tests.plugins.skills.test_navigate import FETCH, WORLD, sent
from tests.plugins.skills.test_recovery import ONE, run

CRATE = (
    "world.objects.crate={source: {box: [0.2, 1.0, 0.5]}, fixed: true}",
    "world.layout.crate={position: [1.0, 0.1, 0.25]}",
    "world.layout.spot={position: [2.0, 0.0, -0.02], yaw: 0.0, checked: false}",
)


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
)
def test_a_base_before_a_crate_goes_around_it(engine: str) -> None:
    require_engine(engine)
    with sent(engine, "differential_base", 1, *CRATE, "task.on_success=end", "task.horizon=3000") as env:
        env.reset(seed=11)
        assert run(env, SkillPolicy(env)) == ["controller -> back_off", "controller -> recover"]
        assert env.status[0] == "success"


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
)
def test_what_is_out_of_reach_from_one_stand_is_grasped_from_another(engine: str) -> None:
    require_engine(engine)
    far = "world.layout.spot={position: [0.7, 0.5, -0.02], yaw: 0.0, checked: false}"
    with make(FETCH, engine=engine, overrides=[far, "task.horizon=3000"]) as env:
        env.reset(seed=11)
        assert run(env, SkillPolicy(env)) == ["no_ik -> back_off", "no_ik -> recover"]
        assert env.status[0] == "success"


def test_an_approach_that_is_held_up_comes_from_another_side() -> None:
    """Something that is not seen holds the base where it is, until it recovers."""
    with make(WORLD.with_name("approach.yaml"), engine="mujoco", overrides=["task.horizon=3000"]) as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        approach = policy.skill.members[0]  # type: ignore[attr-defined]
        assert isinstance(approach, Approach)
        root = env.engine.index.entity("robot").root
        seen: list[int] = []

        def hold(phase: str) -> None:
            if phase != "1 approach: drive":
                return
            chosen = approach._choice.choose(ONE, approach._effort[ONE])[0]
            if not seen or seen[-1] != chosen:
                seen.append(int(chosen))
            if not any(rung == "recover" for _, rung in approach.climbs[0]):
                pose = env.engine.get_state().body_pose[:, [root]].copy()
                pose[..., :2] = begun
                env.engine.set_body_state(pose, np.zeros((1, 1, 6)), bodies=[root])

        begun = env.engine.get_state().body_pose[0, root, :2].copy()
        run(env, policy, hold)
        assert approach.climbs[0] == (("controller", "back_off"), ("controller", "recover"))
        assert env.status[0] == "success"
        directions = approach._ring.direction[seen]
        assert directions[-1] not in directions[:-1]


def test_a_tool_that_is_held_back_once_takes_another_line() -> None:
    """A wall stands on the line until the arm has gone home."""
    wall = (
        "world.objects.wall={source: {box: [0.1, 1.0, 1.4]}, mass: 200.0}",
        "world.layout.wall={position: [1.2, 0.2, 0.7]}",
    )
    world = WORLD.with_name("mobile_reach.yaml")
    with make(world, engine="mujoco", overrides=[*wall, "task.horizon=3000", "task.on_success=end"]) as env:
        env.reset(seed=11)
        away, body = np.array([[[1.2, 5.0, 0.7, 0.0, 0.0, 0.0, 1.0]]]), env.engine.index.body("wall")

        def take_away(phase: str) -> None:
            if phase == "go home":
                env.engine.set_body_state(away, np.zeros((1, 1, 6)), bodies=[body])

        policy = SkillPolicy(env)
        assert run(env, policy, take_away) == ["controller -> recover"]
        assert OUTCOMES[policy.skill.outcome[0]] is not Outcome.CONTROLLER
        assert env.status[0] == "success"
