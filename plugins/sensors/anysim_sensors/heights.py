"""Height scans: heights of the ground, or of whatever is there, at points beside a robot."""

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, WORLD, Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import HeightFieldShape, MeshShape, Plane, World
from anysim_sensors.scene import SceneGeometry
from anysim_sensors.tables import GeomPoses


class GroundHeights:
    """The planes and height fields that are fixed to the world and collide, as one table for a compiled kernel.

    Each cell is two triangles, cut from its lowest corner to its highest, as in `anysim.conventions`.
    """

    def __init__(self, world: World) -> None:
        """Make the table of a World.

        Raises:
            AnysimError: some ground is a mesh, or not level; `scanned_heights` looks at those.
        """
        from anysim_sensors.kernels.heights import sample

        self._sample = sample
        fields = {field.name: field for field in world.heightfields}
        flat: list[Array] = [np.zeros(0)]
        shapes: list[tuple[int, int]] = []
        places: list[tuple[float, float, float, float, float]] = []
        self._level = -np.inf
        for geom in world.geoms:
            if geom.body != WORLD or not geom.collides:
                continue
            ground = isinstance(geom.shape, Plane | HeightFieldShape)
            mesh = isinstance(geom.shape, MeshShape) and geom.shape.concave
            if mesh or (ground and not _level(geom.quaternion)):
                raise AnysimError(
                    f"the heights of '{geom.name}' stand in no table: it is a mesh, or turned; use scanned_heights"
                )
            match geom.shape:
                case Plane():
                    self._level = max(self._level, geom.position[2])
                case HeightFieldShape(name):
                    heights = np.asarray(fields[name].heights, dtype=float)
                    (rows, cols), (x, y) = heights.shape, fields[name].size
                    flat.append(heights.ravel())
                    shapes.append((rows, cols))
                    corner = (geom.position[0] - x / 2, geom.position[1] - y / 2)
                    places.append((*corner, (cols - 1) / x, (rows - 1) / y, geom.position[2]))
                case _:
                    pass
        self._heights = np.concatenate(flat)
        self._start = np.cumsum([0, *(len(part) for part in flat[1:-1])])[: len(shapes)].astype(np.int64)
        self._shape = np.array(shapes, dtype=np.int64).reshape(-1, 2)
        self._place = np.array(places, dtype=float).reshape(-1, 5)

    def at(self, frames: Array, points: Array) -> Array:
        """Heights (N, R) [m] of the ground, world frame, at points (R, 2) beside poses (N, 7); NaN where there is none.

        The points turn with the heading of the pose.
        """
        frames, points = np.ascontiguousarray(frames, dtype=float), np.ascontiguousarray(points, dtype=float)
        out = np.empty((len(frames), len(points)))
        self._sample(self._heights, self._start, self._shape, self._place, self._level, frames, points, out)
        return out


def scanned_heights(
    scene: SceneGeometry,
    posed: GeomPoses,
    frames: Array,
    points: Array,
    *,
    above: float = 1.0,
    reach: float = 10.0,
    seen: Array | None = None,
    threads: int = 1,
) -> Array:
    """Heights (N, R) [m] of what rays straight down meet first, world frame: the ground, and what stands on it.

    Args:
        scene: the shapes.
        posed: where they are.
        frames: (N, 7) poses, of which position and heading count.
        points: (R, 2) [m] beside them.
        above: [m] over the frames' origins where rays begin; what is higher is not seen.
        reach: [m] the length of the rays; NaN where they meet nothing.
        seen: geoms that count; leave the robot's own bodies out.
        threads: see `SceneGeometry.rays`.
    """
    origins = np.column_stack([points, np.full(len(points), above)])
    down = np.broadcast_to(np.array([0.0, 0.0, -1.0]), origins.shape)
    found = scene.rays(posed, upright(frames), origins, down, reach=reach, seen=seen, threads=threads).distance
    return np.where(np.isfinite(found), frames[:, 2, None] + above - found, np.nan)


def upright(frames: Array) -> Array:
    """Poses (N, 7) at the same places with the same heading, the direction of x from above, and z up."""
    ahead = P.rotate(frames[:, 3:], np.broadcast_to(np.array([1.0, 0.0, 0.0]), (len(frames), 3)))
    half = np.arctan2(ahead[:, 1], ahead[:, 0]) / 2
    still = np.zeros_like(half)
    return np.column_stack([frames[:, :3], still, still, np.sin(half), np.cos(half)])


def _level(quaternion: tuple[float, float, float, float]) -> bool:
    return bool(np.allclose(np.abs(quaternion), IDENTITY_QUATERNION, atol=1e-12))
