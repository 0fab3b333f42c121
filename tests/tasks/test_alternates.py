"""Every alternate of every task builds, begins, steps and repeats itself, and some solve it on every engine."""

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.api import load, task_path
from anysim.assets.catalogue import load_robot, missing_source
from anysim.conventions import Array
from anysim.skills.runner import SkillPolicy, bind_expert
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_pick import rollout
from tests.tiers import in_turn

INHERITED = ("close_drawer", "insert_round_peg", "peg_in_hole_1mm", "peg_in_hole_2mm", "usb_insert")
"""Tasks whose alternates are those of the file that they extend."""
WHOLE = ("reach", "nav_to_pose")
"""Tasks of which the fast tier tries all alternates: between them they have nearly every robot that is one."""


def _own() -> list[str]:
    """The tasks of this repository with alternates in their file; nothing is loaded, for tests are collected often."""
    ours = (name for name in registry.names("tasks") if registry.entry("tasks", name).value.startswith("anysim_tasks."))
    return [name for name in ours if "\nalternates:" in task_path(name).read_text("utf-8")]


def _with(task: str, robot: str, engine: str, num_envs: int) -> TaskEnv:
    require_engine(engine)
    cameras = load(task, overrides=[f"robot={robot}"]).spec.world.cameras
    blind = ["record.cameras=[]", *(f"world.cameras.{name}.channels=[]" for name in cameras)]
    return anysim.make(task, engine=engine, robot=robot, num_envs=num_envs, overrides=blind)


def _installed(task: str) -> list[str]:
    """Those whose files are here; a task without any says so."""
    found = [robot for robot in load(task).spec.alternates if not missing_source(load_robot(robot))]
    return found or pytest.skip(f"the files of none of {task}'s alternates are installed")


def _two_steps(env: TaskEnv) -> list[Array]:
    env.reset(seed=11)
    generator = np.random.default_rng(5)
    low, high = env.action_bounds
    for _ in range(2):
        result = env.step(generator.uniform(low, high)[None])
    state = env.engine.get_state()
    return [state.body_pose.copy(), state.joint_vel.copy(), result.reward, *result.obs.values()]


def _runs_and_repeats_itself(task: str, robot: str) -> None:
    with _with(task, robot, "mujoco", 1) as env:
        assert env.spec.task is not None
        if env.spec.collect is not None or env.spec.task.expert is not None:
            bind_expert(env)
        assert robot in {one.robot for one in env.spec.world.robots.values()}
        first, second = _two_steps(env), _two_steps(env)
    assert all(np.isfinite(array).all() for array in first), robot
    assert all(np.array_equal(one, other) for one, other in zip(first, second, strict=True)), robot


@pytest.mark.parametrize("task", _own())
def test_an_alternate_runs_and_repeats_itself(task: str) -> None:
    alternates = _installed(task)
    for robot in alternates if task in WHOLE else alternates[:1]:
        _runs_and_repeats_itself(task, robot)


@pytest.mark.filterwarnings("ignore:the ground has a height every")  # of feet that are larger than the task's own
@pytest.mark.slow
@pytest.mark.parametrize("task", [*_own(), *INHERITED])
def test_every_alternate_runs_and_repeats_itself(task: str) -> None:
    for robot in _installed(task):
        _runs_and_repeats_itself(task, robot)


SOLVED = (
    *(("pick_cube", robot) for robot in ("ur5_gripper", "xarm7_gripper", "z1")),
    *(("stack_cube", robot) for robot in ("ur5_gripper", "xarm7_gripper", "ur10_gripper")),
    ("nut_on_peg", "xarm7_gripper"),  # whose fingers reach further than the nut is high
    ("open_drawer", "xarm7_gripper"),  # whose open hand has no room at a slant
)


@pytest.mark.parametrize(("task", "robot", "engine"), in_turn(*zip(*SOLVED, strict=True)))
def test_an_alternate_solves_the_task(task: str, robot: str, engine: str) -> None:
    with _with(task, robot, engine, 4) as env:
        assert env.spec.task is not None
        env.reset(seed=4001)
        words = rollout(env, SkillPolicy(env), env.spec.task.horizon)
    assert words.count("success") >= 3, words
