"""The neutral state, mirrored: what was written is kept as it was written, the rest is read from Bullet when asked for.

Bullet keeps the pose of a centre of mass, as a matrix; a pose that was written would come back with other last bits. So
the arrays here are what counts until the env is stepped.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.world.model import World
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env
from anysim_pybullet.contacts import sensor_forces
from anysim_pybullet.kernels import frames
from anysim_pybullet.law import Laws

FRESH, LINKS, ALL = range(3)
"""How much of an env's mirror is out of date."""

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
        self._contact_stale = np.zeros(n, dtype=bool)
        trees = envs[0].plan.trees
        self._is_root = np.array([b.kind != "link" for b in world.bodies], dtype=bool)
        self._free = [(t.number, int(t.bodies[0])) for t in trees if t.free]
        self._linked = [(t.number, t.bodies[1:], t.joints) for t in trees if len(t.joints)]
        self._rows = np.zeros((bodies, 20))

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

    def refresh(self, index: int) -> None:
        """Bring an env's motion up to date."""
        if self._stale[index] != FRESH:
            self._read(index, self._stale[index] == ALL)
            self._stale[index] = FRESH

    def settle(self, index: int) -> None:
        """Bring everything of an env up to date, also its contacts."""
        self.refresh(index)
        if self._contact_stale[index]:
            self.contact[index] = sensor_forces(self._world, self._envs[index])
            self._contact_stale[index] = False

    def field(self, name: str) -> Array:
        """A fresh array of one of the neutral fields."""
        if name == "joint_effort":
            return self._laws.effort.copy()
        for index in range(len(self._envs)):
            if name == "contact_force":
                self.settle(index)
            else:
                self.refresh(index)
        arrays = {
            "body_pose": self.pose, "body_twist": self.twist, "joint_pos": self.position, "joint_vel": self.velocity,
            "contact_force": self.contact, "fault": self.fault,
        }  # fmt: skip
        return arrays[name].copy()

    def _read(self, index: int, everything: bool) -> None:
        p, env, rows = bullet(), self._envs[index], self._rows
        client = env.id
        if everything:
            for number, body in self._free:
                uid = env.root_ids[number]
                place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
                linear, angular = p.getBaseVelocity(uid, physicsClientId=client)
                rows[body] = (*place, *turn, 0, 0, 0, 0, 0, 0, 0, *linear, *angular)
        for number, bodies, joints in self._linked:
            uid = env.root_ids[number]
            if everything:
                links = [env.joint_link[j] for j in joints.tolist()]
                states: Any = p.getJointStates(uid, links, physicsClientId=client)
                self.position[index, joints] = [s[0] for s in states]
                self.velocity[index, joints] = [s[1] for s in states]
            links = [env.body_at[b][1] for b in bodies.tolist()]
            read = p.getLinkStates(
                uid, links, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client
            )
            rows[bodies] = [(*s[0], *s[1], *s[4], *s[5], *s[6], *s[7]) for s in read]
        pose, twist = np.zeros_like(self.pose[index]), np.zeros_like(self.twist[index])
        frames(rows, env.local, self._is_root, pose, twist)
        chosen = ~self._is_root
        if everything:
            chosen[[body for _, body in self._free]] = True
        self.pose[index, chosen], self.twist[index, chosen] = pose[chosen], twist[chosen]
        self._judge(index)

    def _judge(self, index: int) -> None:
        """A comparison with what is not a number is false, so that it is a fault too."""
        near = (np.abs(self.pose[index, :, :3]) < FAR).all()
        slow = (np.abs(self.twist[index]) < FAST).all() and (np.abs(self.velocity[index]) < FAST).all()
        if not (near and slow):
            self.fault[index] = True
