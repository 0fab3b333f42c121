"""The way of a vial into a device that is then started, and a start that comes too early."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from tests.tasks.states import offset, put, seen, set_opening

_begun: dict[int, Array] = {}


def start(env: TaskEnv, share: float) -> None:
    """Open the door, put the vial in, close the door, press: a quarter of the way each."""
    if share == 0.0:
        _begun[id(env)] = seen(env, "vial")
    first, last = _begun[id(env)], seen(env, "device.well")
    carried = min(max(4.0 * share - 1.0, 0.0), 1.0)
    put(env, "vial", np.concatenate([first[:, :3] + carried * (last - first)[:, :3], last[:, 3:]], axis=1))
    set_opening(env, "device.door", min(4.0 * share, 1.0) if share <= 0.5 else max(0.0, 3.0 - 4.0 * share))
    if share < 1.0:
        set_opening(env, "device.start", max(4.0 * share - 3.0, 0.0))
    else:
        _press(env, 0.0, 1.0)


def _lifted(env: TaskEnv) -> None:
    put(env, "vial", offset(seen(env, "vial"), z=0.02))


def _tilted(env: TaskEnv) -> None:
    turn = P.from_roll_pitch_yaw(np.array([[0.3, 0.0, 0.0]]))
    put(env, "vial", P.compose(seen(env, "vial"), np.concatenate([np.zeros((1, 3)), turn], axis=1)))


def _press_before_the_door_is_closed(env: TaskEnv) -> None:
    """In an episode that has just begun: let go once it is closed."""
    for memory in env.scene.memories:
        memory.forget(np.arange(env.num_envs))
    set_opening(env, "device.door", 0.5)
    _press(env, 0.0, 1.0)
    set_opening(env, "device.door", 0.0)
    _press(env, 1.0, 0.0)


def _press(env: TaskEnv, *openings: float) -> None:
    """The button where it is in one control step after the other."""
    for opening in openings:
        set_opening(env, "device.start", opening)
        env.scene.elapsed[:] += 1
        env.scene.look(None)
        env.mdp.judge()


WRONG = (_press_before_the_door_is_closed, _lifted, _tilted, lambda env: set_opening(env, "device.door", 0.1))
"""Changes of the goal's state, each of which makes it none."""
