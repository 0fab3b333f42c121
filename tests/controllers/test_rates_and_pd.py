"""Velocity, effort and PD control: the law on an engine against what it integrates to, limits, snapshots, shards."""

from typing import Any

import numpy as np
import pytest

from anysim.engine.control import MODES
from anysim.errors import AnysimError, TaskError
from anysim.model.world import ControlMode
from anysim.task.env import TaskEnv
from tests.runtime import light

REAL = list(light.REAL)


def bench(action: Any, *, physics: dict[str, Any] | None = None) -> dict[str, Any]:
    """The two-link arm alone, in the plane that gravity does not pull along."""
    return {
        "physics": physics or {"dt": 0.002, "control_dt": 0.02},
        "world": {
            "name": "bench",
            "robots": {"arm": {"robot": "two_link", "position": [0, 0, 0.5], "actions": {"arm": action}}},
        },
        "task": {"horizon": 500, "observations": {"policy": ["joint_pos", "joint_vel"]}, "events": {}},
    }


def made(engine: str, n: int, action: Any, shards: int = 1) -> TaskEnv:
    return light.make(engine, n, bench(action), shards=shards)


@pytest.mark.parametrize("engine", REAL)
def test_velocities_are_reached_and_kept(engine: str) -> None:
    with made(engine, 2, "joint_velocity") as env:
        assert (env.action_spaces["arm.arm"].high == 6.0).all()
        env.reset(seed=0)
        wanted = np.array([[1.0, -0.5], [-2.0, 0.0]])
        for _ in range(60):
            env.step(wanted)
        state = env.engine.get_state()
        # links that turn pull at each other (Coriolis) with about m l^2 qd^2 = 0.03 N m, a hundredth of kd = 4 each
        assert np.abs(state.joint_vel - wanted).max() < 0.02
        assert (env.engine.control.mode == MODES.index(ControlMode.VELOCITY)).all()


@pytest.mark.parametrize("engine", REAL)
def test_an_effort_accelerates_by_the_mass_matrix(engine: str) -> None:
    """From rest, q(t) = M^-1 u t^2 / 2 for a short time."""
    with made(engine, 1, "joint_effort") as env:
        env.reset(seed=0)
        robot = env.actions.slices[0].controller.robot
        u = np.array([0.05, 0.02])
        acceleration = np.linalg.solve(robot.kinematics.mass_matrix(np.zeros(2)), u)
        env.step(u[None])
        state = env.engine.get_state()
        assert np.allclose(state.joint_vel[0], acceleration * 0.02, rtol=0.02)


def test_a_pd_in_mode_p_is_joint_position_around_home() -> None:
    """The same targets through both controllers give the same motion, bit for bit."""
    with made("mujoco", 1, {"controller": "pd", "params": {"action_scale": 0.5}}) as a:
        with made("mujoco", 1, "joint_position") as b:
            a.reset(seed=0)
            b.reset(seed=0)
            for step in range(20):
                action = np.array([[np.sin(0.3 * step), np.cos(0.2 * step)]])
                one, two = a.step(action), b.step(0.5 * action)
                assert np.array_equal(one.obs["policy"], two.obs["policy"])


@pytest.mark.parametrize(("control_type", "other"), [("V", "joint_velocity"), ("T", "joint_effort")])
def test_the_other_pd_types_are_velocities_and_efforts(control_type: str, other: str) -> None:
    pd = {"controller": "pd", "params": {"control_type": control_type, "action_scale": 0.5}}
    with made("mujoco", 1, pd) as a, made("mujoco", 1, other) as b:
        a.reset(seed=0)
        b.reset(seed=0)
        for step in range(10):
            action = np.array([[np.sin(0.3 * step), np.cos(0.2 * step)]])
            assert a.engine.get_state().joint_vel.any() == (step > 0)
            assert np.array_equal(a.step(action).obs["policy"], b.step(0.5 * action).obs["policy"])


@pytest.mark.parametrize("engine", REAL)
def test_each_joint_may_have_its_type(engine: str) -> None:
    params = {"control_type": {"*": "P", "elbow": "V"}, "action_scale": {"*": 0.4, "elbow": 2.0}}
    with made(engine, 1, {"controller": "pd", "params": params}) as env:
        env.reset(seed=0)
        for _ in range(40):
            env.step(np.array([[1.0, 0.5]]))
        state = env.engine.get_state()
        assert abs(state.joint_pos[0, 0] - 0.4) < 0.02
        assert abs(state.joint_vel[0, 1] - 1.0) < 0.03
        modes = env.engine.control.mode[0]
        assert [MODES[m] for m in modes] == [ControlMode.POSITION, ControlMode.VELOCITY]


@pytest.mark.parametrize("engine", REAL)
def test_torques_are_clipped_by_the_effort_limit(engine: str) -> None:
    """With kp 40 and a target a radian and more away the law asks for 40 N m and more; 20 is the limit."""
    with made(engine, 2, {"controller": "pd", "params": {"action_scale": 1.0, "clip": 8.0}}) as env:
        env.reset(seed=0)
        env.step(np.array([[8.0, 8.0], [4.0, 4.0]]))
        state = env.engine.get_state()
        assert np.allclose(state.joint_vel[0], state.joint_vel[1], rtol=1e-9), "both are at the limit"
        assert np.abs(state.joint_vel).max() > 1.0


IMPERFECT = {"noise": {"normal": {"mean": 0.0, "std": 0.05}}, "delay": {"range": [0, 3]}}
KINDS = {
    "velocity": {"controller": "joint_velocity", **IMPERFECT},
    "effort": {"controller": "joint_effort", "params": {"limit": 0.2}, **IMPERFECT},
    "mixed": {"controller": "pd", "params": {"control_type": {"*": "T", "elbow": "V"}}, **IMPERFECT},
}


@pytest.mark.parametrize(("engine", "kind"), [("null", "velocity"), *((e, k) for e in REAL for k in KINDS)])
def test_a_snapshot_goes_on_as_if_nothing_had_been(engine: str, kind: str) -> None:
    with made(engine, 3, KINDS[kind]) as env:
        rng = np.random.default_rng(4)
        actions = rng.uniform(-1, 1, (16, 3, env.action_dim))
        env.reset(seed=2)
        for row in actions[:5]:
            env.step(row)
        kept = env.snapshot()
        first = [env.step(row).obs["policy"] for row in actions[5:]]
        env.reset(mask=np.array([True, False, True]))
        env.reset_to(kept)
        assert all(np.array_equal(env.step(r).obs["policy"], f) for r, f in zip(actions[5:], first, strict=True))
        env.reset(seed=9)
        env.reset_to(kept, [2, 0, 1])  # into other rows: each goes on as the one it came from
        order = [1, 2, 0]
        for row, seen in zip(actions[5:], first, strict=True):
            assert np.array_equal(env.step(row[order]).obs["policy"], seen[order])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_shards_make_no_difference(kind: str) -> None:
    actions = np.random.default_rng(4).uniform(-1, 1, (8, 4, 2))
    seen = []
    for shards in (1, 2):
        with made("mujoco", 4, KINDS[kind], shards) as env:
            env.reset(seed=2)
            rows = [env.step(row).obs["policy"] for row in actions[:4]]
            env.reset(mask=np.array([False, True, True, False]))
            seen.append([*rows, *(env.step(row).obs["policy"] for row in actions[4:])])
    assert all(np.array_equal(a, b) for a, b in zip(*seen, strict=True))


def test_the_delay_can_be_overridden_for_an_episode() -> None:
    with made("mujoco", 2, KINDS["velocity"] | {"noise": None}) as env:
        path = "world.robots.arm.actions.arm.delay"
        env.reset(seed=0, overrides=[{path: 0}, {path: 3}])
        action = np.ones((2, 2))
        moved = [np.abs(env.step(action).obs["policy"][:, 2:]).max(axis=1) > 1e-3 for _ in range(5)]
        assert [bool(m[0]) for m in moved] == [True] * 5
        assert [bool(m[1]) for m in moved] == [False] * 3 + [True] * 2


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ({"controller": "pd", "params": {"control_type": {"elbo": "V"}}}, "matches 'elbo'; did you mean 'elbow'"),
        ({"controller": "pd", "params": {"control_type": {"elbow": "V"}}}, "nothing for the joints shoulder"),
        ({"controller": "pd", "params": {"offset": {"wrist": 1.0}}}, "offset: no joint of 'arm.arm' matches 'wrist'"),
        ({"controller": "pd", "params": {"control_type": "D"}}, "control_type"),
    ],
)
def test_what_is_wrong_with_the_parameters_is_said(action: Any, words: str) -> None:
    with pytest.raises(AnysimError, match=words):
        made("null", 1, action)


def test_pd_targets_go_back_to_actions() -> None:
    with made("null", 1, {"controller": "pd", "params": {"action_scale": 0.5, "offset": {"elbow": 0.2}}}) as env:
        controller = env.actions.slices[0].controller
        ids = np.array([0])
        targets = np.array([[0.25, -0.1]])
        assert np.allclose(controller.apply(controller.action_for(targets, ids), ids).position, targets)
    with made("null", 1, {"controller": "pd", "params": {"control_type": "T"}}) as env:
        with pytest.raises(TaskError, match="takes no joint positions"):
            env.actions.slices[0].controller.action_for(targets, ids)
