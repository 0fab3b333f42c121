"""A touch sensor without taxels: how hard the contacts in a zone of a body press."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import NameLookupError
from anysim.math import pose as P
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import BodyFrame, Frame, SceneView
from anysim_schemas.robot_model import SolidSpec


class TouchZone(Sensor):
    """The sum of the normal forces [N] of a body's contacts that lie in a solid on it, or outwards of which it lies.

    Which is to say that the ray from the contact point along the normal, away from the body, meets the solid: the zone
    of a fingertip may lie before its skin. It is what a `touch` of an MJCF file reads.
    """

    needs: ClassVar[tuple[Capability, ...]] = (Capability.CONTACT_POINTS,)

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        zone: Annotated[SolidSpec, Field(description="the solid, in the frame")],
    ) -> None:
        super().__init__(scene.engine.num_envs)
        if not isinstance(frame, BodyFrame) or frame.index.body < 0:
            raise NameLookupError(f"'{frame.name}' is on no body that moves or stands; touch is felt by one")
        self._scene, self._body, self._frame, self._zone = scene, frame.index.body, frame, zone
        self._place = P.pose(zone.position, P.from_roll_pitch_yaw(np.array(zone.roll_pitch_yaw, dtype=float)))
        self.fields = {"force": SensorField((), "N")}

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        found = self._scene.engine.contacts(env_ids)
        outwards = (found.body_a == self._body).astype(float) - (found.body_b == self._body)
        normal = found.normal * outwards[:, None]
        press = P.dot(found.force, found.normal)
        order = np.argsort(env_ids)
        row = order[np.searchsorted(env_ids, found.env, sorter=order)]
        frames = P.compose(self._frame.pose, self._place)[row]
        start = P.rotate_inverse(frames[:, 3:], found.position - frames[:, :3])
        met = meets(self._zone, start, P.rotate_inverse(frames[:, 3:], normal))
        force = np.zeros(len(env_ids))
        np.add.at(force, row, np.where(met & (outwards != 0) & (press > 0), press, 0.0))
        return {"force": force}


def meets(zone: SolidSpec, start: Array, along: Array) -> Array:
    """(C,) bool: whether rays from points (C, 3) along unit vectors (C, 3) meet the solid, or begin in it."""
    if zone.sphere is not None:
        return _ahead(*_ball(start, along, zone.sphere))
    if zone.box is not None:
        return _ahead(*_slabs(start, along, 0.5 * np.array(zone.box)))
    radius, length = zone.cylinder or zone.capsule or (0.0, 0.0)
    up = np.array([0.0, 0.0, 0.5 * length])
    flat, across = start * [1.0, 1.0, 0.0], along * [1.0, 1.0, 0.0]
    (a, b), (c, d) = _ball(flat, across, radius), _slabs(start[:, 2:], along[:, 2:], up[2:])
    inside = _ahead(np.maximum(a, c), np.minimum(b, d))
    if zone.capsule is None:
        return inside
    return inside | _ahead(*_ball(start - up, along, radius)) | _ahead(*_ball(start + up, along, radius))


def _ahead(enter: Array, leave: Array) -> Array:
    """Whether what a ray is in from one distance to another is anywhere ahead of its start."""
    return (enter <= leave) & (leave >= 0.0)


def _ball(start: Array, along: Array, radius: float) -> tuple[Array, Array]:
    """(C,) twice: between which distances rays are within a radius of the origin; of vectors of any length."""
    a, b, c = P.dot(along, along), P.dot(start, along), P.dot(start, start) - radius**2
    root, still = b * b - a * c, a < 1e-18
    half = np.sqrt(np.maximum(root, 0.0))
    size = np.where(still, 1.0, a)
    never, ever = np.where(c <= 0, -np.inf, np.inf), np.where(c <= 0, np.inf, -np.inf)
    enter = np.where(still, never, np.where(root < 0, np.inf, (-b - half) / size))
    leave = np.where(still, ever, np.where(root < 0, -np.inf, (-b + half) / size))
    return enter, leave


def _slabs(start: Array, along: Array, half: Array) -> tuple[Array, Array]:
    """(C,) twice: between which distances rays are within half edges (K,) of the origin along all of K axes."""
    still = np.abs(along) < 1e-12
    step = np.where(still, 1.0, along)
    ends = np.stack([(-half - start) / step, (half - start) / step])
    within = np.abs(start) <= half
    enter = np.where(still, np.where(within, -np.inf, np.inf), ends.min(axis=0)).max(axis=1)
    leave = np.where(still, np.where(within, np.inf, -np.inf), ends.max(axis=0)).min(axis=1)
    return enter, leave
