"""Ray depth cameras: images of a pinhole camera from rays, pixel by pixel, and what follows from them.

The ray of a pixel goes through its centre: column u and row v of a W x H image look along ((u + 1/2 - W/2) / f,
(v + 1/2 - H/2) / f, 1) in the optical frame (x right, y down, z ahead), with f = H / (2 tan(fov / 2)). There is no
anti-aliasing.
"""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim_sensors.scene import SceneGeometry
from anysim_sensors.tables import GeomPoses


class Images(NamedTuple):
    """Images of N envs.

    Attributes:
        depth: (N, H, W) float32 [m] along the optical axis, inf where nothing is seen.
        segmentation: (N, H, W) int32 ids of entities, 0 for the ground and where nothing is seen.
        geom: (N, H, W) int32, index among the World's geoms, -1.
        distance: (N, H, W) [m] along the ray.
        normal: (N, H, W, 3) outward, world frame; no rows if it was not asked for.
        whole: (N, ids) int32, the pixels that each entity would have with nothing in front of it; no rows if it was not
            asked for.
    """

    depth: Array
    segmentation: Array
    geom: Array
    distance: Array
    normal: Array
    whole: Array


class Motion(NamedTuple):
    """How pixels of N envs have moved since an earlier moment.

    Attributes:
        flow: (N, H, W, 2) float32 [pixels] columns and rows; NaN where nothing is seen; no rows if not asked for.
        appeared: (N, H, W) bool where what is seen was not seen before: it was out of the image, or something hid it;
            no rows if it was not asked for.
    """

    flow: Array
    appeared: Array


class EntityPixels(NamedTuple):
    """Entities in images, by segmentation id.

    Attributes:
        box: (N, ids, 4) int32 first column and row and those after the last; zeros where it is not seen.
        visible: (N, ids) int32, its pixels; those of the ground have the id 0, and those where nothing is seen.
        occlusion: (N, ids) which part of it is hidden by other things, 0 to 1; NaN for the ground, and for what would
            not be in the image.
    """

    box: Array
    visible: Array
    occlusion: Array


class RayCamera:
    """A pinhole camera of a size and fields of view; it draws what is in front of it wherever it is.

    Attributes:
        width, height: of the image [pixels].
        near, far: [m] along the optical axis; what is nearer hides what is behind it.
        focal: (1,) or (N,) [pixels].
        directions: (1 or N, R, 3) unit, of the pixels row by row, in the optical frame.
    """

    def __init__(self, width: int, height: int, fov: ArrayLike, near: float = 0.01, far: float = inf) -> None:
        """`fov` is the vertical field of view [degrees], one for all envs or (N,)."""
        from anysim_sensors.kernels import images, motion, pinhole

        self._kernels, self._view, self._follow = images, pinhole.view, motion.follow
        self.width, self.height, self.near, self.far = width, height, near, far
        self.focal = height / (2 * np.tan(np.radians(np.atleast_1d(np.asarray(fov, dtype=float))) / 2))
        x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
        f = self.focal[:, None]
        along = np.stack([x.ravel() / f, y.ravel() / f, np.ones((len(self.focal), x.size))], axis=-1)
        self.directions = along / np.linalg.norm(along, axis=-1, keepdims=True)
        x, y, z = np.moveaxis(self.directions, -1, 0)
        self._lines = np.ascontiguousarray(
            np.stack([x, y, z], axis=1) * (1.0 / np.sqrt(x * x + y * y + z * z))[:, None]
        )
        self._reach = far / float(self.directions[..., 2].min())

    def images(
        self,
        scene: SceneGeometry,
        posed: GeomPoses,
        frames: Array,
        *,
        seen: Array | None = None,
        normals: bool = False,
        whole: bool = False,
    ) -> Images:
        """What the camera sees from poses (N, 7) of its optical frame.

        Args:
            scene: the shapes.
            posed: where they are.
            frames: (N, 7).
            seen: (G,) bool, geoms that count; see `SceneGeometry.without`.
            normals: whether normals are computed.
            whole: whether pixels are counted that are hidden by other things, for `entities`.
        """
        envs, rows = len(frames), self.directions.shape[1]
        distance, number = np.empty((envs, rows)), np.empty((envs, rows), dtype=np.int32)
        normal = np.empty((envs if normals else 0, rows, 3))
        area = np.empty((envs if whole else 0, len(scene.world.entities) + 1), dtype=np.int32)
        self._view(
            scene.geoms,
            scene.triangles,
            posed,
            scene.all if seen is None else seen,
            np.ascontiguousarray(frames, dtype=float),
            self.directions,
            self._lines,
            self.focal,
            self.width,
            self._reach,
            float(self.far),
            distance,
            number,
            normal,
            area,
        )
        depth, ids = np.empty((envs, rows), dtype=np.float32), np.empty((envs, rows), dtype=np.int32)
        self._kernels.draw(distance, number, self.directions, self.near, self.far, scene.segmentation, depth, ids)
        shape = (envs, self.height, self.width)
        return Images(
            depth.reshape(shape),
            ids.reshape(shape),
            number.reshape(shape),
            distance.reshape(shape),
            normal.reshape(-1, *shape[1:], 3),
            np.roll(area, 1, axis=1),
        )

    def points(self, images: Images, frames: Array) -> Array:
        """(N, H, W, 3) float32 [m] what is seen at each pixel, world frame; NaN where nothing is."""
        distance, number = self._flat(images)
        points = np.empty((*images.distance.shape, 3), dtype=np.float32)
        self._kernels.locate(distance, number, self.directions, frames, points.reshape(len(points), -1, 3))
        return points

    def motion(
        self,
        scene: SceneGeometry,
        images: Images,
        frames: Array,
        posed: GeomPoses,
        frames_before: Array,
        before: GeomPoses,
        *,
        seen: Array | None = None,
        flow: bool = True,
        appeared: bool = True,
    ) -> Motion:
        """How what is seen has moved in the image since before; `seen` is as of `images`.

        It follows each geom and the camera, and is exact: no image is compared. Rays from where the camera was decide
        what has appeared, exact but for surfaces that are nearer to each other than a tenth of a millimetre.
        """
        envs, rows = len(frames), self.directions.shape[1]
        moved = np.empty((envs if flow else 0, rows, 2), dtype=np.float32)
        new = np.empty((envs if appeared else 0, rows), dtype=bool)
        self._follow(
            scene.geoms,
            scene.triangles,
            posed,
            before,
            scene.all if seen is None else seen,
            scene.row,
            *(np.ascontiguousarray(places, dtype=float) for places in (frames, frames_before)),
            self.directions,
            images.distance.reshape(envs, -1),
            images.geom.reshape(envs, -1),
            self.focal,
            self.width,
            float(self.near),
            float(self.far),
            moved,
            new,
        )
        shape = images.depth.shape[1:]
        return Motion(moved.reshape(-1, *shape, 2), new.reshape(-1, *shape))

    def entities(self, images: Images) -> EntityPixels:
        """Boxes around what is seen of each entity, and how much of it is hidden, of images with `whole` areas.

        Raises:
            AnysimError: the images have none.
        """
        if len(images.whole) != len(images.depth):
            raise AnysimError("these images do not count what is hidden; draw them with whole=True")
        envs, count = images.whole.shape
        box, area = np.empty((envs, count, 4), dtype=np.int32), np.empty((envs, count), dtype=np.int32)
        self._kernels.surround(images.segmentation.reshape(envs, -1), self.width, box, area)
        hidden = np.full((envs, count), np.nan)
        np.divide(images.whole - area, images.whole, out=hidden, where=images.whole > 0)
        hidden[:, 0] = np.nan
        return EntityPixels(box, area, hidden)

    @staticmethod
    def _flat(images: Images) -> tuple[Array, Array]:
        envs = len(images.distance)
        return images.distance.reshape(envs, -1), images.geom.reshape(envs, -1)
