"""The neutral state, mirrored: what was written is kept as it was written, the rest is read from Bullet when asked for.

Bullet keeps the pose of a centre of mass, as a matrix; a pose that was written would come back with other last bits. So
the arrays here are what counts until the env is stepped.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env
from anysim_pybullet.contacts import sensor_forces
from anysim_pybullet.kernels import frames
from anysim_pybullet.law import Laws

FRESH, LINKS, ALL = range(3)
"""How much of an env's mirror is out of date."""

_UNUSED = (0.0,) * 7
"""In place of a link's frame, which a root has not."""

FAR, FAST = 1e6, 1e8
"""[m] and [m/s, rad/s] beyond which an env is given up: Bullet's collision detection has lost its bodies."""


class Mirror:
    """State arrays of all envs: body poses and twists, joint positions and velocities, contact forces, faults."""

    def __init__(self, world: World, envs: list[Env], laws: Laws) -> None:
        n, bodies, joints = len(envs), len(world.bodies), len(world.joints)
        self._world, self._envs, self._laws = world, envs, laws
        self.pose, self.twist = np.zeros((n, bodies, 7)), np.zeros((n, bodies, 6))
        self.position, self.velocity = np.zeros((n, joints)), np.zeros((n, joints))
        self.contact = np.zeros((n, len(world.contact_sensors), 3))
        self.fault = np.zeros(n, dtype=bool)
        self._stale = np.full(n, ALL)
        self._motor = np.zeros((n, joints))
        self._contact_stale = np.zeros(n, dtype=bool)

    def stepped(self, index: int, sound: bool) -> None:
        """This env was stepped; everything of it is new."""
        self._stale[index], self._contact_stale[index] = ALL, True
        if not sound:
            self.fault[index] = True

    def wrote(self, index: int) -> None:
        """Roots or joints of this env were written, here and in Bullet; its links follow."""
        self._stale[index] = max(self._stale[index], LINKS)

    def hold(self, index: int) -> None:
        """All of this env's arrays were written."""
        self._stale[index], self._contact_stale[index] = FRESH, False

    def known_position(self, index: int) -> Array | None:
        """The joint positions (J,) of an env, if they are those that Bullet has now."""
        return self.position[index] if self._stale[index] != ALL else None

    def refresh(self, index: int) -> None:
        """Bring an env's motion up to date."""
        if self._stale[index] != FRESH:
            self._read(index, self._stale[index] == ALL)
            self._finish(np.array([index]))

    def settle(self, index: int) -> None:
        """Bring everything of an env up to date, also its contacts."""
        self.refresh(index)
        if self._contact_stale[index]:
            self.contact[index] = sensor_forces(self._world, self._envs[index])
            self._contact_stale[index] = False

    def field(self, name: str) -> Array:
        """A fresh array of one of the neutral fields."""
        if name == "joint_effort" and self._laws.motors is None:
            return self._laws.effort.copy()
        if name == "contact_force":
            for index in range(len(self._envs)):
                self.settle(index)
        else:
            self._refresh_all()
        arrays = {
            "body_pose": self.pose, "body_twist": self.twist, "joint_pos": self.position, "joint_vel": self.velocity,
            "contact_force": self.contact, "fault": self.fault, "joint_effort": self._laws.effort,
        }  # fmt: skip
        return arrays[name].copy()

    def _refresh_all(self) -> None:
        stale = np.flatnonzero(self._stale != FRESH)
        if len(stale):
            levels = self._stale[stale].tolist()
            for index, level in zip(stale.tolist(), levels, strict=True):
                self._read(index, level == ALL)
            self._finish(stale)

    def _finish(self, ids: Array) -> None:
        """These envs were read."""
        if self._laws.motors is not None:
            stepped = ids[self._stale[ids] == ALL]
            effort, motor = self._laws.effort[stepped], self._motor[stepped]
            self._laws.effort[stepped] = np.where(self._laws.motors.running[stepped], motor, effort)
        self._stale[ids] = FRESH
        self._judge(ids)

    def _read(self, index: int, everything: bool) -> None:
        p, env = bullet(), self._envs[index]
        client, cast = env.id, env.cast
        rows: list[tuple[float, ...]] = []
        if everything:
            for number, _ in cast.free:
                uid = env.root_ids[number]
                place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
                linear, angular = p.getBaseVelocity(uid, physicsClientId=client)
                rows.append((*place, *turn, *_UNUSED, *linear, *angular))
        for number, joints in cast.linked:
            uid, links = env.root_ids[number], env.tree_links[number]
            if everything:
                states: Any = p.getJointStates(uid, links, physicsClientId=client)
                self.position[index, joints] = [s[0] for s in states]
                self.velocity[index, joints] = [s[1] for s in states]
                if self._laws.motors is not None:
                    self._motor[index, joints] = [s[3] for s in states]
            read = p.getLinkStates(
                uid, links, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client
            )
            rows += [(*s[0], *s[1], *s[4], *s[5], *s[6], *s[7]) for s in read]
        bodies, is_root = (cast.moving, cast.is_root) if everything else (cast.links, cast.is_root[len(cast.free) :])
        pose, twist = np.empty((len(bodies), 7)), np.empty((len(bodies), 6))
        frames(np.array(rows, dtype=float).reshape(-1, 20), env.local[bodies], is_root, pose, twist)
        self.pose[index, bodies], self.twist[index, bodies] = pose, twist

    def _judge(self, ids: Array) -> None:
        """A comparison with what is not a number is false, so that it is a fault too."""
        near = (np.abs(self.pose[ids, :, :3]) < FAR).all(axis=(1, 2))
        slow = (np.abs(self.twist[ids]) < FAST).all(axis=(1, 2)) & (np.abs(self.velocity[ids]) < FAST).all(axis=1)
        self.fault[ids] |= ~(near & slow)
