"""Terms of cameras that fly: what is in the middle of an image, how much of it is seen, and from how many sides."""

from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.scene import Frame, ObjectView, SceneView

Eye = Annotated[str, Field(description="of world.cameras")]
Within = Annotated[float, Field(gt=0, le=1, description="of half the image, from its middle")]
_BINS = 120
"""Directions that a scan keeps apart: 3 degrees each."""


def _off(scene: SceneView, camera: str, frame: Frame) -> Array:
    """(n,) how far from the middle of an image a frame's origin is, in halves of the image; inf behind the camera."""
    view, lens = scene.engine.camera_view(camera, scene.env_ids), scene.engine.world.cameras[scene.index.camera(camera)]
    seen = P.rotate_inverse(view.pose[:, 3:], frame.position - view.pose[:, :3])
    half = np.tan(np.radians(view.fov) / 2) * np.maximum(seen[:, 2], 1e-9)
    off = np.maximum(np.abs(seen[:, 0]) * lens.height / lens.width, np.abs(seen[:, 1])) / half
    return np.where((seen[:, 2] > lens.near) & frame.present, off, np.inf)


def off_axis(scene: SceneView, *, camera: Eye, frame: Frame) -> Array:
    """Angle between the optical axis of a camera and the direction to a frame [rad]."""
    pose = scene.engine.camera_view(camera, scene.env_ids).pose
    seen = P.rotate_inverse(pose[:, 3:], frame.position - pose[:, :3])
    return np.arctan2(P.norm(seen[:, :2]), seen[:, 2])


def centred(scene: SceneView, *, camera: Eye, frame: Frame, within: Within = 0.1) -> Array:
    """A frame's origin is in the middle of a camera's image, whether something hides it or not."""
    return _off(scene, camera, frame) <= within


def at_distance(
    scene: SceneView,
    *,
    a: Frame,
    b: Frame,
    distance: Annotated[float, Field(gt=0, description="[m]")],
    tolerance: Annotated[float, Field(gt=0, description="[m]")] = 0.1,
) -> Array:
    """The origins of two frames are so far apart."""
    return np.abs(P.norm(a.position - b.position) - distance) <= tolerance


class Unhidden:
    """Of the sides of an object that face a camera, at least a share is not hidden by another one, or by two.

    The object and what may hide it count as the boxes around them, in their own axes; rays to points on the object's
    box are followed from the eye.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        camera: Eye,
        object: ObjectView,
        behind: ObjectView,
        also: ObjectView | None = None,
        share: Annotated[float, Field(gt=0, le=1)] = 0.6,
    ) -> None:
        self._scene, self._camera, self._share = scene, camera, share
        self._object, self._others = object, [(one, *self._box(one)) for one in (behind, also) if one is not None]
        low, high = self._box(object)
        grid, points, normals = (np.arange(7) + 0.5) / 7, list[Array](), list[Array]()
        for axis in range(3):
            for side in (0.0, 1.0):
                where = np.stack(np.meshgrid(grid, grid, [side], indexing="ij"), axis=-1).reshape(-1, 3)
                points.append(low + np.roll(where, axis + 1, axis=1) * (high - low))
                normals.append(np.tile((2 * side - 1) * np.eye(3)[axis], (len(where), 1)))
        self._points, self._normals = np.concatenate(points), np.concatenate(normals)
        self._areas = np.repeat(np.prod(high - low) / (high - low), 2 * len(grid) ** 2)

    def _box(self, thing: ObjectView) -> tuple[Array, Array]:
        low, high = self._scene.entity_shape(thing.entity.name).bounds(np.array([0.0, 0, 0, 0, 0, 0, 1]))
        return low, high

    def seen(self) -> Array:
        """(n,) the share of what faces the eye that is not hidden, by the solid angle of it."""
        scene, root = self._scene, self._object.root.pose
        eye = scene.engine.camera_view(self._camera, scene.env_ids).pose[:, :3]
        shape = (len(root), *self._points.shape)
        turn = np.broadcast_to(root[:, None, 3:], (*shape[:2], 4))
        points = root[:, None, :3] + P.rotate(turn, np.broadcast_to(self._points, shape))
        way = points - eye[:, None]
        facing = -P.dot(P.rotate(turn, np.broadcast_to(self._normals, shape)), way)
        weight = np.maximum(facing, 0.0) * self._areas / np.maximum(P.norm(way), 1e-9) ** 3
        hidden = np.zeros(shape[:2], dtype=bool)
        for other, low, high in self._others:
            pose = other.root.pose
            local = np.broadcast_to(pose[:, None, 3:], (*shape[:2], 4))
            start = P.rotate_inverse(pose[:, 3:], eye - pose[:, :3])[:, None]
            step = P.rotate_inverse(local, way)
            with np.errstate(divide="ignore", invalid="ignore"):
                first, last = (low - start) / step, (high - start) / step
            enters, leaves = np.fmin(first, last).max(axis=2), np.fmax(first, last).min(axis=2)
            hidden |= (enters <= leaves) & (leaves > 0.0) & (enters < 1.0 - 1e-9) & other.present[:, None]
        return (weight * ~hidden).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12)

    def __call__(self) -> Array:
        return (self.seen() >= self._share) & self._object.present


class Scan:
    """Directions from an object to views of it so far: slow ones, with it in the middle, not too far away."""

    def __init__(
        self,
        scene: SceneView,
        *,
        camera: Eye,
        frame: Frame,
        views: Annotated[int, Field(ge=2, description="all around")] = 8,
        within: Within = 0.1,
        speed: Annotated[float, Field(gt=0, description="[m/s] of the camera's carrier")] = 0.1,
        carrier: Frame,
        farthest: Annotated[float, Field(gt=0, description="[m]")] = 1.5,
    ) -> None:
        self._scene, self._camera, self._frame, self._carrier = scene, camera, frame, carrier
        self._views, self._within, self._speed, self._farthest = views, within, speed, farthest
        self._update = scene.memory(_BINS + 1)  # which directions have been seen from, and the gain of this step

    def taken(self) -> tuple[Array, Array]:
        """(n, 120) bool directions of views, and (n,) what this step's is worth: 1 at most over a whole scan."""
        now = self._update(self._look)
        return now[:, :-1] > 0, now[:, -1]

    def widest(self) -> Array:
        """(n,) [rad] the widest gap between neighbouring views; a whole turn where there is one or none."""
        gaps = np.zeros(len(self._scene.env_ids))
        for row, seen in enumerate(self.taken()[0]):
            places = np.flatnonzero(seen)
            gaps[row] = np.diff(places, append=places[0] + _BINS).max() if len(places) else _BINS
        return gaps * 2 * np.pi / _BINS

    def _look(self, before: Array, first: Array) -> Array:
        del first
        way = self._scene.engine.camera_view(self._camera, self._scene.env_ids).pose[:, :3] - self._frame.position
        good = _off(self._scene, self._camera, self._frame) <= self._within
        good &= (P.norm(self._carrier.twist[:, :3]) <= self._speed) & (P.norm(way) <= self._farthest)
        place = np.floor((np.arctan2(way[:, 1], way[:, 0]) / (2 * np.pi) % 1.0) * _BINS).astype(int) % _BINS
        after = before.copy()
        rows = np.flatnonzero(good)
        sector = _BINS / self._views
        fresh = [
            not before[r, :-1][np.floor(np.arange(_BINS) / sector) == np.floor(place[r] / sector)].any() for r in rows
        ]
        after[:, -1] = 0.0
        after[rows, -1] = np.array(fresh, dtype=float) / self._views
        after[rows, place[rows]] = 1.0
        return after


class Scanned(Scan):
    """An object has been seen from all around: no gap between views is wider than that of `views` even ones, and 0.1.

    A view counts while the carrier of the camera is slower than `speed` and the object is in the middle of the image.
    """

    def __call__(self) -> Array:
        return self.widest() <= 2 * np.pi / self._views + 0.1


@at_most(0.5)
class ScanGain(Scan):
    """Share of the sectors around an object of which this control step has the first view, as `scanned` counts them."""

    def __call__(self) -> Array:
        return self.taken()[1]


class KeptCentred:
    """A frame has been in the middle of a camera's image for a share of some steps: known once they are over."""

    def __init__(
        self,
        scene: SceneView,
        *,
        camera: Eye,
        frame: Frame,
        within: Within = 0.15,
        share: Annotated[float, Field(gt=0, le=1)] = 0.9,
        after: Annotated[int, Field(ge=0, description="control steps before it counts")] = 50,
        steps: Annotated[int, Field(ge=1, description="control steps that count")] = 300,
    ) -> None:
        self._scene, self._camera, self._frame, self._within = scene, camera, frame, within
        self._share, self._after, self._steps = share, after, steps
        self._update = scene.memory()

    def __call__(self) -> Array:
        scene = self._scene
        counts = scene.elapsed[scene.rows] > self._after
        good = _off(scene, self._camera, self._frame) <= self._within

        def add(before: Array, first: Array) -> Array:
            del first
            return before + (good & counts)[:, None]

        kept = self._update(add)[:, 0]
        return (scene.elapsed[scene.rows] >= self._after + self._steps) & (kept >= self._share * self._steps)


TERMS: dict[str, dict[str, Any]] = {
    "reward": {"off_axis": off_axis, "scan_gain": ScanGain},
    "predicate": {
        "at_distance": at_distance,
        "centred": centred,
        "kept": KeptCentred,
        "scanned": Scanned,
        "unhidden": Unhidden,
    },
}
