"""Fingers press as hard as a skill is told, on each engine; where a gripper cannot, that is refused at the key."""

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine

GRADED = "world.robots.panda.actions.eef=gripper_force"
FINE = "physics.dt=0.001"
"""At 2 ms MuJoCo's stiff pads bounce under drives that are not at their limit: the force is right in the mean alone."""
TOLERANCE = 0.05
"""Of the force. MuJoCo: 0.03; PyBullet and SAPIEN: 0.002, at 2 ms too."""
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


def pressed(env: TaskEnv) -> Array:
    """(2,) [N] of the contacts of each finger with the cube, along the way on which the fingers close."""
    env.scene.look(None)
    names = [body.name for body in env.engine.world.bodies]
    cube, points = names.index("cube"), env.engine.contacts(np.array([0]))
    way = P.rotate(env.scene.frame("panda.tool").quaternion, np.array([[0.0, 1.0, 0.0]]))[0]
    along = np.abs(points.force @ way)
    fingers = [number for number, name in enumerate(names) if name.endswith("finger")]
    pairs = np.sort(np.stack([points.body_a, points.body_b], axis=1), axis=1)
    return np.array([along[(pairs == sorted((cube, one))).all(axis=1)].sum() for one in fingers])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("force", [10.0, 30.0])
def test_each_finger_presses_with_the_force_that_is_asked_for(engine: str, force: float) -> None:
    """Measured on a box that is lifted and held, over half a second."""
    require_engine(engine)
    held = [GRADED, FINE, "task.expert.hold=40", f"task.expert.force={force}", "world.objects.cube.mass=0.1"]
    with make("lift_cube", engine=engine, overrides=["record.cameras=[]", "task.on_success=continue", *held]) as env:
        env.reset(seed=3)
        policy, found = SkillPolicy(env), []
        policy.begin(np.array([0]))
        while policy.skill.outcome[0] == OUTCOMES.index(Outcome.RUNNING):
            env.step(policy.act(np.array([0])))
            found.append(pressed(env))
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.OK
        assert np.abs(np.mean(found[-25:], axis=0) / force - 1.0).max() < TOLERANCE


def test_without_a_force_it_presses_with_all_that_it_has_and_after_a_grasp_with_one_again() -> None:
    """The same actions as with `gripper_binary`; what a grasp was told ends where the hand opens."""
    actions = []
    for force in ([], ["task.expert.force=10"]):
        with make("lift_cube", engine="mujoco", overrides=["record.cameras=[]", GRADED, *force]) as env:
            env.reset(seed=3)
            policy, own = SkillPolicy(env), env.actions.slice_of("panda", "eef")
            policy.begin(np.array([0]))
            for _ in range(120):
                action = policy.act(np.array([0]))
                env.step(action)
            actions.append(action[0, own.start])
            arm = policy.skill.movers[0]  # pyright: ignore[reportAttributeAccessIssue]
            arm.closed[:] = False
            arm.act(np.array([0]), action)
            assert (action[0, own.start], arm.press[0]) == (1.0, 1.0)
    assert actions == [-1.0, -0.25]


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (
            [],
            r"task\.expert\.force: 'panda\.eef' always closes with all its force; say `gripper_force` at world\.robots",
        ),
        ([GRADED, "task.expert.force=50"], r"task\.expert\.force: a finger of 'panda\.eef' presses with at most 40 N"),
    ],
)
def test_a_force_that_a_gripper_cannot_be_told_is_refused(overrides: list[str], words: str) -> None:
    with make("lift_cube", engine="mujoco", overrides=["task.expert.force=10", *overrides]) as env:
        with pytest.raises(SpecError, match=words):
            SkillPolicy(env)


@pytest.mark.parametrize(
    "task",
    ["pick_cube", "place_on_pad", "open_drawer", "screw_cap", "peg_in_hole", "handover", "tidy_bin", "unplug_charger"],
)
def test_what_grasps_takes_a_force(task: str) -> None:
    with (
        make(task, engine="mujoco", overrides=["task.expert.force=10"]) as env,
        pytest.raises(SpecError, match="force"),
    ):
        SkillPolicy(env)
