"""Drives whose damping a library's solver takes, as a constraint that it meets together with contacts and limits.

The law is u = kp (q* - q) + kd (qd* - qd) + ff, clipped, with its damping taken implicitly; a joint's spring adds to
it. Each substep kp (q* - q) + kd qd* + ff goes into the library as a force, and the damping as the library's own drive.
So a free joint moves as MuJoCo's `implicitfast` moves it, and a blocked one exerts all of its command; a law computed
outside from mass matrix and bias alone would lose most of it. Where the law exceeds the effort limit at the present
speed, the library clips it instead, at the speed that it ends with: the drive gets the law as damping towards a
velocity, and the limit. A clipped force given from outside would set stiff joints swinging. With
`actuation: explicit_pd` the force is the law of the state at the beginning of the substep.

Kernels that call each other share one file because numba's cache notices a change of a kernel's own file only. None is
compiled with fast-math, and none adds in an order that depends on the number of envs: an env's bits are its own.
"""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import Control
from anysim.errors import EngineError
from anysim.math.compiled import compiled
from anysim.model.world import Actuation, World
from anysim_mechanics.drive_gains import DriveGains
from anysim_mechanics.journal import Journal, Op
from anysim_mechanics.tendons import Tendons

PUSH, FEED, STIFFNESS, DAMPING, BOUND, ASKED, PASSIVE, GIVEN, SPRING, RELAXED = range(10)
"""Rows of a law (N, 10, J); `ASKED` bounds what the targets ask for, `GIVEN` is what the last substep was given, and
`SPRING` and `RELAXED` are the stiffness and the rest of a joint's own spring."""

_TERMS = np.array([STIFFNESS, DAMPING, PUSH, FEED, ASKED, BOUND])
"""Rows that follow from commands and gains, in the order of `DriveGains.write`."""

LAW, EXPLICIT, NATIVE = range(3)
"""What computes the drives: the library their damping, the law alone, or the library all of it."""

TARGET, SPEED, GAINS, FORCE = 1, 2, 4, 8
"""What is to be told of a joint."""


class DampedDrives:
    """The drives of all envs; how a library is told of them is a subclass's to say.

    Attributes:
        gains, passive: what may be changed: the drives' gains, and the joints' own damping (N, J).
        control: the present commands, None before any. law: (N, 10, J) that of each joint.
        springs: (2, J) stiffness and rest of each joint's own spring. tendons: what the World's tendons pull with.
        told: (N, ...) what the library has been told of the drives of each env; not a number where nothing yet.
    """

    def __init__(self, world: World, num_envs: int, told: Array) -> None:
        self.told = told
        joints, self.gains = world.joints, DriveGains(world, num_envs)
        driven = self.gains.joint.tolist()
        for joint in driven:
            if driven.count(joint) > 1:
                raise EngineError(f"joint '{joints[joint].name}' has two drives; this engine takes one per joint")
        self.passive = np.tile(np.array([j.damping for j in joints], dtype=float), (num_envs, 1))
        self.tendons = Tendons(world)
        self.springs = np.array([[j.stiffness for j in joints], [j.spring_rest for j in joints]])
        self.control: Control | None = None
        self._commanded, self._tuned = 0, 0  # how often commands, and gains, were written
        self.kind = {Actuation.EXPLICIT_PD: EXPLICIT, Actuation.NATIVE: NATIVE}.get(world.physics.actuation, LAW)
        self.news = np.zeros((len(joints), 2), dtype=int)
        self._last: list[tuple[Array, Callable[[], tuple[Array, Array]]] | None] = [None] * num_envs
        """By env the law of its last substep, and what reads the motion that it left."""
        self._update()

    def apply(self, control: Control) -> None:
        """Take over the commands of all envs."""
        position, velocity, effort, mode = (part.copy() for part in control)
        self.control = Control(position, velocity, effort, mode.astype(np.int8, copy=False))
        self._commanded += 1
        self._update()

    def refresh(self) -> None:
        """Take over gains, limits or passive damping that were written."""
        self._tuned += 1
        self._update()

    def _update(self) -> None:
        """Make the law: a new array, since efforts of the last substep may yet be asked for."""
        self.law = np.zeros((len(self.passive), 10, self.passive.shape[1]))
        self.law[:, BOUND : ASKED + 1], self.law[:, PASSIVE] = np.inf, self.passive + self.tendons.own_damping
        self.law[:, SPRING : RELAXED + 1] = self.springs
        if self.control is not None:
            self.gains.write(self.control, self.law, _TERMS)

    # ------------------------------------------------------------------ other scenes

    def forget(self, env: int) -> None:
        """The env's scene is new: the library has been told nothing."""
        self.told[env] = np.nan

    def adopt(self, env: int, other: "DampedDrives") -> None:
        """The env's scene is the one that `other` drove, as its first env."""
        self.told[env] = other.told[0]

    def set_gains(self, env: int, values: Array) -> None:
        """Write an env's kp, kd, limits (A,) and passive damping (J,), one after the other."""
        a = len(self.gains.joint)
        self.gains.values[:, env] = values[: 3 * a].reshape(3, a)
        self.passive[env] = values[3 * a :]
        self.refresh()

    def record(self, env: int, journal: Journal) -> None:
        """Have a journal know what moves the env from here on."""
        if journal.commanded != self._commanded:
            journal.commanded, control = self._commanded, self.control
            journal.renew(Op.CONTROL, b"" if control is None else np.concatenate([c[env] for c in control]).tobytes())
        if journal.tuned != self._tuned:
            journal.tuned = self._tuned
            journal.renew(Op.GAINS, self.gains.values[:, env].tobytes() + self.passive[env].tobytes())

    # ------------------------------------------------------------------ what was exerted

    def note(self, env: int, motion: Callable[[], tuple[Array, Array]]) -> None:
        """After the last substep: `motion` reads the positions and velocities (J,) that it left, if it is asked for."""
        self._last[env] = self.law, motion

    def exerted(self, env: int, effort: Array) -> None:
        """Write what the env's drives exerted in the last substep into its row of (N, J)."""
        if (last := self._last[env]) is not None:
            exerted(last[0], env, *last[1](), self.kind, effort)


@compiled
def _clip(value: float, bound: float) -> float:
    """`value` within +-bound; what is not a number stays so."""
    if value > bound:
        return bound
    return -bound if value < -bound else value


@compiled
def changes(wanted: Array, known: Array, env: int, there: Array, news: Array) -> int:
    """List what the library does not know yet of an env's joints in `news` (J, 2), as joint and what; returns how many.

    `wanted` and `known` are (N, J, 6): targets of position and velocity, stiffness, damping, limit, and a force.
    """
    count = 0
    for j in range(wanted.shape[1]):
        what = 0
        if wanted[env, j, 0] != known[env, j, 0]:
            what |= TARGET
        if wanted[env, j, 1] != known[env, j, 1]:
            what |= SPEED
        if (
            wanted[env, j, 2] != known[env, j, 2]
            or wanted[env, j, 3] != known[env, j, 3]
            or wanted[env, j, 4] != known[env, j, 4]
        ):
            what |= GAINS
        if wanted[env, j, 5] != known[env, j, 5]:
            what |= FORCE
        for k in range(6):
            known[env, j, k] = wanted[env, j, k]
        if what and there[j]:
            news[count, 0], news[count, 1] = j, what
            count += 1
    return count


@compiled
def substep(
    law: Array,
    env: int,
    joints: Array,
    position: Array,
    velocity: Array,
    kind: int,
    unbounded: float,
    told: Array,
    force: Array,
    news: Array,
    count: int,
) -> int:
    """The law of an articulation's joints at their present state, and what the library does not know of them yet.

    Args:
        law: (N, 10, J); its row GIVEN is written.
        joints: (n,) the World's of each degree of freedom.
        position: (n,), velocity: (n,) float32.
        kind: EXPLICIT, where damping is in the force, or LAW.
        told: (N, 3, J) damping, force limit and velocity target of the library's drives, written.
        force: (n,) float32, written.
        news: (J, 2) joint and what is to be told, written from row `count` on; returns the number of the next.
    """
    for k in range(joints.shape[0]):
        j = joints[k]
        speed = float(velocity[k])
        push = _clip(law[env, PUSH, j] - law[env, STIFFNESS, j] * float(position[k]), law[env, ASKED, j])
        push += law[env, FEED, j]
        damping, bound, passive = law[env, DAMPING, j], law[env, BOUND, j], law[env, PASSIVE, j]
        whole = push - damping * speed
        slowing, limit, target = passive, unbounded, 0.0
        if kind == EXPLICIT:
            given = exerted = _clip(whole, bound)
        else:
            given = exerted = push
            slowing += damping
            if abs(whole) > bound:
                exerted = _clip(push, bound)
                if damping > 0.0:
                    # the library clips it at the speed that it ends with
                    exerted = 0.0
                    limit = max(bound - (passive if whole > 0.0 else -passive) * speed, 0.0)
                    target = push / slowing
        law[env, GIVEN, j] = given
        force[k] = exerted + law[env, SPRING, j] * (law[env, RELAXED, j] - float(position[k]))
        what = 0
        if slowing != told[env, 0, j] or limit != told[env, 1, j]:
            what |= GAINS
        if target != told[env, 2, j]:
            what |= SPEED
        if what:
            told[env, 0, j], told[env, 1, j], told[env, 2, j] = slowing, limit, target
            news[count, 0], news[count, 1] = j, what
            count += 1
    return count


@compiled
def exerted(law: Array, env: int, position: Array, velocity: Array, kind: int, effort: Array) -> None:
    """Write an env's row of `effort` (N, J): what its drives exerted in the substep that left this motion (J,).

    Damping acted on the speed at its end. `kind` is that of the drives.
    """
    for j in range(law.shape[2]):
        value = law[env, GIVEN, j]
        if kind == NATIVE:
            value = law[env, PUSH, j] + law[env, FEED, j] - law[env, STIFFNESS, j] * position[j]
        if kind != EXPLICIT:
            value -= law[env, DAMPING, j] * velocity[j]
        effort[env, j] = _clip(value, law[env, BOUND, j])


@compiled
def _target(
    position: float, velocity: float, feed: float, stiffness: float, damping: float, whole: float
) -> tuple[float, float]:
    """Targets of a native drive: feed-forward moves one of them, a joint's own damping that of the velocity."""
    stiff = stiffness > 0.0
    push = damping * velocity + (0.0 if stiff else feed)
    return position + (feed / stiffness if stiff else 0.0), push / whole if whole > 0.0 else 0.0


@compiled
def native_targets(
    position: Array,
    velocity: Array,
    effort: Array,
    stiffness: Array,
    damping: Array,
    whole: Array,
    place: Array,
    speed: Array,
) -> None:
    """What a library's own drives are told for commands; all are (N, A).

    Args:
        position, velocity, effort: the commands.
        stiffness, damping: of the drives in their modes.
        whole: damping and the joints' own. place, speed: the drives' targets, written.
    """
    for env in range(position.shape[0]):
        for a in range(position.shape[1]):
            told = position[env, a], velocity[env, a], effort[env, a]
            place[env, a], speed[env, a] = _target(*told, stiffness[env, a], damping[env, a], whole[env, a])


@compiled
def native_terms(position: Array, velocity: Array, joint: Array, law: Array, unbounded: float, wanted: Array) -> None:
    """Write terms (N, J, 6) of a library's own drives, as in `changes`, for commands (N, A) and the law (N, 10, J)."""
    for e in range(wanted.shape[0]):
        for j in range(wanted.shape[1]):
            wanted[e, j, :] = 0.0
            wanted[e, j, 3], wanted[e, j, 4] = law[e, PASSIVE, j], unbounded
        for a in range(position.shape[1]):
            j = joint[a]
            stiffness, damping, feed = law[e, STIFFNESS, j], law[e, DAMPING, j], law[e, FEED, j]
            whole, driven = damping + law[e, PASSIVE, j], stiffness > 0.0 or damping > 0.0
            fed = feed if driven else 0.0
            place, wanted[e, j, 1] = _target(position[e, a], velocity[e, a], fed, stiffness, damping, whole)
            wanted[e, j, 0] = place if stiffness > 0.0 else 0.0
            wanted[e, j, 2], wanted[e, j, 3] = stiffness, whole
            # a drive in effort mode exerts a force, and its joint's damping has no limit
            if driven:
                wanted[e, j, 4] = min(law[e, BOUND, j], unbounded)
            else:
                wanted[e, j, 5] = _clip(feed, law[e, BOUND, j])
