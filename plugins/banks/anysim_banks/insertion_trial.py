"""Trials of insertions in physics: a peg in a yielding hand, which pushes it along the axis of a fixed hole.

There is no weight. The hand is a spring and a damper at the peg's centre of mass, alike for all masses, that leads it
down the axis and is never more than `LEAD` ahead. The easy test admits: misplaced to each of four sides by a quarter of
the clearance, the peg comes to `SEATED` of the depth. The hard test ranks: misplaced by more, so that it has to slip in
over the rim; the margin is the largest multiple of the easy misplacement with which it still does. In the long test it
is held askew, by `TILT`, as well as misplaced.
"""

from typing import Any, NamedTuple, Self, cast

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.model.world import BodyKind, EntityKind, Physics, World
from anysim_banks.insertion import AHEAD, Hole, Peg, Solid
from anysim_banks.sampling import Candidates
from anysim_banks.trial import ENVS, SHIFT, TURN, Verdicts

EASY = 0.25
"""Of the clearance."""
TIMES = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Multiples of that in the hard test."""
SEATED = 0.9
"""Of the depth, as the skill `insert` asks for."""
TILT = 0.01
"""[rad]"""
START, LEAD = 0.004, 0.008
"""[m] of the tip before the mouth; of the hand ahead of the peg."""
SPEED = 0.1
"""[m/s] of the hand."""
STIFF, DAMPED = 0.02, 0.3
"""The spring by the mass and the square of a step, the damper by the mass and a step: what is stable at any mass."""

_DT = 0.002
_SIDES = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


class _Hand(NamedTuple):
    """Where the hand leads pegs (n,): offsets (n, 2) [m] across the axis, and tilts (n, 2) [rad] about x and y."""

    aside: Array
    tilt: Array


class InsertionTrial:
    """An engine with a hole and a peg in each env. Use it in `with`."""

    def __init__(self, hole: Hole, peg: Peg, engine: str, envs: int | None = None) -> None:
        self._hole, self._peg = hole, peg
        self._n = envs or ENVS.get(engine, 16)
        self.world = _world(hole, peg)
        self._sim: SimEngine = create_simulation(engine).create_world(self.world, self._n)
        self._thing = len(self.world.bodies) - 1
        inertial = peg.solid.body.inertial
        self._mass, self._com = inertial.mass, np.array(inertial.com)
        xx, yy, zz, xy, xz, yz = inertial.inertia
        self._inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._sim.destroy()

    def run(self, candidates: Candidates, *, hard: bool = True) -> Verdicts:
        """Try insertions; their order does not matter to their verdicts. Without the hard test margins are 0 or 1."""
        margin = np.zeros(len(candidates.width))
        alive = np.arange(len(margin))
        for times in (1.0, *(TIMES if hard else ())):
            alive = alive[self._all_sides(candidates.pose[alive], times, 0.0)]
            margin[alive] = times
        return Verdicts(margin, margin < 1.0)

    def lasting(self, candidates: Candidates, limits: tuple[float, float] = (SHIFT, TURN)) -> Array:
        """(n,) bool: those that come to the end askew as well; `limits` are of grasps."""
        del limits
        return self._all_sides(candidates.pose, 1.0, TILT)

    def _all_sides(self, poses: Array, times: float, tilt: float) -> Array:
        """(n,) bool: the peg comes to its end, misplaced to each side."""
        seated = np.ones(len(poses), dtype=bool)
        for x, y in _SIDES:
            alive = np.flatnonzero(seated)
            aside = times * EASY * self._hole.clearance * np.array([x, y])
            for part in np.split(alive, range(self._n, len(alive), self._n)):
                hand = _Hand(np.tile(aside, (len(part), 1)), np.tile(tilt * np.array([y, x]), (len(part), 1)))
                seated[part] = self._push(poses[part], hand)
        return seated

    def _push(self, ends: Array, hand: _Hand) -> Array:
        """(n,) bool: pegs whose tips have come to `SEATED` of the way to their ends (n, 7)."""
        sim, ids = self._sim, np.arange(len(ends))
        if len(ids) == 0:
            return np.zeros(0, dtype=bool)
        depth = self._hole.affordance.depth
        sim.reset(ids)
        above = self._tips(ends, hand, np.full(len(ids), depth + START))
        sim.set_body_state(self._roots(above)[:, None], np.zeros((len(ids), 1, 6)), ids, [self._thing])
        steps = int(np.ceil((START + depth + LEAD) / SPEED / _DT * 1.5))
        to_end = np.full(len(ids), np.inf)
        for step in range(steps):
            state = sim.get_state()
            now, twist = state.body_pose[ids, self._thing], state.body_twist[ids, self._thing]
            tip = P.compose(now, np.broadcast_to(self._peg.tip, now.shape))
            out = P.rotate(ends[:, 3:], np.broadcast_to([0.0, 0.0, -1.0], (len(ids), 3)))
            to_end = P.dot(tip[:, :3] - ends[:, :3], out)
            led = np.maximum(depth + START - SPEED * _DT * (step + 1), to_end - LEAD)
            wanted = self._roots(self._tips(ends, hand, np.maximum(led, -LEAD)))
            sim.apply_wrench(self._wrench(now, twist, wanted)[:, None], [self._thing], ids)
            sim.step(1, ids)
        return to_end <= (1.0 - SEATED) * depth

    def _tips(self, ends: Array, hand: _Hand, out: Array) -> Array:
        """(n, 7) where the hand has tips, `out` (n,) [m] before their ends."""
        zero = np.zeros(len(ends))
        turn = P.from_roll_pitch_yaw(np.concatenate([hand.tilt, zero[:, None]], axis=1))
        local = np.concatenate([hand.aside, -out[:, None], turn], axis=1)
        return P.compose(P.compose(ends, local), np.broadcast_to(AHEAD, ends.shape))

    def _roots(self, tips: Array) -> Array:
        return P.compose(tips, np.broadcast_to(P.inverse(self._peg.tip), tips.shape))

    def _wrench(self, now: Array, twist: Array, wanted: Array) -> Array:
        """(n, 6) of springs and dampers at the centres of mass of pegs at (n, 7), from where they are to be."""
        com = np.broadcast_to(self._com, (len(now), 3))
        arm = P.rotate(now[:, 3:], com)
        off = wanted[:, :3] + P.rotate(wanted[:, 3:], com) - now[:, :3] - arm
        speed = twist[:, :3] + P.cross(twist[:, 3:], arm)
        turn = P.rotation_vector(P.multiply(wanted[:, 3:], P.conjugate(now[:, 3:])))
        push = STIFF / _DT**2 * off - DAMPED / _DT * speed
        spin = STIFF / _DT**2 * turn - DAMPED / _DT * twist[:, 3:]
        torque = P.rotate(now[:, 3:], P.rotate_inverse(now[:, 3:], spin) @ self._inertia)
        return np.concatenate([self._mass * push, torque], axis=1)


def _world(hole: Hole, peg: Peg) -> World:
    physics = Physics(dt=_DT, control_dt=_DT, gravity=(0.0, 0.0, 0.0), impratio=1.0)
    builder = WorldBuilder(World("trial", physics=physics))
    builder.add("hole", EntityKind.OBJECT, _model("hole", hole.around), root=BodyKind.STATIC)
    builder.add("peg", EntityKind.OBJECT, _model("peg", peg.solid), root=BodyKind.FREE)
    return builder.build()


def _model(name: str, solid: Solid) -> ImportedModel:
    names = cast(Any, tuple("" for _ in solid.geoms))
    return ImportedModel(name, (solid.body,), geoms=solid.geoms, geom_links=names, meshes=solid.meshes, links={"": 0})
