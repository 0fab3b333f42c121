"""The net contact force on each body, by its momentum: PhysX tells of contacts the normal forces alone.

What a body gains in momentum in a substep, less its weight, what is pushed and what its joints exert, are its contacts.
That is exact for a free body. For a link it takes PhysX' forces of its joints. These are right but above a joint with
dry friction, whose reaction PhysX tells wrong: by the friction of a sliding joint, by that of a turning one over 0.3 m.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array, xyzw_from_wxyz
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType, World
from anysim_sapien.recipe import Recipes
from anysim_sapien.scene import EnvScene

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


class _Noted(NamedTuple):
    """What a substep did to an env: as read, since most steps are never asked about."""

    scene: EnvScene
    before: bytes
    links_before: list[Array]
    after: bytes
    mass: Array
    friction: Array
    slowing: Array
    pushes: Array | None


class Momentum:
    """The balances of the last substep, per env."""

    def __init__(self, recipes: Recipes, num_envs: int) -> None:
        world = recipes.world
        self._world = world
        self._moving = np.array([i for i, b in enumerate(world.bodies) if b.kind is not BodyKind.STATIC], dtype=int)
        self._weighs = np.array([not b.gravity_compensation for b in world.bodies], dtype=float)
        self._parent = np.array([b.parent for b in world.bodies], dtype=int)
        self._links = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.LINK], dtype=int)
        self._turn = np.zeros((len(world.bodies), 4))
        for index, joint in enumerate(world.joints):
            self._turn[joint.body] = xyzw_from_wxyz(np.asarray(recipes.frames[index][1].q, dtype=float))
        self._doubts = _doubts(world)
        self._noted: list[_Noted | None] = [None] * num_envs
        self._balance: list[Balance | None] = [None] * num_envs

    def forget(self, env: int) -> None:
        """The env's scene is new: nothing has touched."""
        self._noted[env] = self._balance[env] = None

    def noted(self, env: int) -> _Noted | None:
        """What the env's last substep did; None where there was none."""
        return self._noted[env]

    def adopt(self, env: int, noted: _Noted | None) -> None:
        """The env's scene is another one, whose last substep did this."""
        self._noted[env], self._balance[env] = noted, None

    def before(self, scene: EnvScene) -> None:
        """Right before the last substep: note velocities and orientations."""
        self._before = scene.pack(), scene.link_velocities()

    def after(self, env: int, scene: EnvScene, pushes: Array | None) -> None:
        """After the last substep, with `pushes` (K, 7): bodies and the wrenches that were on them."""
        self._balance[env] = None
        self._noted[env] = _Noted(
            scene, *self._before, scene.packed(), scene.mass, scene.rubbing, scene.slowing, pushes
        )

    def balance(self, env: int) -> Balance:
        """Net contact forces of the env's last substep; all in doubt where there was none."""
        found = self._balance[env]
        if found is None:
            found = self._balance[env] = self._solve(self._noted[env])
        return found

    def _velocities(self, scene: EnvScene, packed: bytes, links: list[Array]) -> Array:
        """(M, 3) of the centres of mass of the bodies that move."""
        velocity = np.frombuffer(packed, dtype=np.float32).take(scene.packing.velocity[:, :3]).astype(float)
        if links:
            velocity[scene.layout.links] = links
        return velocity[self._moving]

    def _solve(self, noted: _Noted | None) -> Balance:
        force, doubt = np.zeros((len(self._parent), 3)), np.full(len(self._parent), np.inf)
        if noted is None:
            return Balance(force, doubt)
        moving, mass = self._moving, noted.mass[self._moving]
        before = self._velocities(noted.scene, noted.before, noted.links_before)
        gained = self._velocities(noted.scene, noted.after, noted.scene.left().velocities) - before
        force[moving] = gained * (mass[:, None] / self._world.physics.dt)
        force[moving] -= np.outer(mass * self._weighs[moving], noted.scene.gravity)
        if noted.slowing[:, 0].any():
            force[moving] += self._dragged(noted, before)
        if noted.pushes is not None:
            force[noted.pushes[:, 0].astype(int)] -= noted.pushes[:, 1:4]
        if len(self._links):
            exerted = self._exerted(noted)
            force -= exerted
            np.add.at(force, self._parent[self._links], exerted[self._links])
        doubt[moving] = (noted.friction @ self._doubts)[moving]
        return Balance(force, doubt)

    def _dragged(self, noted: _Noted, before: Array) -> Array:
        """(M, 3) [N] what damping takes: PhysX damps the speed that gravity and pushes have added to already."""
        moving, dt = self._moving, self._world.physics.dt
        pushed = np.zeros((len(self._parent), 3))
        if noted.pushes is not None:
            pushed[noted.pushes[:, 0].astype(int)] = noted.pushes[:, 1:4]
        mass = noted.mass[moving, None]
        pulled = np.divide(pushed[moving], mass, out=np.zeros((len(mass), 3)), where=mass > 0)  # 0 of what is absent
        gained = np.outer(self._weighs[moving], noted.scene.gravity) + pulled
        return noted.slowing[moving, :1] * mass * (before + dt * gained)

    def _exerted(self, noted: _Noted) -> Array:
        """(B, 3) [N] what each link's joint exerts on it."""
        forces, links = np.zeros((len(self._parent), 3)), self._links
        for order, rows in zip(noted.scene.link_order(), noted.scene.left().forces, strict=True):
            forces[order] = rows[:, :3]
        # PhysX gives them in the axes of the joint, in the substep's first pose
        orientation = (
            np.frombuffer(noted.before, dtype=np.float32).take(noted.scene.packing.pose[links, 3:]).astype(float)
        )
        turn = P.multiply(orientation, self._turn[links])
        exerted = np.zeros_like(forces)
        exerted[links] = P.rotate(turn, forces[links])
        return exerted


def _doubts(world: World) -> Array:
    """(J, B): what the dry friction of each joint puts in doubt on each link above it."""
    doubts = np.zeros((len(world.joints), len(world.bodies)))
    for index, joint in enumerate(world.joints):
        body = world.bodies[joint.body].parent
        while body >= 0:
            doubts[index, body] = _DOUBT[joint.type]
            body = world.bodies[body].parent
    return doubts
