"""The base of tactile sensors: where taxels are, what touches them, and what they carry of it."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import NameLookupError
from anysim.math import pose as P
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import BodyFrame, Frame, SceneView
from anysim_sensors.sight.eye import Eye
from anysim_sensors.tables import GeomPoses
from anysim_tactile.felt import Felt, bumps, felt
from anysim_tactile.skin import Load, Skin
from anysim_tactile.surfaces import Length, Surface

Source = Literal["rays", "distance", "contacts"]
Vector = tuple[float, float, float]

STIFFNESS = 5e7
"""[Pa/m], as of 4 mm of a gel of 0.2 MPa. A parameter, not a measurement: it spreads forces, and makes none."""
BLUNT = 0.005
"""[m] the radius of what a contact point stands for, at least; of wide grids twice their pitch."""


EXACT = 1e-9
"""Of a moment: what counts as nothing."""


class Touch(NamedTuple):
    """One reading of n envs before it is made into fields.

    Attributes:
        frames: (n, 7) of the sensor. points: the contacts. posed: where geoms are; None where contacts alone count.
        gap: (n, T) [m]. short: (n,) bool, where it was too little, and contact points helped.
        carried: by the taxels.
    """

    frames: Array
    points: Felt
    posed: GeomPoses | None
    gap: Array
    short: Array
    carried: Load


class Tactile(Sensor):
    """Taxels on a body, with the parameters of all forms.

    The engine says what force and moment the body's contacts at the taxels have; geometry says how it is spread. What
    touches is pressed on virtually until taxels of the given stiffness would carry that: rigid bodies hardly enter each
    other, and by how much differs between engines. Tangential force goes with pressure. Sums of the taxels' forces and
    moments are the engine's but for `moment_error`, where they could carry it only by pulling. Where geometry has too
    little over the taxels for that, as with few of them, the contact points count too.
    """

    needs: ClassVar[tuple[Capability, ...]] = (Capability.CONTACT_POINTS,)

    def __init__(
        self,
        scene: SceneView,
        surface: Surface,
        *,
        frame: Frame,
        at: Annotated[Vector, Field(description="of the sensor's own frame in `frame` [m]")] = (0.0, 0.0, 0.0),
        turn: Annotated[Vector, Field(description="its roll, pitch and yaw there [rad]")] = (0.0, 0.0, 0.0),
        source: Annotated[Source, Field(description="what says how near things are: see the page on touch")] = "rays",
        stiffness: Annotated[Length, Field(description="of the skin, pressure over depth [Pa/m]")] = STIFFNESS,
        thickness: Annotated[Length, Field(description="of the skin [m]: rays begin so deep")] = 0.004,
        reach: Annotated[
            Length | None,
            Field(description="how far from a taxel a contact is felt [m]; 2 mm or 1.5 pitches if not given"),
        ] = None,
    ) -> None:
        super().__init__(scene.engine.num_envs)
        if not isinstance(frame, BodyFrame) or frame.index.body < 0:
            raise NameLookupError(f"'{frame.name}' is on no body that moves or stands; taxels are on one")
        self._scene, self._body = scene, frame.index.body
        self._eye = Eye(scene, frame, "collision", "body", at, turn)
        self._source, self._thickness = source, thickness
        self._reach = max(0.002, 1.5 * surface.pitch) if reach is None else reach
        self._blunt = max(BLUNT, 2 * surface.pitch)
        self._skin, self._surface = Skin(surface, stiffness), surface
        axes = frame.name if at == turn == (0.0, 0.0, 0.0) else f"{frame.name}, at {at} turned by {turn}"
        shape = surface.shape
        self.fields: dict[str, SensorField] = {
            "depth": SensorField(shape, "m"),
            "pressure": SensorField(shape, "Pa"),
            "shear": SensorField((*shape, 2), "N", "tangents of each taxel: along the columns, along the rows"),
            "force": SensorField((3,), "N", axes),
            "moment": SensorField((3,), "N m", axes),
            "moment_error": SensorField((), "N m"),
        }

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        return self._told(self._touched(env_ids))

    def _touched(self, env_ids: Array) -> Touch:
        frames = self._eye.poses
        points = felt(self._scene.engine, env_ids, self._body, frames, self._surface, self._reach)
        posed = None if self._source == "contacts" else self._eye.posed
        gap = self._gap(frames, posed, points, self._surface)
        carried = self._skin.carry(gap, points.pushes, points.wrench)
        missed = self._missed(points, carried)
        short = missed > EXACT
        if short.any():
            close = np.minimum(gap, bumps(points, self._surface, self._blunt))
            again = self._skin.carry(close, points.pushes, points.wrench)
            short &= self._missed(points, again) < 0.5 * missed
            for before, after in zip(carried, again, strict=True):
                before[short] = after[short]
        return Touch(frames, points, posed, gap, short, carried)

    def _missed(self, points: Felt, carried: Load) -> Array:
        """(n,) which part of the contacts' moment taxels do not carry; inf where a force presses none of them."""
        moment = P.norm(points.wrench[:, 3:] - carried.total[:, 3:])
        size = P.norm(points.wrench[:, 3:]) + self._surface.pitch * P.norm(points.wrench[:, :3])
        part = np.divide(moment, size, out=np.zeros_like(moment), where=size > 0)
        return np.where((size > 0) & (carried.deep.max(axis=1) <= 0), np.inf, part)

    def _gap(self, frames: Array, posed: GeomPoses | None, points: Felt, surface: Surface) -> Array:
        """(n, T) [m] between taxels and what is over them, negative where they are in it, inf where it is far."""
        if posed is None:
            return bumps(points, surface, self._blunt)
        eye, far = self._eye, max(self._thickness, self._reach)
        if self._source == "distance":
            return eye.geometry.distances(posed, frames, surface.points, reach=far, seen=eye.seen).distance
        back = surface.points - self._thickness * surface.normals
        reach = self._thickness + far
        met = eye.geometry.rays(posed, frames, back, surface.normals, reach=reach, seen=eye.seen)
        return met.distance - self._thickness

    def _told(self, touch: Touch) -> dict[str, Array]:
        surface, force = self._surface, touch.carried.force
        shape, total = (len(force), *surface.shape), touch.carried.total
        shear = np.stack([P.dot(force, surface.right[None]), P.dot(force, surface.up[None])], axis=-1)
        return {
            "depth": np.maximum(0.0, -touch.gap).reshape(shape),
            "pressure": (-P.dot(force, surface.normals[None]) / surface.area).reshape(shape),
            "shear": shear.reshape(*shape, 2),
            "force": total[:, :3],
            "moment": total[:, 3:],
            "moment_error": P.norm(touch.points.wrench[:, 3:] - total[:, 3:]),
        }
