"""LiDAR: ranges and points of the rays of a pattern, from wherever the sensor is."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_sensors.scene import SceneGeometry
from anysim_sensors.tables import GeomPoses


class Scan(NamedTuple):
    """One scan of N envs.

    Attributes:
        distance: (N, R) [m], inf where nothing is met between near and far.
        geom: (N, R) int32, index among the World's geoms, -1 there.
        segmentation: (N, R) int32, ids of entities; 0 for the ground, and where nothing is met.
        normal: (N, R, 3) as in `Hits`; no rows if it was not asked for.
        directions: (R, 3) or (N, R, 3) unit, of the rays in the sensor's frame.
    """

    distance: Array
    geom: Array
    segmentation: Array
    normal: Array
    directions: Array

    @property
    def points(self) -> Array:
        """(N, R, 3) [m] in the sensor's frame, NaN where nothing is met."""
        return np.where(np.isfinite(self.distance), self.distance, np.nan)[..., None] * self.directions


def lidar(
    scene: SceneGeometry,
    posed: GeomPoses,
    frames: Array,
    directions: Array,
    *,
    near: float = 0.0,
    far: float = 100.0,
    seen: Array | None = None,
    normals: bool = False,
    threads: int = 1,
) -> Scan:
    """A scan with unit directions (R, 3) or (N, R, 3) in the sensor's frame, the sensor at poses (N, 7).

    What is nearer than `near` hides what is behind it. All rays of a scan see the same moment. `seen` is as in
    `SceneGeometry.rays`: leave the sensor's own body out with `scene.without`.
    """
    start = np.zeros_like(directions)
    hits = scene.rays(posed, frames, start, directions, reach=far, seen=seen, normals=normals, threads=threads)
    close = hits.distance < near
    geom = np.where(close, np.int32(-1), hits.geom)
    return Scan(np.where(close, np.inf, hits.distance), geom, scene.segmentation[geom], hits.normal, directions)
