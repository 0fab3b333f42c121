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
        points: (N, R, 3) [m] in the sensor's frame, NaN there.
        segmentation: (N, R) int32, ids of entities; 0 for the ground, and where nothing is met.
    """

    distance: Array
    points: Array
    segmentation: Array


def lidar(
    scene: SceneGeometry,
    posed: GeomPoses,
    frames: Array,
    directions: Array,
    *,
    near: float = 0.0,
    far: float = 100.0,
    seen: Array | None = None,
    threads: int = 1,
) -> Scan:
    """A scan with unit directions (R, 3) in the sensor's frame, the sensor at poses (N, 7).

    What is nearer than `near` hides what is behind it. All rays of a scan see the same moment. `seen` is as in
    `SceneGeometry.rays`: leave the sensor's own body out with `scene.without`.
    """
    hits = scene.rays(posed, frames, np.zeros_like(directions), directions, reach=far, seen=seen, threads=threads)
    close = hits.distance < near
    distance = np.where(close, np.inf, hits.distance)
    with np.errstate(invalid="ignore"):
        points = np.where(np.isfinite(distance), distance, np.nan)[..., None] * directions
    return Scan(distance, points, scene.segmentation[np.where(close, -1, hits.geom)])
