"""The last rung of the ladder, on which arms go home and start anew; and hands that hold a neighbour."""

from collections.abc import Callable

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.arm import Arm
from tests.plugins.skills.test_manipulation import WORLDS
from tests.tiers import ENGINES, often

ONE = np.array([0])
TURNED_UP = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.3, 0.0])
"""[rad] from home; the tool looks up by that much."""


def run(env: TaskEnv, policy: SkillPolicy, meanwhile: Callable[[str], None] = lambda phase: None) -> list[str]:
    """The ladder, once the task has ended or the skill gave up; `meanwhile` is told the phase in each control step."""
    policy.begin(ONE)
    while env.running[0] and not policy.gave_up(ONE)[0]:
        env.step(policy.act(ONE))
        meanwhile(str(policy.describe(0)["phase"]))
    ladder = policy.describe(0).get("ladder", [])
    assert isinstance(ladder, list)
    return ladder


@pytest.mark.parametrize("engine", often(["pybullet"], ENGINES))
def test_an_arm_in_an_awkward_posture_reaches_from_home(engine: str) -> None:
    """The tool keeps its orientation, in which the goal is out of reach; from home it comes from above."""
    require_engine(engine)
    goal = "task.command.goal={term: goal_above, surface: table, x: 0.0, y: 0.0, height: 0.2}"
    with make("reach", engine=engine, overrides=[goal, "record.cameras=[]", "task.horizon=1500"]) as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        arm = Arm.of(env, env.scene.robot("panda"))
        awkward = arm.chain.initial + TURNED_UP
        env.engine.set_joint_state(awkward[None], np.zeros((1, 7)), joints=arm.chain.joints)
        assert run(env, policy) == ["no_ik -> back_off", "no_ik -> recover"]
        assert env.status[0] == "success"


@pytest.mark.parametrize("engine", often(["mujoco"], ENGINES))
def test_what_is_held_is_kept_where_it_cannot_be_put(engine: str) -> None:
    """The pad is out of reach: the cube is carried home, tried once more from there, and not dropped."""
    require_engine(engine)
    far = "world.layout.pad={position: [0.9, 0.5, 0.402], checked: false}"
    with make("place_on_pad", engine=engine, overrides=[far, "record.cameras=[]", "task.horizon=3000"]) as env:
        env.reset(seed=3)
        policy, homes = SkillPolicy(env), []
        # the cube is grasped without a look ahead at where it goes
        policy.skill.members[0]._ahead.then = None  # type: ignore[attr-defined]

        def look(phase: str) -> None:
            if phase == "place: go home":
                homes.append(env.scene.frame("cube").position[0] - env.scene.robot("panda").tool().position[0])

        assert run(env, policy, look) == ["timeout -> recover", "timeout -> give up"]
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.TIMEOUT
        assert homes
        assert np.linalg.norm(homes, axis=1).max() < 0.02


def test_an_obstacle_that_goes_while_the_arm_is_home() -> None:
    wall = (
        "world.objects.wall={source: {box: [0.5, 0.03, 0.4]}, mass: 60.0}",
        "world.layout.wall={position: [0.45, 0.15, 0.6]}",
        "world.layout.cube.y=0.3",
    )
    with make(WORLDS / "two_cubes.yaml", engine="mujoco", overrides=[*wall, "task.expert={phase_steps: 60}"]) as env:
        env.reset(seed=3)
        body = env.engine.index.body("wall")
        away = np.array([[[0.4, 2.0, 0.2, 0.0, 0.0, 0.0, 1.0]]])
        phases: list[str] = []

        def take_away(phase: str) -> None:
            if phase == "go home":
                env.engine.set_body_state(away, np.zeros((1, 1, 6)), bodies=[body])
            phases.append(phase)

        ladder = run(env, SkillPolicy(env), take_away)
        assert env.status[0] == "success"
        assert ladder[-1].endswith(" -> recover")
        order = [phase for phase, before in zip(phases[1:], phases, strict=False) if phase != before]
        at = order.index("let go")
        assert order[at : at + 5] == ["let go", "draw back", "draw up", "go home", "choose"]


def swapped(env: TaskEnv, policy: SkillPolicy, times: int) -> list[str]:
    """The cubes change places whenever the fingers begin to close, as often as that."""
    bodies, left = [env.engine.index.body(name) for name in ("cube", "other")], [times]

    def swap(phase: str) -> None:
        if phase == "close" and left[0] and policy.skill.steps[0] == 1:  # type: ignore[attr-defined]
            left[0] -= 1
            here: Array = env.engine.get_state().body_pose[:, bodies].copy()
            env.engine.set_body_state(here[:, ::-1], np.zeros((1, 2, 6)), bodies=bodies)

    return run(env, policy, swap)


@pytest.mark.parametrize("engine", often(["sapien"], ENGINES))
def test_a_neighbour_between_the_fingers_is_let_go_of_and_the_right_one_grasped(engine: str) -> None:
    require_engine(engine)
    with make(WORLDS / "two_cubes.yaml", engine=engine) as env:
        env.reset(seed=3)
        assert swapped(env, SkillPolicy(env), 1) == ["wrong_object -> back_off"]
        assert env.status[0] == "success"


def test_a_neighbour_each_time_is_the_outcome() -> None:
    with make(WORLDS / "two_cubes.yaml", engine="mujoco") as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        tried = ("back_off", "recover", "give up")
        assert swapped(env, policy, 9) == [f"wrong_object -> {rung}" for rung in tried]
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.WRONG_OBJECT


def test_fingers_that_close_on_nothing_hold_no_neighbour() -> None:
    """The cube is gone and the other one stands where it was: what is lifted is missing, and nothing wrong."""
    with make(WORLDS / "two_cubes.yaml", engine="mujoco") as env:
        env.reset(seed=3)
        policy, body = SkillPolicy(env), env.engine.index.body("cube")
        aside = np.array([[[0.3, 0.5, 0.42, 0.0, 0.0, 0.0, 1.0]]])
        left = [1]

        def take_away(phase: str) -> None:
            if phase == "close" and left[0]:
                left[0] = 0
                env.engine.set_body_state(aside, np.zeros((1, 1, 6)), bodies=[body])

        assert run(env, policy, take_away)[0].startswith("unstable_grasp")
        assert env.status[0] == "success"
