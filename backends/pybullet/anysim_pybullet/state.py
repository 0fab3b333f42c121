"""The neutral state, mirrored: what was written is kept as it was written, the rest is read from Bullet when asked for.

Bullet keeps the pose of a centre of mass, as a matrix; a pose that was written would come back with other last bits. So
the arrays here are what counts until the env is stepped.
"""

from collections.abc import Callable, Mapping
from functools import cache
from struct import Struct

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_pybullet import reading
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env
from anysim_pybullet.law import Laws

LINKS, ALL = range(2)
"""How much of an env's mirror is out of date."""

_NONE = np.zeros(0, dtype=int)

FAR, FAST = 1e6, 1e8
"""[m] and [m/s, rad/s] beyond which an env is given up: Bullet's collision detection has lost its bodies."""


class Mirror:
    """State arrays of all envs: body poses and twists, joint positions and velocities, faults."""

    def __init__(self, world: World, envs: list[Env], laws: Laws) -> None:
        n, bodies, joints = len(envs), len(world.bodies), len(world.joints)
        self._envs, self._laws = envs, laws
        self.pose, self.twist = np.zeros((n, bodies, 7)), np.zeros((n, bodies, 6))
        self.position, self.velocity = np.zeros((n, joints)), np.zeros((n, joints))
        self.fault = np.zeros(n, dtype=bool)
        self._stale = dict.fromkeys(range(n), ALL)
        """How much is out of date, of envs of which anything is."""
        self._motor = np.zeros((n, joints))
        self._running = np.zeros((n, joints), dtype=bool) if laws.motors is None else laws.motors.running
        self._fields: Mapping[str, Array] = {
            "body_pose": self.pose, "body_twist": self.twist, "joint_pos": self.position, "joint_vel": self.velocity,
            "fault": self.fault,
        }  # fmt: skip

    def stepped(self, index: int, sound: bool) -> None:
        """This env was stepped; everything of it is new."""
        self._stale[index] = ALL
        if not sound:
            self.fault[index] = True

    def wrote(self, index: int) -> None:
        """Roots or joints of this env were written, here and in Bullet; its links follow."""
        self._stale.setdefault(index, LINKS)

    def hold(self, index: int) -> None:
        """All of this env's arrays were written."""
        self._stale.pop(index, None)

    def known_position(self, index: int) -> Array | None:
        """The joint positions (J,) of an env, if they are those that Bullet has now."""
        return self.position[index] if self._stale.get(index) != ALL else None

    def refresh(self, index: int) -> None:
        """Bring an env's motion up to date."""
        level = self._stale.get(index)
        if level is not None:
            self._read(index, level == ALL)
            del self._stale[index]

    def field(self, name: str) -> Array:
        """A fresh array of one of the neutral fields."""
        for index in tuple(self._stale):
            self.refresh(index)
        return self._fields[name].copy()

    def _read(self, index: int, everything: bool) -> None:
        """Take an env's state from Bullet; of one whose roots and joints are known, only its links."""
        p, env = bullet(), self._envs[index]
        client, cast = env.id, env.cast
        numbers: list[float] = []
        position: tuple[float, ...] = ()
        velocity: tuple[float, ...] = ()
        motor: tuple[float, ...] = ()
        if everything:
            for number, _ in cast.free:
                uid = env.root_ids[number]
                place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
                linear, angular = p.getBaseVelocity(uid, physicsClientId=client)
                numbers += place + turn + linear + angular + reading.UNUSED
        for number, _ in cast.linked:
            uid, links = env.root_ids[number], env.tree_links[number]
            if everything:
                at, rate, _, torque = zip(*p.getJointStates(uid, links, physicsClientId=client), strict=True)
                position, velocity, motor = position + at, velocity + rate, motor + torque
            read = p.getLinkStates(
                uid, links, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client
            )
            for center, _, _, _, origin, turn, linear, angular in read:
                numbers += center + turn + linear + angular + origin
        numbers += position + velocity + motor
        packed = np.frombuffer(_packer(len(numbers))(*numbers))
        bodies, roots, joints = cast.moving, len(cast.free), cast.jointed
        if not everything:
            bodies, roots, joints = cast.links, 0, _NONE
        pose, twist, rates = self.pose[index], self.twist[index], self.velocity[index]
        written = pose, twist, self.position[index], rates, self._motor[index], self._laws.effort[index]
        reading.take(packed, env.local, bodies, roots, joints, self._running[index], *written)
        if not reading.within(FAR, FAST, pose, twist, rates):
            self.fault[index] = True


@cache
def _packer(count: int) -> Callable[..., bytes]:
    """Makes float64 of so many numbers, in half the time that numpy takes for it."""
    return Struct(f"{count}d").pack
