"""An honest limited engine: spheres that fall on a plane, bounce, slide and roll. No joints, no pictures, nothing else.

It declares what it does and refuses the worlds that it cannot run, so the contract suite is green, with skips.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.control import Control
from anysim.engine.state import Availability, SnapshotLevel
from anysim.math import pose as P
from anysim.model.pairs import may_meet, pair_friction, pair_restitution
from anysim.model.world import BodyKind, Plane, Sphere, World

SLOWEST = 0.05
"""[m/s] below which a sphere does not bounce any more."""


class MarbleEngine(SimEngine):
    """Spheres of even density on horizontal planes."""

    name: ClassVar[str] = "marbles"
    capabilities: ClassVar[Capabilities] = Capabilities.of(
        Capability.RIGID_BODIES,
        Capability.CONTACTS_STATIC,
        Capability.TERRAIN_PLANE,
        Capability.RESTITUTION,
        Capability.SNAPSHOT_STATE,
        Capability.SNAPSHOT_TRAJECTORY,
        Capability.DYNAMICS,
    )

    @classmethod
    def availability(cls) -> Availability:
        """Numpy is all it needs."""
        return Availability(True, "1.0")

    @classmethod
    def refusals(cls, world: World, options: object) -> Sequence[str]:
        """What is no sphere, and ground that is not level."""
        reasons: list[str] = []
        for body in world.bodies:
            moments = body.inertial.inertia
            even = np.ptp(moments[:3]) < 1e-9 and not np.any(moments[3:]) and not np.any(body.inertial.com)
            if body.kind is BodyKind.FREE and not even:
                reasons.append(f"body '{body.name}' is no sphere of even density")
        for geom in world.geoms:
            if geom.collides and geom.body >= 0 and not isinstance(geom.shape, Sphere):
                reasons.append(f"geom '{geom.name}' is no sphere")
            elif geom.collides and geom.body >= 0 and world.bodies[geom.body].kind is not BodyKind.FREE:
                reasons.append(f"geom '{geom.name}' is fixed, and no plane")
            elif geom.collides and isinstance(geom.shape, Plane) and (any(geom.position) or any(geom.quaternion[:3])):
                reasons.append(f"plane '{geom.name}' is not level at z = 0")
        if world.physics.gravity[0] or world.physics.gravity[1] or world.physics.gravity[2] > 0:
            reasons.append("gravity does not point down")
        return reasons

    def _build(self, world: World, num_envs: int) -> None:
        count = len(world.bodies)
        self._falls = np.array([body.kind is BodyKind.FREE for body in world.bodies], dtype=bool)
        self._mass = np.array([body.inertial.mass or 1.0 for body in world.bodies])
        self._radius = np.full(count, -np.inf)  # what does not collide never reaches the ground
        self._friction, self._bounce = np.zeros(count), np.zeros(count)
        planes = [geom for geom in world.geoms if geom.collides and isinstance(geom.shape, Plane)]
        meet = may_meet(world, np.array([-1, *range(count)]))[0, 1:]
        for geom in world.geoms:
            if planes and geom.collides and isinstance(geom.shape, Sphere) and meet[geom.body]:
                pair = [geom.surface, planes[0].surface]
                rule = pair_friction(np.array([s.friction for s in pair]), np.array([s.priority for s in pair]))
                self._radius[geom.body], self._friction[geom.body] = geom.shape.radius, rule[0, 1]
                self._bounce[geom.body] = pair_restitution(np.array([s.restitution for s in pair]))[0, 1]
        self._pose, self._twist = np.zeros((num_envs, count, 7)), np.zeros((num_envs, count, 6))

    def _free(self) -> None:
        del self._pose, self._twist

    def _reset(self, ids: Array) -> None:
        self._pose[ids], self._twist[ids] = self.world.initial_body_pose, 0.0

    def _step(self, n_steps: int, ids: Array | None) -> None:
        rows = self._all if ids is None else ids
        with np.errstate(all="ignore"):
            for _ in range(n_steps):
                self._advance(rows, self.world.physics.dt)

    def _advance(self, rows: Array, dt: float) -> None:
        pose, twist = self._pose[rows], self._twist[rows]
        before = twist[..., 2].copy()
        twist[..., :3] += np.where(self._falls[:, None], dt * np.array(self.world.physics.gravity), 0.0)
        low = self._falls & (pose[..., 2] + dt * twist[..., 2] <= self._radius)
        up = np.where(before < -SLOWEST, -self._bounce * before, 0.0)
        push = np.where(low, np.maximum(up, (self._radius - pose[..., 2]) / dt * (up == 0.0)) - twist[..., 2], 0.0)
        push = np.where(low & np.isfinite(push), np.maximum(push, 0.0), 0.0)
        twist[..., 2] += push
        # the point that touches: friction stops it, by at most its coefficient times the push; a sphere has 2/5 m r^2
        reach = np.where(np.isfinite(self._radius), self._radius, 0.0)
        slip = np.stack([twist[..., 0] - reach * twist[..., 4], twist[..., 1] + reach * twist[..., 3]], axis=-1)
        size = np.sqrt((slip**2).sum(axis=-1))
        stop = np.minimum(size * 2.0 / 7.0, self._friction * push) / np.where(size == 0.0, 1.0, size)
        take = slip * stop[..., None]
        twist[..., :2] -= take
        turn = 2.5 / np.where(reach == 0.0, 1.0, reach)
        twist[..., 3] -= turn * take[..., 1]
        twist[..., 4] += turn * take[..., 0]
        rate = P.norm(twist[..., 3:])
        axis = twist[..., 3:] / np.where(rate == 0.0, 1.0, rate)[..., None]
        turned = P.normalize(P.multiply(P.from_axis_angle(axis, rate * dt), pose[..., 3:]))
        moving = (twist != 0.0).any(axis=-1)[..., None]
        moved = np.concatenate([pose[..., :3] + dt * twist[..., :3], turned], axis=-1)
        self._pose[rows], self._twist[rows] = np.where(moving, moved, pose), twist

    def _read(self, name: str) -> Array:
        if name in ("body_pose", "body_twist"):
            return (self._pose if name == "body_pose" else self._twist).copy()
        if name == "fault":
            state = np.concatenate([self._pose, self._twist], axis=-1)
            return np.asarray(~np.isfinite(state).all(axis=(1, 2)))
        return np.zeros((self.num_envs, 0, 3) if name == "contact_force" else (self.num_envs, 0))

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        pass  # there are none

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        if pose is not None:
            self._pose[np.ix_(ids, bodies)] = pose
        if twist is not None:
            self._twist[np.ix_(ids, bodies)] = twist

    def _apply_control(self, control: Control) -> None:
        pass  # there are no drives

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return {"pose": self._pose[ids], "twist": self._twist[ids]}

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._pose[ids], self._twist[ids] = data["pose"], data["twist"]
