"""Ways of cameras that fly, for the cases of their tasks: the joints of `cam` are put where it would be."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from tests.tasks.states import seen

_JOINTS = ("x", "y", "z", "yaw", "pitch", "roll")
_START: dict[int, Array] = {}


def _at(env: TaskEnv) -> list[int]:
    return [env.engine.index.joint(f"cam.{name}") for name in _JOINTS]


def put_camera(env: TaskEnv, joints: Array, velocity: float = 0.0) -> None:
    """Put the joints (N, 6) of the camera, all with a velocity."""
    env.engine.set_joint_state(joints, np.full_like(joints, velocity), None, _at(env))
    env.scene.look(None)


def moved(**by: float) -> Callable[[TaskEnv], None]:
    """The camera elsewhere by so much of some joints."""

    def change(env: TaskEnv) -> None:
        joints = env.engine.get_state().joint_pos[:, _at(env)].copy()
        put_camera(env, joints + np.array([by.get(name, 0.0) for name in _JOINTS]))

    return change


def drifting(env: TaskEnv) -> None:
    """The camera where it is, but not at rest."""
    put_camera(env, env.engine.get_state().joint_pos[:, _at(env)].copy(), 0.2)


def _joints_of(env: TaskEnv, pose: Array) -> Array:
    base = seen(env, "cam")
    place = P.rotate_inverse(base[:, 3:], pose[:, :3] - base[:, :3])
    turn = P.to_roll_pitch_yaw(P.multiply(P.conjugate(base[:, 3:]), pose[:, 3:]))[:, ::-1]
    return np.concatenate([place, turn], axis=1)


def _view(eye: Array, target: Array, aside: float = 0.0) -> Array:
    """Level poses at eyes (n, 3) that look at targets, turned away by an angle."""
    way = target - eye
    yaw, pitch = np.arctan2(way[:, 1], way[:, 0]) + aside, np.arctan2(-way[:, 2], np.hypot(way[:, 0], way[:, 1]))
    turn = P.from_roll_pitch_yaw(np.stack([np.zeros(len(eye)), pitch, yaw], axis=1))
    return np.concatenate([eye, turn], axis=1)


def _along(env: TaskEnv, share: float, goal: Array) -> None:
    if share == 0.0:
        _START[id(env)] = env.engine.get_state().joint_pos[:, _at(env)].copy()
    first, way = _START[id(env)], _joints_of(env, goal) - _START[id(env)]
    way[:, 3] = (way[:, 3] + np.pi) % (2 * np.pi) - np.pi
    put_camera(env, first + share * way)


def to_goal(env: TaskEnv, share: float) -> None:
    """From the start to the goal."""
    _along(env, share, seen(env, "goal"))


def to_view(env: TaskEnv, share: float) -> None:
    """Around the gift and nearer to a view of it from behind, where no board is, turned away by less and less."""
    gift = seen(env, "gift")[:, :3]
    if share == 0.0:
        way = seen(env, "cam")[:, :3] - gift
        level = np.hypot(way[:, 0], way[:, 1])
        _START[id(env)] = np.stack([P.norm(way), np.arctan2(way[:, 1], way[:, 0]), np.arctan2(way[:, 2], level)])
    far, round_, up = _START[id(env)] + share * (np.array([[0.7], [0.0], [0.7]]) - _START[id(env)])
    direction = np.stack([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)], axis=1)
    put_camera(env, _joints_of(env, _view(gift + far[:, None] * direction, gift, 1.5 * (1.0 - share))))


def _anew(env: TaskEnv) -> None:
    for memory in env.scene.memories:
        memory.forget(np.arange(env.num_envs))


def around(env: TaskEnv, share: float) -> None:
    """Eight views of the vase, turned away by less and less; the last of them is the one to be judged."""
    vase = seen(env, "vase")[:, :3]
    _anew(env)
    for step in range(1, 9):
        env.scene.elapsed[:] = step
        angle = 2 * np.pi * step / 8
        eye = vase + np.array([0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.4])
        put_camera(env, _joints_of(env, _view(eye, vase, 2.5 * (1.0 - share))))
        if step < 8:
            env.mdp.judge()


def tracking(env: TaskEnv, share: float) -> None:
    """A whole episode, turned away by less and less, but for its last step, which is the one to be judged."""
    target = seen(env, "runner.roll_link")[:, :3]
    _anew(env)
    put_camera(env, _joints_of(env, _view(seen(env, "cam")[:, :3], target, 2.0 * (1.0 - share))))
    for step in range(1, 351):
        env.scene.elapsed[:] = step
        env.scene.look(None)
        if step < 350:
            env.mdp.judge()
