"""The checks in which it moves: it holds still, bears any action, and does the same again."""

import hashlib
from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.managers.action import ActionSlice
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType
from anysim.task.env import TaskEnv
from anysim_robots.qualify.result import Check
from anysim_robots.qualify.stage import NAME

HOLD = 0.05
"""[rad], or [m]: how far a driven joint may leave the home position, and a floating base its attitude and height."""
UNBOUNDED = np.pi
"""Bound of an action that has none [rad or its own unit]."""
SEED = 0


def rest_action(env: TaskEnv) -> tuple[Array, list[str]]:
    """The action (1, A) that asks the robot to stay as it is after a reset, and the channels where zeros stand for it.

    A controller that takes joint positions is asked for those at home; of the others zero means to do nothing.
    """
    action = np.zeros((1, env.action_dim))
    zeros: list[str] = []
    for s in _slices(env):
        channel = s.controller.channel
        home = np.array(
            [[env.engine.world.joints[env.engine.world.actuators[a].joint].initial for a in channel.actuators]]
        )
        try:
            action[:, s.start : s.stop] = s.controller.action_for(home, np.array([0]))
        except TaskError:
            zeros.append(s.channel)
            action[:, s.start : s.stop] = np.clip(0.0, s.controller.low, s.controller.high)
    return action, zeros


def _slices(env: TaskEnv) -> list[ActionSlice]:
    return list(env.actions.slices)


def hold_check(env: TaskEnv, seconds: float) -> Check:
    """Nothing is asked for; how far do driven joints and the attitude of a floating base get from where they began?"""
    env.reset(seed=SEED)
    engine, world = env.engine, env.engine.world
    action, zeros = rest_action(env)
    driven = sorted({a.joint for a in world.actuators})
    kinds = [world.joints[j].type for j in driven]
    root = engine.index.entity(NAME).root
    floating = world.bodies[root].kind is BodyKind.FREE
    start, base = engine.get_state().joint_pos[0, driven].copy(), engine.get_state().body_pose[0, root].copy()
    worst, where, when, unit = 0.0, "", 0.0, "rad"
    steps = _steps(env, seconds)
    for step in range(steps):
        env.step(action)
        state = engine.get_state()
        if state.fault[0]:
            return Check("hold", False, words=f"a fault after {(step + 1) * world.physics.control_dt:g} s")
        far = [(float(off), j) for off, j in zip(np.abs(state.joint_pos[0, driven] - start), driven, strict=True)]
        found = [(off, world.joints[j].name, _unit(kind)) for (off, j), kind in zip(far, kinds, strict=True)]
        if floating:
            pose = state.body_pose[0, root]
            found.append((float(P.angle_between(pose[3:], base[3:])), "the base tilts", "rad"))
            found.append((abs(float(pose[2] - base[2])), "the base rises or sinks", "m"))
        farthest = max(found, default=(0.0, "", "rad"))
        if farthest[0] > worst:
            (worst, where, unit), when = farthest, (step + 1) * world.physics.control_dt
    drop = base[2] - engine.get_state().body_pose[0, root, 2]
    told = [f"for {seconds:g} s"]
    if worst > 0:
        told.append(f"farthest: {where.removeprefix(f'{NAME}.')} at {when:.2g} s")
    if floating:
        told.append(f"base {1000 * drop:.1f} mm lower")
    if zeros:
        told.append(f"zeros for {', '.join(zeros)}")
    return Check("hold", bool(worst <= HOLD), worst, unit, HOLD, ", ".join(told))


def _unit(kind: JointType) -> str:
    return "m" if kind is JointType.PRISMATIC else "rad"


def random_checks(
    env: TaskEnv, seconds: float, replay: float, tell: Callable[[str], object] = lambda words: None
) -> tuple[Check, Check]:
    """Random actions, then the first of them again from a reset: no fault, and the same bytes."""
    steps, again = _steps(env, seconds), _steps(env, min(replay, seconds))
    actions = _actions(env, steps)
    env.reset(seed=SEED)
    dt = env.engine.world.physics.control_dt
    digests: list[bytes] = []
    fastest = 0.0
    survived = Check("random", True)
    for step in range(steps):
        env.step(actions[step])
        state = env.engine.get_state()
        if state.fault[0]:
            survived = Check("random", False, words=f"a fault after {(step + 1) * dt:g} s of random actions")
            break
        fastest = max(fastest, float(np.abs(state.joint_vel[0]).max(initial=0.0)))
        if step < again:
            digests.append(_digest(env))
    if survived.passed:
        survived = Check("random", True, fastest, "rad/s at most", None, f"{seconds:g} s of random actions, no fault")
    tell("replay")
    env.reset(seed=SEED)
    for step, wanted in enumerate(digests):
        env.step(actions[step])
        if _digest(env) != wanted:
            told = f"another state after {step + 1} control steps ({(step + 1) * dt:g} s) of the same actions"
            return survived, Check("replay", False, float(step + 1), "equal steps", None, told)
    told = f"{len(digests)} control steps gave the same bytes"
    return survived, Check("replay", bool(digests) or None, float(len(digests)), "equal steps", None, told)


def _actions(env: TaskEnv, steps: int) -> Array:
    """(T, 1, A) uniform within the bounds."""
    low, high = env.action_bounds
    low, high = np.where(np.isfinite(low), low, -UNBOUNDED), np.where(np.isfinite(high), high, UNBOUNDED)
    return low + (high - low) * np.random.default_rng(SEED).random((steps, 1, len(low)))


def _steps(env: TaskEnv, seconds: float) -> int:
    return max(1, round(seconds / env.engine.world.physics.control_dt))


def _digest(env: TaskEnv) -> bytes:
    state = env.engine.get_state()
    total = hashlib.sha256()
    for rows in (state.body_pose, state.body_twist, state.joint_pos, state.joint_vel):
        total.update(np.ascontiguousarray(rows).tobytes())
    return total.digest()
