"""The tasks: their worlds on each engine, and what counts as success, failure and progress in them."""

from importlib.metadata import entry_points

import numpy as np
import pytest

import anysim
from anysim.api import load, task_path
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_evaluation.driver import drive, episode_seeds
from anysim_evaluation.policy import make_policy
from tests.tasks.cases import CASES
from tests.tasks.states import blind, failed, judged, put, rewarded, seen, set_opening
from tests.tiers import in_turn, others_in_turn

NEAR = 1e-5
"""[m, rad] engines keep poses in single precision."""
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
VARIANTS = {"peg_in_hole_2mm", "insert_round_peg", "nut_on_peg", "usb_insert", "unplug_charger", "go1_velocity_rough"}
VARIANTS |= {"scoop_sand", "route_cable", "spread_towel", "fold_towel", "flatten_towel", "fling_towel", "fold_shirt"}
"""Those that differ from another task in sizes alone, or share its world, its matter or its way."""
SETTLING = "robot.hand_", "partner.hand_", "hand.", "dog.", "walker."
"""Joints of a hand, which an action of zero sends to the middle of their ranges, and of legs that take up a weight."""
SOFT = ("go1_velocity", "go1_velocity_rough", "g1_velocity", "get_up")
"""Tasks whose drives hold no weight at once, or whose robot begins above the ground."""
SHIPPED = {"stand_still": 8, "go1_velocity": 8, "go1_velocity_rough": 4, "g1_velocity": 4}
"""Those that come with a trained policy, and how many of eight episodes it has to solve."""
SLOW = ("go1_velocity_rough", "g1_velocity")
"""Of these, what takes longer to try."""
MATTER = ("pour_water", "scoop_sand", "route_cable", "hang_towel")
MATTER += ("spread_towel", "fold_towel", "flatten_towel", "fling_towel", "fold_shirt")
"""Tasks whose matter pushes at things, which the engine without physics refuses: the model of these is MuJoCo.

Their envs cost a hundred times as much as others: a few do."""
DEEPEST, REPLAYED = 2e-3, 25
"""How far things may be inside of one another at a reset [m], and steps that are replayed."""
TASKS = [pytest.param(task, marks=[pytest.mark.slow] if task in VARIANTS else []) for task in CASES]


def model_of(task: str) -> str:
    """The engine that an unmoved world of a task is compared with."""
    return "mujoco" if task in MATTER else "null"


def placed(env: TaskEnv) -> dict[str, np.ndarray]:
    """Where everything is that has a place of its own."""
    names = [*env.engine.world.entities]
    return {entity.name: seen(env, entity.name) for entity in names}


def test_every_task_of_the_catalogue_is_here() -> None:
    packages = {entry.value: entry.name for entry in entry_points(group="anysim.tasks")}
    ours = {name for value, name in packages.items() if value.startswith("anysim_tasks.")}
    assert ours == {*CASES, "pick_cube"}


@pytest.mark.parametrize(
    ("task", "engine"),
    [*(pytest.param(*one.values, "mujoco", marks=one.marks) for one in TASKS), *others_in_turn(CASES)],
)
def test_a_task_is_the_same_on_each_engine_knows_its_goal_and_rewards_the_way(task: str, engine: str) -> None:
    """One engine a case: its layout is the kinematic one's, its goal is one and what is beside it is not.

    With MuJoCo the kinematic one then goes the way to the goal, on which its reward grows.
    """
    require_engine(engine)
    case = CASES[task]
    unheld = [f"task.rewards.{name}.weight=0.0" for name in case.unheld]
    with blind(task, model_of(task), 2, *unheld) as model:
        model.reset(seed=5)
        nominal = placed(model)
        if engine == "mujoco":
            rewards = []
            for share in np.linspace(0.0, 1.0, 13):
                case.path(model, float(share))
                rewards.append(rewarded(model))
            assert (np.diff(rewards, axis=0) > -1e-6).all(), np.round(rewards, 3)
            assert (rewards[-1] > rewards[0] + 0.3).all()
    with blind(task, engine) as env:
        env.reset(seed=5)
        for name, pose in placed(env).items():
            assert np.allclose(pose, nominal[name], atol=NEAR), name
        assert (judged(env) == case.lasting).all()
        assert not failed(env).any()
        case.path(env, 0.0)
        case.path(env, 1.0)
        assert judged(env).all()
        for number, change in enumerate(case.wrong):
            case.path(env, 1.0)
            change(env)
            assert not judged(env).any(), number
        assert not case.lasting or failed(env).all()


@pytest.mark.parametrize("task", TASKS)
def test_nothing_random_solves_a_task_or_falls_at_once(task: str) -> None:
    """Things stay where they are put, no arm begins inside of one, and random actions do not reach a goal."""
    require_engine("mujoco")
    count = 4 if task in MATTER else 16
    with blind(task, "mujoco", count) as env:
        env.reset(seed=9)
        before, joints = placed(env), env.engine.get_state().joint_pos.copy()
        held = [number for number, joint in enumerate(env.engine.world.joints) if not joint.name.startswith(SETTLING)]
        stands, everyone = CASES[task].lasting, np.arange(count)
        env.step(SkillPolicy(env).act(everyone) if stands else np.zeros((count, env.action_dim)))
        # Feet that are put above the ground, each as its joints are, come down first; soft legs give in as they take a
        # weight up: what falls freely for 20 ms falls by 2.4 mm.
        fall = 3e-3 if stands or task in SOFT else 2e-3
        for name, pose in placed(env).items():
            assert np.allclose(pose[:, :3], before[name][:, :3], atol=fall), name
        assert np.allclose(env.engine.get_state().joint_pos[:, held], joints[:, held], atol=2e-3)
        random = np.random.default_rng(0)
        for _ in range(30):
            env.step(random.uniform(-1, 1, (count, env.action_dim)), env.running)
        assert "success" not in env.status.tolist()


@pytest.mark.parametrize(("task", "engine"), in_turn([*CASES, "pick_cube"]))
def test_a_task_begins_apart_bears_random_actions_and_replays_exactly(task: str, engine: str) -> None:
    """Nothing is inside of anything at a reset, no action is a fault, and the same ones do the same, bit by bit."""
    require_engine(engine)
    with blind(task, engine) as env:
        env.reset(seed=11)
        env.engine.step(1)  # two engines look for contacts in a step alone, at its beginning
        assert (env.engine.contacts().depth < DEEPEST).all()
        actions = np.random.default_rng(0).uniform(*env.action_bounds, (REPLAYED, 2, env.action_dim))
        first, again = _replayed(env, actions), _replayed(env, actions)
        assert not env.info["fault"].any()
        assert first == again


def _replayed(env: TaskEnv, actions: np.ndarray) -> list[bytes]:
    """All that is seen of each step after a reset; envs whose episode has ended rest."""
    env.reset(seed=11)
    told: list[bytes] = []
    for action in actions:
        if env.running.any():
            result = env.step(action, env.running)
            state = env.engine.get_state()
            seen_now = [*result.obs.values(), result.reward, state.body_pose, state.joint_pos, state.joint_vel]
            told.append(b"".join(array.tobytes() for array in seen_now))
    return told


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "task", [pytest.param(task, marks=pytest.mark.slow) if task in SLOW else task for task in SHIPPED]
)
def test_the_policy_that_a_task_ships_solves_it(task: str, engine: str) -> None:
    require_engine(engine)
    with blind(task, engine, 8) as env:
        told = list(drive(env, make_policy(env, "shipped"), episode_seeds("validation", 0, 8)))
    assert [episode.status for episode in told].count("success") >= SHIPPED[task]


@pytest.mark.parametrize("engine", ENGINES)
def test_the_shipped_walk_is_a_controller_with_the_action_of_the_trot(engine: str) -> None:
    require_engine(engine)
    walk = "package:anysim_tasks/legged/go1_velocity/walk.yaml"
    dog = {
        "robot": "unitree_go1",
        "dynamics": {"kp_scale": 0.26667, "kd_scale": 0.33333},
        "actions": {"base": {"controller": "policy", "params": {"options": {"file": walk}}}},
    }
    run = {
        "engine": engine,
        "physics": {"dt": 0.004, "control_dt": 0.02, "actuation": "explicit_pd"},
        "world": {"terrain": {"kind": "plane", "friction": 0.2}, "robots": {"dog": dog}},
        "task": {"observations": {"policy": [{"term": "base_lin_vel", "robot": "dog"}]}},
    }
    with anysim.make(run) as env:
        env.reset(seed=0)
        speeds = [env.step(np.array([[0.5, 0.0, 0.0]])).obs["policy"][0, :2] for _ in range(150)]
    assert np.allclose(np.mean(speeds[50:], axis=0), [0.5, 0.0], atol=0.06)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_button_comes_back(engine: str) -> None:
    require_engine(engine)
    with blind("press_button", engine) as env:
        env.reset(seed=0)
        set_opening(env, "button.cap", 0.5)
        opening = []
        for _ in range(20):
            env.step(np.zeros((2, env.action_dim)))
            opening.append(env.engine.get_state().joint_pos[:, env.engine.index.joint("button.cap")])
    assert (opening[-1] < 1e-4).all(), opening


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("task", ["peg_in_hole", "peg_in_hole_2mm", "peg_in_hole_1mm"])
def test_a_peg_falls_to_the_bottom_of_its_hole(task: str, engine: str) -> None:
    """The hole is open on each engine: no convex hull fills it."""
    require_engine(engine)
    with blind(task, engine) as env:
        env.reset(seed=3)
        pose = seen(env, "block")
        pose[:, 2] = seen(env, "block.mouth")[:, 2] + 0.05 - 0.02
        put(env, "peg", pose)
        for _ in range(50):
            env.step(np.zeros((2, env.action_dim)), env.running)
        depth = seen(env, "peg.tip")[:, 2] - seen(env, "block.hole")[:, 2]
        assert env.status.tolist() == ["success"] * 2, depth


@pytest.mark.parametrize("task", [*CASES, "pick_cube"])
def test_a_task_has_a_page_with_its_difficulty_its_levels_and_a_picture(task: str) -> None:
    folder = task_path(task).parent
    levels = list(load(task).spec.levels)
    assert levels == [] or levels[:3] == ["L0", "L1", "L2"]
    assert (task in SHIPPED) == (folder / "policy.onnx").exists()
    page = (folder / "README.md").read_text()
    assert ("| levels | " in page) == bool(levels)
    assert any(f"\n| difficulty | {said} |\n" in page for said in ("easy", "medium", "hard"))
    assert "![" in page
    assert (folder / "picture.jpg").stat().st_size < 100_000
