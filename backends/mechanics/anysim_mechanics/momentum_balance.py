"""The net contact force on each body, by the balance of its momentum over a substep.

What a body gains in momentum in a substep, less its weight, what is pushed and what its joints exert, are its contacts:
for libraries that tell of contacts the normal forces alone (PhysX). That is exact for a free body. For a link it takes
the library's forces of its joints. Those of PhysX are right but above a joint with dry friction, whose reaction it
tells wrong: by the friction of a sliding joint, by that of a turning one over 0.3 m.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType, World

_DOUBT = {JointType.PRISMATIC: 2.0, JointType.REVOLUTE: 10.0}
"""[1, 1/m] by how much of a joint's dry friction the force on a link above may be off, at most of what was seen."""


class Balance(NamedTuple):
    """Net contact forces on the bodies of an env.

    Attributes:
        force: (B, 3) [N], world axes; 0 for what is fixed.
        doubt: (B,) [N], by how much `force` may be off beyond rounding; infinite where nothing is known.
    """

    force: Array
    doubt: Array


class Circumstances(NamedTuple):
    """What an env was under in a substep.

    Attributes:
        gravity: (3,) [m/s^2], mass: (B,) [kg], friction: (J,) [N m] or [N].
        slowing: (B, 2) [1/s] damping of velocities, which takes its share of what gravity and pushes have added
            already, and of rates.
        pushes: (K, 7) bodies and the wrenches that were on them; None without any.
    """

    gravity: Array
    mass: Array
    friction: Array
    slowing: Array
    pushes: Array | None


class Substep(NamedTuple):
    """What a substep did to an env.

    Attributes:
        before, after: (B, 3) [m/s] velocities of the centres of mass.
        turn: (B, 4) orientations before.
        joint_force: (B, 3) [N] what each link's joint exerts on it, in the joint's axes before.
    """

    before: Array
    after: Array
    turn: Array
    joint_force: Array


class MomentumBalance:
    """The constants of a World, made once."""

    def __init__(self, world: World, joint_turn: Array) -> None:
        """`joint_turn` (J, 4) are the axes of the joints in their links' frames, in which their forces are told."""
        bodies = range(len(world.bodies))
        self._dt = world.physics.dt
        self._moving = np.array([i for i in bodies if world.bodies[i].kind is not BodyKind.STATIC], dtype=int)
        self._weighs = np.array([not b.gravity_compensation for b in world.bodies], dtype=float)
        self._parent = np.array([b.parent for b in world.bodies], dtype=int)
        self._links = np.array([i for i in bodies if world.bodies[i].kind is BodyKind.LINK], dtype=int)
        self._turn = np.zeros((len(world.bodies), 4))
        self._turn[[joint.body for joint in world.joints]] = joint_turn
        self._doubts = _doubts(world)

    def unknown(self) -> Balance:
        """Where there was no substep."""
        return Balance(np.zeros((len(self._parent), 3)), np.full(len(self._parent), np.inf))

    def solve(self, substep: Substep, given: Circumstances) -> Balance:
        """Net contact forces of a substep."""
        (force, doubt), moving, mass = self.unknown(), self._moving, given.mass[self._moving]
        before = substep.before[moving]
        force[moving] = (substep.after[moving] - before) * (mass[:, None] / self._dt)
        force[moving] -= np.outer(mass * self._weighs[moving], given.gravity)
        if given.slowing[:, 0].any():
            force[moving] += self._dragged(before, given)
        if given.pushes is not None:
            force[given.pushes[:, 0].astype(int)] -= given.pushes[:, 1:4]
        if len(self._links):
            exerted, links = np.zeros_like(force), self._links
            exerted[links] = P.rotate(P.multiply(substep.turn[links], self._turn[links]), substep.joint_force[links])
            force -= exerted
            np.add.at(force, self._parent[links], exerted[links])
        doubt[moving] = (given.friction @ self._doubts)[moving]
        return Balance(force, doubt)

    def _dragged(self, before: Array, given: Circumstances) -> Array:
        """(M, 3) [N] what damping takes of what moves."""
        moving = self._moving
        pushed = np.zeros((len(self._parent), 3))
        if given.pushes is not None:
            pushed[given.pushes[:, 0].astype(int)] = given.pushes[:, 1:4]
        mass = given.mass[moving, None]
        pulled = np.divide(pushed[moving], mass, out=np.zeros((len(mass), 3)), where=mass > 0)  # 0 of what is absent
        gained = np.outer(self._weighs[moving], given.gravity) + pulled
        return given.slowing[moving, :1] * mass * (before + self._dt * gained)


def _doubts(world: World) -> Array:
    """(J, B): what the dry friction of each joint puts in doubt on each link above it."""
    doubts = np.zeros((len(world.joints), len(world.bodies)))
    for index, joint in enumerate(world.joints):
        body = world.bodies[joint.body].parent
        while body >= 0:
            doubts[index, body] = _DOUBT[joint.type]
            body = world.bodies[body].parent
    return doubts
