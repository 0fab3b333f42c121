"""Trials of grasps in physics: a gripper that is fixed, the thing free in it, and loads on the thing.

The fingers close without gravity; then loads act on the thing from each direction, one after the other, each from the
state just after closing. The easy test admits a grasp: the thing's own weight, both ways along each axis of the hand.
The hard test ranks: a load that grows to `HARDEST` times that, one way along each axis, as friction gives way alike in
both. What is moved by its joint is pulled instead, both ways along its path, with a line of force through the
affordance, as its guides would let it. The long test keeps the easy one's loads for half a second, one way along each
axis: a thin bar that is held far from the thing's weight turns in the fingers slowly.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.engine.state import Snapshot
from anysim.math import pose as P
from anysim.model.world import Actuator, BodyKind, ControlMode, EntityKind, Physics, World
from anysim_banks.gripper import SPARE, Gripper
from anysim_banks.sampling import Candidates
from anysim_banks.subject import Subject

HARDEST = 12.0
"""The largest load of the hard test, in loads of the easy one."""
PULL = 10.0
"""[N] the load of the easy test on what is moved by its joint: a stiff drawer."""
LONG = 25
"""Control steps of the long test: 0.5 s."""
SHIFT, TURN = 0.003, 0.1
"""[m], [rad] by which the thing may move in the fingers under a load: what slips does not stop there."""
CREEP = 0.0012, 0.01
"""[m], [rad] of the long test on a bank's first engine: what slips a little there slips away on others."""
DISPLACED = 0.01, 0.2
"""[m], [rad] by which it may move while they close."""
MISSED = 0.6
"""Fingers that come closer than this share of the expected width have closed on something else."""
ENVS = {"mujoco": 64}
"""How many grasps are tried at once; of engines with a scene for each env fewer."""

_GRAVITY = 9.81
_DT, SUBSTEPS = 0.002, 10
_CLOSING = 6  # control steps; the fingers start 2 mm away
_HOLD, _RAMP = 3, 8  # control steps of the easy and of the hard test: in the first what is let go falls 18 mm
_KP, _KD = 1000.0, 300.0


class Verdicts(NamedTuple):
    """Of each grasp: the load that it held in the end, in loads of the easy test, 0 where it failed that.

    `missed` (n,) bool are those whose fingers closed on nothing, or on something else.
    """

    margin: Array
    missed: Array


class ClosedGrip(NamedTuple):
    """Things in closed fingers: poses (n, 7), which have got away, which were missed, and where loads begin."""

    held: Array
    gone: Array
    missed: Array
    start: Snapshot


class HeldTrial(ABC):
    """An engine with a hand that is fixed and a subject in each env. Close it, or use it in `with`."""

    def __init__(self, world: World, subject: Subject, engine: str, envs: int | None = None) -> None:
        self.world, self._subject = world, subject
        self._n = envs or ENVS.get(engine, 16)
        self._sim: SimEngine = create_simulation(engine).create_world(self.world, self._n)
        self._thing = next(i for i, b in enumerate(self.world.bodies) if b.name == "thing")
        self._loads = _loads(subject)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the engine."""
        self._sim.destroy()

    def run(self, candidates: Candidates, *, hard: bool = True) -> Verdicts:
        """Try grasps; their order does not matter to their verdicts. Without the hard test margins are 0 or 1."""
        n, margin, missed = 0, np.zeros(len(candidates.width)), np.zeros(len(candidates.width), dtype=bool)
        for part in self._parts(candidates):
            rows = np.arange(n, n + len(part.width))
            margin[rows], missed[rows] = self._try(part, hard)
            n += len(rows)
        return Verdicts(margin, missed)

    def lasting(self, candidates: Candidates, limits: tuple[float, float] = (SHIFT, TURN)) -> Array:
        """(n,) bool: the grasps in which the thing moves less than `limits` [m], [rad] in the long test."""
        parts = [self._lasting(part, limits) for part in self._parts(candidates)]
        return np.concatenate([np.zeros(0, dtype=bool), *parts])

    def _parts(self, candidates: Candidates) -> list[Candidates]:
        n = len(candidates.width)
        return [candidates.take(np.arange(i, min(i + self._n, n))) for i in range(0, n, self._n)]

    def _lasting(self, part: Candidates, limits: tuple[float, float]) -> Array:
        closed = self.closed(part)
        held = ~closed.gone
        for load in self._loads[::2]:
            alive = np.flatnonzero(held)
            if len(alive) == 0:
                break
            self._sim.restore(closed.start.rows(alive), alive)
            held[alive] = self._loaded(alive, closed.held[alive], load, LONG, 0, limits) > 0
        return held

    def _try(self, part: Candidates, hard: bool) -> tuple[Array, Array]:
        closed = self.closed(part)
        margin = np.where(closed.gone, 0.0, HARDEST if hard else 1.0)
        for number, load in enumerate(self._loads):
            alive = np.flatnonzero(margin >= 1.0)
            if len(alive) == 0:
                break
            self._sim.restore(closed.start.rows(alive), alive)
            ramp = _RAMP if hard and number % 2 == 0 else 0
            margin[alive] = np.minimum(margin[alive], self._loaded(alive, closed.held[alive], load, _HOLD, ramp))
        return margin, closed.missed

    @abstractmethod
    def closed(self, part: Candidates) -> ClosedGrip:
        """Close the fingers on things at these grasps, one in each env."""

    def _loaded(
        self, ids: Array, held: Array, load: Array, hold: int, ramp: int, limits: tuple[float, float] = (SHIFT, TURN)
    ) -> Array:
        """(n,) the largest multiple of a load that these envs held, 0 below one; without a ramp it is no bound."""
        wrench = _in_world(load, held, self._subject)
        reached, left = np.zeros(len(ids)), np.arange(len(ids))
        for step in range(hold + ramp):
            times = 1.0 + (HARDEST - 1.0) * max(0, step + 1 - hold) / _RAMP
            sim, rows = self._sim, ids[left]
            sim.apply_wrench(times * wrench[left, None], [self._thing], rows)
            sim.step(SUBSTEPS, rows)
            now = sim.get_state().body_pose[rows, self._thing]
            shift = P.norm(now[:, :3] - held[left, :3])
            turn = P.angle_between(now[:, 3:], held[left, 3:])
            left = left[(shift <= limits[0]) & (turn <= limits[1])]  # a state that is no number is not held either
            if step + 1 >= hold:
                reached[left] = times if ramp else HARDEST
            if len(left) == 0:
                break
        return reached


class Trial(HeldTrial):
    """Trials with a gripper of two fingers."""

    def __init__(self, gripper: Gripper, subject: Subject, engine: str, envs: int | None = None) -> None:
        self._gripper = gripper
        super().__init__(_world(gripper, subject), subject, engine, envs)

    def closed(self, part: Candidates) -> ClosedGrip:
        sim, ids, width = self._sim, np.arange(len(part.width)), part.width
        sim.reset(ids)
        at = P.compose(self._gripper.tool, P.inverse(part.pose))
        sim.set_body_state(at[:, None], np.zeros((len(ids), 1, 6)), ids, [self._thing])
        upper = self.world.joints[0].upper
        apart = np.minimum(0.5 * (width + SPARE), upper)
        sim.set_joint_state(np.repeat(apart[:, None], 2, axis=1), np.zeros((len(ids), 2)), ids)
        closed = -1.25 * self._gripper.force / _KP  # beyond touching: a finger presses with all its force at any width
        sim.set_control(position=np.full((len(ids), 2), closed), env_ids=ids)
        for _ in range(_CLOSING):
            sim.step(SUBSTEPS, ids)
        state = sim.get_state()
        held = state.body_pose[ids, self._thing].copy()
        grip = state.joint_pos[ids].sum(axis=1)
        missed = (grip < MISSED * width) | (state.fault[ids] != 0)
        moved = P.norm(held[:, :3] - at[:, :3]) > DISPLACED[0]
        gone = missed | moved | (P.angle_between(held[:, 3:], at[:, 3:]) > DISPLACED[1])
        return ClosedGrip(held, gone, missed, sim.snapshot(ids))


def with_thing(hand: ImportedModel, subject: Subject) -> WorldBuilder:
    """A World without weight, with a hand that is fixed and the subject, free."""
    physics = Physics(dt=_DT, control_dt=_DT * SUBSTEPS, gravity=(0.0, 0.0, 0.0), impratio=1.0)
    builder = WorldBuilder(World("trial", physics=physics))
    builder.add("gripper", EntityKind.ROBOT, hand, root=BodyKind.STATIC)
    own = subject.world
    names = tuple("" for _ in own.geoms)
    numbered = tuple(replace(g, name=f"piece{i}") for i, g in enumerate(own.geoms))
    model = ImportedModel("thing", (subject.body,), geoms=numbered, geom_links=names, meshes=own.meshes, links={"": 0})
    builder.add("thing", EntityKind.OBJECT, model, root=BodyKind.FREE)
    return builder


def _world(gripper: Gripper, subject: Subject) -> World:
    builder = with_thing(gripper.model, subject)
    builder.actuators += [
        Actuator(joint.name, number, ControlMode.POSITION, _KP, _KD, gripper.force)
        for number, joint in enumerate(builder.joints)
    ]
    return builder.build()


def _loads(subject: Subject) -> list[Array]:
    """Forces [N] of the easy test, in the thing's frame where it is pulled, else in the world's."""
    if subject.pull is not None:
        return [PULL * subject.pull, -PULL * subject.pull]
    weight = subject.body.inertial.mass * _GRAVITY
    return [weight * sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]


def _in_world(load: Array, held: Array, subject: Subject) -> Array:
    """Wrenches (n, 6) at the centres of mass of things at poses (n, 7)."""
    turn = held[:, 3:]
    if subject.pull is None:
        return np.broadcast_to(np.concatenate([load, np.zeros(3)]), (len(held), 6))
    arm = subject.frame[:3] - np.array(subject.body.inertial.com)
    force = P.rotate(turn, np.broadcast_to(load, (len(held), 3)))
    return np.concatenate([force, P.cross(P.rotate(turn, np.broadcast_to(arm, force.shape)), force)], axis=1)
