"""Ways and wrong states of the tasks with cloth."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_soft.garment import Garment
from tests.tasks.states import seen

_BEGUN: dict[int, Array] = {}


def towel(env: TaskEnv) -> Garment:
    """The one garment of a task."""
    assert env.families is not None
    found = env.families.family("shirt" if env.spec.world.name == "fold_shirt" else "towel")
    assert isinstance(found, Garment)
    return found


def put_towel(env: TaskEnv, places: Array) -> None:
    """Put its points at places (N, V, 3) [m], at rest."""
    it = towel(env)
    it.x[:], it.v[:] = places, 0.0
    env.scene.look(None)
    env.scene.moment += 1


def between(
    goal: Callable[[TaskEnv], Array], start: Callable[[TaskEnv], Array] | None = None
) -> Callable[[TaskEnv, float], None]:
    """Each point of the towel from where it is at the start, or began, to where it is in a goal, in a straight line."""

    def path(env: TaskEnv, share: float) -> None:
        if share == 0.0:
            _BEGUN[id(env)] = towel(env).x.copy() if start is None else start(env)
        first = _BEGUN[id(env)]
        put_towel(env, first + share * (goal(env) - first))

    return path


def over_rail(env: TaskEnv) -> Array:
    """Hung over the rail by its middle, half of it on each side."""
    flat, rail = towel(env).cut.points, seen(env, "rail")
    places = np.column_stack([flat[:, 0], 0.02 * np.sign(flat[:, 1]), -np.abs(flat[:, 1])])
    return rail[:, None, :3] + places + np.array([0.0, 0.0, 0.02])


def _lying(env: TaskEnv, flat: Array) -> Array:
    """In its own frame's plane, at coordinates (V, 2)."""
    frame = towel(env).frame
    places = np.broadcast_to(np.column_stack([flat, np.zeros(len(flat))]), (len(frame), len(flat), 3))
    turn = np.broadcast_to(frame[:, None, 3:], (*places.shape[:2], 4))
    return frame[:, None, :3] + P.rotate(turn, places)


def spread(env: TaskEnv) -> Array:
    """Flat."""
    return _lying(env, towel(env).cut.points)


def folded(env: TaskEnv) -> Array:
    """In half, one half on the other."""
    flat = towel(env).cut.points.copy()
    flat[:, 0] = -np.abs(flat[:, 0])
    return _lying(env, flat)


def shirt_folded(env: TaskEnv) -> Array:
    """Its sleeves in, and its hem on its shoulders."""
    flat = towel(env).cut.points.copy()
    side = np.abs(flat[:, 0])
    flat[:, 0] = np.sign(flat[:, 0]) * np.where(side > 0.11, 0.22 - side, side)
    flat[:, 1] = np.abs(flat[:, 1])
    return _lying(env, flat)


def shift(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Callable[[TaskEnv], None]:
    """All of it moved in the world's axes."""
    return lambda env: put_towel(env, towel(env).x + np.array([x, y, z]))


def crumple(share: float) -> Callable[[TaskEnv], None]:
    """Drawn together about its middle."""

    def change(env: TaskEnv) -> None:
        x = towel(env).x
        middle = x.mean(axis=1, keepdims=True)
        put_towel(env, middle + share * (x - middle))

    return change


def turn_up(env: TaskEnv) -> None:
    """A corner of it lies 12 cm aside."""
    it = towel(env)
    corner = np.argmax(it.cut.points.sum(axis=1))
    places = it.x.copy()
    places[:, corner, :2] += 0.12
    put_towel(env, places)


def lay_flat(env: TaskEnv) -> None:
    """As it was cut."""
    put_towel(env, spread(env))


def take_hold(env: TaskEnv) -> None:
    """Its pad holds a point."""
    it = towel(env)
    it.pads.stage[:] = 1
    it.memory["pad_count"][:] = 1
    env.scene.look(None)
    env.scene.moment += 1


def freely(
    goal: Callable[[TaskEnv], Array], start: Callable[[TaskEnv], Array] | None = None
) -> Callable[[TaskEnv, float], None]:
    """As `between`, and no pad holds it."""
    path = between(goal, start)

    def free(env: TaskEnv, share: float) -> None:
        towel(env).pads.stage[:] = 0
        towel(env).memory["pad_count"][:] = 0
        path(env, share)

    return free


HEAPED = crumple(0.8), take_hold
"""What a towel that lies flat must not be."""
