"""The contract of a co-solver: a family whose matter moves by a solver of its own and exchanges momentum with bodies.

At each physics step it is told where the bodies are that it meets and how they move, moves its matter on, and answers
with the impulse that each of them gets. They act as wrenches during the engine's step, so bodies gain what is answered.
What the matter gains is accounted for: see `balance`.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.families.base import Family, FamilySetting
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.world import BodyKind


@dataclass
class MetBodies:
    """K bodies in n envs at the beginning of a physics step, world axes; what follows from the rest is made if asked.

    Attributes:
        frame: (n, K, 7) of the bodies.
        frame_twist: (n, K, 6) [m/s, rad/s] velocity of the frame's origin, and rate.
        local: (n, K, 3) [m] their centres of mass in these frames.
        weighed: (n, K) [kg] as if all were there and free.
        held: (K,) bool, what joints hold.
        moments: (n, K, 6) [kg m^2] xx, yy, zz, xy, xz, yz about the centre of mass, in the axes of the body.
        friction: (n, G) of the World's geoms.
        there: (n, E) bool, the World's entities that are there.
        entity: (K,) of which they are.
        body_pose: (n, B, 7) of all bodies.
    """

    frame: Array
    frame_twist: Array
    local: Array
    weighed: Array
    held: Array
    moments: Array
    friction: Array
    there: Array
    entity: Array
    body_pose: Array

    @cached_property
    def _arm(self) -> Array:
        return P.rotate(self.turn, self.local)

    @property
    def turn(self) -> Array:
        """(n, K, 4) of the axes of bodies."""
        return self.frame[..., 3:]

    @cached_property
    def com(self) -> Array:
        """(n, K, 3) [m] their centres of mass."""
        return self.frame[..., :3] + self._arm

    @cached_property
    def twist(self) -> Array:
        """(n, K, 6) [m/s, rad/s] velocity of the centre of mass, and rate."""
        moving, rate = self.frame_twist[..., :3], self.frame_twist[..., 3:]
        return np.concatenate([moving + P.cross(rate, self._arm), rate], axis=-1)

    @cached_property
    def mass(self) -> Array:
        """(n, K) [kg], 0 of what is not there; inf of what joints hold, which moves as it does, whatever it meets."""
        return np.where(self.there[:, self.entity], np.where(self.held, np.inf, self.weighed), 0.0)

    @property
    def inertia(self) -> Array:
        """(n, K, 3, 3) [kg m^2] about the centre of mass, world axes."""
        return inertia.turned(self.moments, self.turn)


class Balance(NamedTuple):
    """Momentum about the world's origin, (n, 6) [N s, N m s]; `now - begun = received - given` where none is lost.

    Attributes:
        now, begun: of the matter, now and at the reset.
        received: what weight and everything fixed gave to it since.
        given: what it gave to the bodies that it meets.
    """

    now: Array
    begun: Array
    received: Array
    given: Array


def about_origin(parts: Array, at: Array) -> Array:
    """(6,) the sum of parts (V, 3) of a momentum or a force at points (V, 3) [m], about the world's origin."""
    return np.concatenate([parts.sum(axis=0), P.cross(at, parts).sum(axis=0)])


class CoSolver(Family):
    """A family with a solver; its matter is in `memory`, as all that a family knows.

    Attributes:
        met: (K,) the bodies that it meets.
        given: (N, K, 6) what it gave to them since the reset, about the world's origin.
        received: (N, 6) what it got from everything else, see `Balance`.
    """

    needs = (Capability.WRENCHES,)
    rate: Literal["control", "physics"] = "physics"

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        world = setting.engine.world
        solid = {geom.body for geom in world.geoms if geom.collides}
        self.met = np.array([i for i in sorted(solid) if i >= 0 and self.meets(i)], dtype=np.intp)
        self._held = np.array([not world.loose[i] for i in self.met], dtype=bool)
        self._entity = np.array(world.body_entity, dtype=np.intp)[self.met]
        k = len(self.met)
        self._mass, self._com = self.remember("body_mass", k), self.remember("body_com", k, 3)
        self._inertia = self.remember("body_inertia", k, 6)
        self._friction = self.remember("geom_friction", len(world.geoms))
        self.given, self.received = self.remember("given", k, 6), self.remember("received", 6)
        self._impulse, self._begun = self.remember("impulse", k, 6), self.remember("begun", 6)
        self._everyone = np.arange(self.engine.num_envs)
        self._all_there = None if world.slots else self.engine.presence

    def meets(self, body: int) -> bool:
        """Whether it exchanges impulses with a body that collides: with all that can move, and are not its own."""
        world = self.engine.world
        return world.bodies[body].kind is not BodyKind.STATIC and world.body_entity[body] not in self.setting.entities

    # ------------------------------------------------------------------ what a solver writes

    @abstractmethod
    def fill(self, env_ids: Array) -> None:
        """Put the matter where an episode begins, in these envs: all of its memory is zero."""

    @abstractmethod
    def solve(self, env_ids: Array, bodies: MetBodies, duration: float) -> Array:
        """Move the matter of these envs on by `duration` [s].

        Returns the impulses (n, K, 6) [N s, N m s] on the bodies, about their centres of mass, world axes, and adds to
        `received` what the matter got from elsewhere.
        """

    @abstractmethod
    def momentum(self, env_ids: Array) -> Array:
        """Linear and angular momentum (n, 6) [N s, N m s] of the matter, about the world's origin."""

    # ------------------------------------------------------------------ its life

    def reset(self, env_ids: Array) -> None:
        for name, kept in (("body.mass", self._mass), ("body.com", self._com), ("body.inertia", self._inertia)):
            kept[env_ids] = self._parameter(name, env_ids, self.met)
        self._friction[env_ids] = self._parameter("geom.friction", env_ids, None)
        self.fill(env_ids)
        self._begun[env_ids] = self.momentum(env_ids)

    def _parameter(self, name: str, env_ids: Array, which: Array | None) -> Array:
        """What bodies and geoms are like in an episode: as it is drawn, where an engine lets it be drawn."""
        if name in self.engine.parameters:
            return self.engine.get_parameters(name, env_ids, which)
        built = self.engine.built_parameters(name)
        return built if which is None else built[which]

    def before_step(self, env_ids: Array, duration: float) -> None:
        rows = slice(None) if np.array_equal(env_ids, self._everyone) else env_ids  # views of all cost nothing
        state, met = self.engine.get_state(), self.met
        pose, twist, there = state.body_pose[rows], state.body_twist[rows], self._all_there
        bodies = MetBodies(
            pose[:, met],
            twist[:, met],
            self._com[rows],
            self._mass[rows],
            self._held,
            self._inertia[rows],
            self._friction[rows],
            self.engine.presence[rows] if there is None else there[rows],
            self._entity,
            pose,
        )
        impulse = self.solve(env_ids, bodies, duration)
        self._impulse[rows] = impulse
        self.given[rows] += impulse
        self.given[rows, :, 3:] += P.cross(bodies.com, impulse[..., :3])
        if len(met):
            self.push(env_ids, impulse / duration, met)

    # ------------------------------------------------------------------ what others ask of it

    def body_force(self, env_ids: Array) -> Array:
        """(n, K, 6) [N, N m] what bodies felt in the last physics step, about their centres of mass, world axes."""
        return self._impulse[env_ids] / self.engine.world.physics.dt

    def balance(self, env_ids: Array) -> Balance:
        """The account of momentum since the reset."""
        given = self.given[env_ids].sum(axis=1)
        return Balance(self.momentum(env_ids), self._begun[env_ids], self.received[env_ids], given)
