"""Ways and wrong states of the tasks with matter that flows."""

from collections.abc import Callable
from typing import cast

import numpy as np

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim_particles.family import Particles
from anysim_soft.rope import Rope
from tests.tasks.states import offset, put, seen

_BEGUN: dict[int, Array] = {}
BEADS = [f"bead_{number}" for number in range(4)]


def particles(env: TaskEnv, name: str) -> Particles:
    assert env.families is not None
    return cast(Particles, env.families.family(name))


def put_particles(env: TaskEnv, name: str, places: Array) -> None:
    """Put the particles of a family at places (N, P, 3) [m], at rest."""
    matter = particles(env, name)
    matter.x[:], matter.v[:] = places, 0.0
    env.scene.look(None)


def lie_in(env: TaskEnv, name: str, frame: str) -> None:
    """Lay the particles out in layers of ten by ten, 9 mm apart, about the middle of a frame, from 2 cm on."""
    count = particles(env, name).x.shape[1]
    number = np.arange(count)
    lattice = np.stack([number % 10 - 4.5, number // 10 % 10 - 4.5, number // 100 + 0.0], axis=-1) * 0.009
    put_particles(env, name, offset(seen(env, frame), z=0.02)[:, None, :3] + lattice)


def spill(env: TaskEnv, name: str, share: float) -> None:
    """A share of the particles lies half a metre aside."""
    places = particles(env, name).x.copy()
    places[:, : round(share * places.shape[1]), 0] += 0.5
    put_particles(env, name, places)


def poured(
    to_tray: Callable[[TaskEnv, float], None], name: str = "water", frame: str = "tray"
) -> Callable[[TaskEnv, float], None]:
    """The cup on its way to the tray; there its contents lie in it, beads side by side, or particles in layers."""

    def path(env: TaskEnv, share: float) -> None:
        to_tray(env, share)
        if share == 1.0 and env.families is not None:
            lie_in(env, name, frame)
        elif share == 1.0:
            for number, bead in enumerate(BEADS):
                put(env, bead, offset(seen(env, "tray"), x=0.03 * number - 0.045, z=0.04))

    return path


def spill_beads(env: TaskEnv) -> None:
    """Half of the beads lie 30 cm aside."""
    for bead in BEADS[:2]:
        put(env, bead, offset(seen(env, bead), x=0.3))


def cable(env: TaskEnv) -> Rope:
    assert env.families is not None
    return cast(Rope, env.families.family("cable"))


def put_cable(env: TaskEnv, places: Array) -> None:
    """Put its points at places (N, V, 3) [m], at rest."""
    cable(env).x[:], cable(env).v[:] = places, 0.0
    env.scene.look(None)
    env.scene.moment += 1


def _through(env: TaskEnv, aside: float) -> Array:
    """(N, V, 3) on the table from its start to its goal, so far [m] to the side of each post on which it is to pass."""
    shift = np.array([aside, 0.0, 0.0])
    start, goal = cable(env).x[:, 0], env.scene.goals["goal"][:, :3]
    corners = [start, seen(env, "near_post")[:, :3] + shift, seen(env, "far_post")[:, :3] - shift, goal]
    share = np.linspace(0.0, 3.0, cable(env).x.shape[1])
    knots = np.stack(corners, axis=1)
    knots[..., 2] = goal[:, None, 2]
    first = np.minimum(share.astype(int), 2)
    return knots[:, first] + (share - first)[:, None] * (knots[:, first + 1] - knots[:, first])


def routed(env: TaskEnv, share: float) -> None:
    """Each point from where it began to where it is when the cable goes around both posts, in a straight line."""
    pads = cable(env).pads
    pads.stage[:] = 0
    cable(env).memory["pad_count"][:] = 0
    if share == 0.0:
        _BEGUN[id(env)] = cable(env).x.copy()
    first = _BEGUN[id(env)]
    put_cable(env, first + share * (_through(env, 0.03) - first))


def straight(env: TaskEnv) -> None:
    """The cable passes the posts on their other sides."""
    put_cable(env, _through(env, -0.03))


def cable_off_goal(env: TaskEnv) -> None:
    """Its end is 6 cm aside."""
    places = cable(env).x.copy()
    places[:, -1, 1] += 0.06
    put_cable(env, places)


def take_cable(env: TaskEnv) -> None:
    """A hand holds one of its points."""
    it = cable(env)
    it.pads.stage[:] = 1
    it.memory["pad_count"][:] = 1
    env.scene.look(None)
    env.scene.moment += 1
