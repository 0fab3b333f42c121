"""Trials of grasps with several fingers, which close by a synergy, each until it touches, as skills close them.

What is grasped stays where it is while they close, as on a table: a spring holds it, and then lets go.
"""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import World
from anysim_banks.hand import Hand
from anysim_banks.sampling import Candidates
from anysim_banks.subject import Subject
from anysim_banks.trial import SUBSTEPS, ClosedGrip, HeldTrial, with_thing

RATE, PRESS, TOUCH = 1.5, 0.25, 0.5
"""[1/s] of the way to the posture; of that way beyond contact; [N] at which a finger touches."""
CLOSING = 60
"""Control steps until they count as closed."""
LINKS = 3
"""Of fingers that touch what is held."""
DISPLACED = 0.03, 0.4
"""[m], [rad] by which it may move while they close."""
STAYS, SLOWED = 60.0, 4.0
"""[1/s^2], [1/s] of the spring and the damper that hold it, by its mass and inertia."""


class HandTrial(HeldTrial):
    """Trials with a hand."""

    def __init__(self, hand: Hand, subject: Subject, engine: str, envs: int | None = None) -> None:
        self._hand = hand
        super().__init__(_world(hand, subject), subject, engine, envs)
        self._postures = list(hand.synergies)
        self._ways = np.array([posture - hand.opened for posture in hand.synergies.values()])
        inertial = subject.body.inertial
        self._mass, self._com = inertial.mass, np.array(inertial.com)
        xx, yy, zz, xy, xz, yz = inertial.inertia
        self._inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def closed(self, part: Candidates) -> ClosedGrip:
        sim, hand, ids = self._sim, self._hand, np.arange(len(part.width))
        way = self._ways[[self._postures.index(kind) for kind in part.kind.tolist()]]
        sim.reset(ids)
        at = P.compose(np.broadcast_to(hand.tool, part.pose.shape), P.inverse(part.pose))
        sim.set_body_state(at[:, None], np.zeros((len(ids), 1, 6)), ids, [self._thing])
        joints = [actuator.joint for actuator in hand.actuators]
        begin = np.tile([joint.initial for joint in self.world.joints], (len(ids), 1))
        begin[:, joints] = hand.opened
        sim.set_joint_state(begin, np.zeros_like(begin), ids)
        s, stopped = np.zeros((len(ids), hand.finger.max() + 1)), np.zeros((len(ids), hand.finger.max() + 1), bool)
        links = np.zeros(len(ids), dtype=int)
        for _ in range(CLOSING):
            force, links = self._touches(ids, s.shape[1])
            fresh = (force > TOUCH) & ~stopped
            step = np.where(stopped, 0.0, RATE * self.world.physics.control_dt)
            s = np.minimum(np.where(fresh, s + PRESS, s + step), 1.0)
            stopped |= fresh | (s >= 1.0)
            share = np.where(hand.finger >= 0, s[:, hand.finger], s.min(axis=1)[:, None])
            sim.set_control(position=hand.opened + share * way, env_ids=ids)
            state = sim.get_state()
            now, twist = state.body_pose[ids, self._thing], state.body_twist[ids, self._thing]
            sim.apply_wrench(self._kept(now, twist, at)[:, None], [self._thing], ids)
            sim.step(SUBSTEPS, ids)
        state = sim.get_state()
        held = state.body_pose[ids, self._thing].copy()
        missed = (links < LINKS) | (state.fault[ids] != 0)
        moved = P.norm(held[:, :3] - at[:, :3]) > DISPLACED[0]
        gone = missed | moved | (P.angle_between(held[:, 3:], at[:, 3:]) > DISPLACED[1])
        return ClosedGrip(held, gone, missed, sim.snapshot(ids))

    def _touches(self, ids: Array, fingers: int) -> tuple[Array, Array]:
        """(n, F) [N] on each finger by the thing, and (n,) how many links of fingers it touches."""
        points = self._sim.contacts(ids)
        one, other = points.body_a, points.body_b
        touching = (one == self._thing) ^ (other == self._thing)
        link = np.where(one == self._thing, other, one)[touching]
        env, size = points.env[touching], P.norm(points.force[touching])
        finger = np.where(link >= 0, self._hand.finger_of[np.minimum(link, len(self._hand.finger_of) - 1)], -1)
        own = finger >= 0
        force = np.zeros((len(ids), fingers))
        np.add.at(force, (env[own], finger[own]), size[own])
        touched = np.zeros((len(ids), len(self._hand.finger_of)), dtype=bool)
        firm = own & (size > 0.1 * TOUCH)
        touched[env[firm], link[firm]] = True
        return force, touched.sum(axis=1)

    def _kept(self, now: Array, twist: Array, at: Array) -> Array:
        """(n, 6) of springs and dampers that keep things at (n, 7), for the next control step."""
        arm = P.rotate(now[:, 3:], np.broadcast_to(self._com, (len(now), 3)))
        off = at[:, :3] + P.rotate(at[:, 3:], np.broadcast_to(self._com, arm.shape)) - now[:, :3] - arm
        push = STAYS * off - SLOWED * (twist[:, :3] + P.cross(twist[:, 3:], arm))
        turn = P.rotation_vector(P.multiply(at[:, 3:], P.conjugate(now[:, 3:])))
        spin = STAYS * turn - SLOWED * twist[:, 3:]
        torque = P.rotate(now[:, 3:], P.rotate_inverse(now[:, 3:], spin) @ self._inertia)
        return np.concatenate([self._mass * push, torque], axis=1)


def _world(hand: Hand, subject: Subject) -> World:
    builder = with_thing(hand.model, subject)
    builder.actuators += hand.actuators
    return builder.build()
