"""A force and torque sensor at a wrist: what the link that carries it, and all beyond, do to the rest of the robot."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import NameLookupError
from anysim.math import pose as P
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import BodyFrame, Frame, SceneView
from anysim_sensors.motion.parameters import gravity, parameter


class ForceTorque(Sensor):
    """Force [N] and torque about the frame [N m], in its axes, that pass through the joint before the frame's link.

    They follow from the momentum of what is beyond that joint: its weight, and the contacts that it has with anything
    else, less the change of its momentum. At rest the sensor thus reads the weight; pressed down on a table it reads
    upwards. It reads the same on every engine that has contact points, whatever the engine makes of joints.

    The change of momentum is the average over the period, contacts are those of the last substep: in an impact, the two
    do not belong together. Masses are those of an episode's beginning; `apply_wrench` beyond the joint is not seen.
    """

    needs: ClassVar[tuple[Capability, ...]] = (Capability.CONTACT_POINTS,)

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        on: Annotated[
            Literal["rest", "link"], Field(description="what the force acts on: `link` turns it round")
        ] = "rest",
    ) -> None:
        super().__init__(scene.engine.num_envs)
        world = scene.engine.world
        if not isinstance(frame, BodyFrame) or frame.index.body < 0 or world.bodies[frame.index.body].parent < 0:
            raise NameLookupError(
                f"'{frame.name}' is on nothing that a joint carries; a force and torque sensor sits on a link"
            )
        self._scene, self._frame, self._sign = scene, frame, 1.0 if on == "rest" else -1.0
        self._bodies = np.array(world.carried_by(frame.index.body))
        self._inside = np.zeros(len(world.bodies) + 1, dtype=bool)  # the last is the world, -1
        self._inside[self._bodies] = True
        count = len(self._bodies)
        self._own = {
            "mass": self.remember("mass", count),
            "com": self.remember("com", count, 3),
            "inertia": self.remember("inertia", count, 6),
        }
        self._momentum = self.remember("momentum", 6)
        self.fields = {"force": SensorField((3,), "N", frame.name), "torque": SensorField((3,), "N m", frame.name)}

    def reset(self, env_ids: Array) -> None:
        for key, kept in self._own.items():
            kept[env_ids] = parameter(self._scene.engine, f"body.{key}", env_ids, self._bodies)
        self._momentum[env_ids] = self._moving(env_ids)

    def _centres(self, env_ids: Array) -> tuple[Array, Array]:
        """From the world's origin to the centres of mass, and from the bodies' frames to them (n, K, 3) [m]."""
        pose = self._scene.state.body_pose[env_ids][:, self._bodies]
        arm = P.rotate(pose[..., 3:], self._own["com"][env_ids])
        return pose[..., :3] + arm, arm

    def _moving(self, env_ids: Array) -> Array:
        """Momentum and angular momentum about the world's origin (n, 6) of all that is beyond."""
        state = self._scene.state
        turn, twist = (rows[env_ids][:, self._bodies] for rows in (state.body_pose[..., 3:], state.body_twist))
        mass, (centre, arm), rate = self._own["mass"][env_ids, :, None], self._centres(env_ids), twist[..., 3:]
        momentum = mass * (twist[..., :3] + P.cross(rate, arm))
        moments = self._own["inertia"][env_ids][..., [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
        spin = P.rotate(turn, np.einsum("nkij,nkj->nki", moments, P.rotate_inverse(turn, rate)))
        return np.concatenate([momentum.sum(1), (spin + P.cross(centre, momentum)).sum(1)], axis=1)

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        after, before = self._moving(env_ids), self._momentum[env_ids]
        self._momentum[env_ids] = after
        weight = self._own["mass"][env_ids, :, None] * gravity(self._scene.engine, env_ids)[:, None]
        centre, _ = self._centres(env_ids)
        passed = np.concatenate([weight.sum(1), P.cross(centre, weight).sum(1)], axis=1)
        passed = self._sign * (passed + self._touching(env_ids) - (after - before) / self.period)
        at, turn = self._frame.position, self._frame.quaternion
        torque = passed[:, 3:] - P.cross(at, passed[:, :3])
        return {"force": P.rotate_inverse(turn, passed[:, :3]), "torque": P.rotate_inverse(turn, torque)}

    def _touching(self, env_ids: Array) -> Array:
        """Force, and torque about the world's origin (n, 6), of the contacts with what is not beyond."""
        found = self._scene.engine.contacts(env_ids)
        a, b = self._inside[found.body_a], self._inside[found.body_b]
        force = found.force * (b.astype(float) - a)[:, None]
        rows, place = np.zeros((len(env_ids), 6)), {env: row for row, env in enumerate(env_ids.tolist())}
        row = np.array([place[env] for env in found.env.tolist()], dtype=int)
        np.add.at(rows, row, np.concatenate([force, P.cross(found.position, force)], axis=1))
        return rows
