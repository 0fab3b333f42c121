"""Channels that follow from depth, segmentation and poses, whether an engine drew them or rays did."""

from typing import TYPE_CHECKING

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_sensors.tables import GeomPoses

if TYPE_CHECKING:
    from anysim_annotation.view import View

APART = 0.005
"""[m] Where an engine's depth and that of rays differ by more, the rays may have met another link."""
AROUND = 0.9
"""[px] How near a pixel is to a point to show it; a whole pixel away it shows something else."""
HIDDEN = (0.001, 0.002)
"""[m], and share of the distance, by which what is seen at a place must be nearer to hide something there."""


def points(view: "View") -> Array:
    """(E, H, W, 3) float32 [m] of the world."""
    local = view.local
    seen = np.isfinite(view.channel("depth"))
    found = np.full(local.shape, np.nan, dtype=np.float32)
    for row, pose in enumerate(view.pose):
        at = seen[row]
        here = local[row][at]
        found[row][at] = pose[:3] + P.rotate(np.broadcast_to(pose[3:], (len(here), 4)), here)
    return found


# ---------------------------------------------------------------------- normals


def normals(view: "View") -> Array:
    """(E, H, W, 3) float32, outward, world frame: exact by rays, else from differences of depth."""
    if view.scene.source == "geometry":
        exact = view.traced.normal
        return np.where((view.traced.geom >= 0)[..., None], exact, np.nan).astype(np.float32)
    local, ids = view.local, view.channel("segmentation")
    with np.errstate(divide="ignore"):
        inverse = 1.0 / view.channel("depth").astype(float)
    across, down = _difference(local, inverse, ids, 2), _difference(local, inverse, ids, 1)
    normal = np.cross(across, down)
    with np.errstate(invalid="ignore"):
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        normal = np.where((normal * local).sum(axis=-1, keepdims=True) > 0, -normal, normal)
    turn = view.pose[:, None, None, 3:]
    return P.rotate(np.broadcast_to(turn, (*normal.shape[:3], 4)), normal).astype(np.float32)


def _difference(local: Array, inverse: Array, ids: Array, axis: int) -> Array:
    """Differences (E, H, W, 3) along an axis of the image to one neighbour of the same thing, NaN where there is none.

    Of two neighbours it is the one on whose side inverse depth is more nearly linear, as it is along a plane: the other
    may be beyond an edge.
    """
    sides: list[tuple[Array, Array]] = []
    for sign in (1, -1):
        one, two = _moved(ids, axis, sign, -1), _moved(ids, axis, 2 * sign, -1)
        near, far = _moved(inverse, axis, sign, 0.0), _moved(inverse, axis, 2 * sign, 0.0)
        good = (one == ids) & (near > 0) & (inverse > 0)
        bend = np.where((two == ids) & (far > 0), np.abs(inverse - 2 * near + far), 1e6)
        with np.errstate(invalid="ignore"):
            step = sign * (_moved(local, axis, sign, np.nan) - local)
        sides.append((np.where(good, bend, np.inf), np.where(good[..., None], step, np.nan)))
    (ahead, forth), (behind, back) = sides
    return np.where((ahead <= behind)[..., None], forth, back)


def _moved(image: Array, axis: int, by: int, blank: float) -> Array:
    """The image with the neighbour `by` pixels further along an axis in each pixel's place."""
    found = np.full_like(image, blank)
    there, here = [slice(None)] * image.ndim, [slice(None)] * image.ndim
    there[axis], here[axis] = (slice(by, None), slice(None, -by)) if by > 0 else (slice(None, by), slice(-by, None))
    found[tuple(here)] = image[tuple(there)]
    return found


# ---------------------------------------------------------------------- motion


def bodies(view: "View") -> Array:
    """(E, H, W) int32, the body seen at each pixel, -1 for the world and for nothing.

    An engine tells things apart and not their links, so rays say which link of the thing it is; where they meet another
    thing, or the same elsewhere, it is the link that is nearest to the point.
    """
    scene, traced = view.scene, view.traced
    geometry = scene.geometry
    found = geometry.body[traced.geom].astype(np.int32)
    if scene.source == "geometry":
        return found
    ids, depth = view.channel("segmentation"), view.channel("depth")
    with np.errstate(invalid="ignore"):
        doubtful = (ids != traced.segmentation) | (np.abs(depth - traced.depth) > APART)
    for number in np.unique(ids[doubtful]).tolist():
        where = doubtful & (ids == number)
        if number == 0:
            found[where] = -1
            continue
        entity = scene.world.entities[number - 1]
        if entity.body_stop - entity.body_start == 1:
            found[where] = entity.root
            continue
        posed = geometry.posed(view.body_pose, view.present)
        own = geometry.on(range(entity.body_start, entity.body_stop))
        for row in np.flatnonzero(where.any(axis=(1, 2))).tolist():
            alone = GeomPoses(*(rows[row : row + 1] for rows in posed))
            points = view.local[row][where[row]]
            near = geometry.distances(alone, view.pose[row : row + 1], points, seen=own)
            found[row][where[row]] = geometry.body[near.geom[0]]
    return found


def moved(view: "View") -> tuple[Array, Array]:
    """Flow (E, H, W, 2) float32 [px] since the view before, and what was not to be seen then (E, H, W) bool."""
    height, width = view.scene.height, view.scene.width
    flow = np.full((len(view), height, width, 2), np.nan, dtype=np.float32)
    occluded = np.ones((len(view), height, width), dtype=bool)
    if view.before is None:
        return flow, occluded
    old, rows = view.before
    for row in np.flatnonzero(rows >= 0).tolist():
        seen = np.isfinite(view.channel("depth")[row])
        if not seen.any():
            continue
        there = int(rows[row])
        body = view.bodies[row][seen]
        pose = np.broadcast_to(view.pose[row], (len(body), 7))
        place = P.compose(pose, _as_poses(view.local[row][seen]))[:, :3]
        came = P.compose(old.body_pose[there], P.inverse(view.body_pose[row]))
        came = np.concatenate([came, [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]])[body]
        was = P.compose(came, _as_poses(place))[:, :3]
        then = old.row(there).project(was[None])
        v, u = np.nonzero(seen)
        flow[row][seen] = np.column_stack([u + 0.5, v + 0.5]) - then.pixel[0]
        thing = view.channel("segmentation")[row][seen]
        hidden = ~_visible(old, there, then.pixel[0], then.depth[0], thing)
        occluded[row][seen] = hidden | ~then.inside[0]
    return flow, occluded


def _as_poses(places: Array) -> Array:
    return np.concatenate([places, np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(places), 4))], axis=-1)


def _visible(view: "View", row: int, pixel: Array, depth: Array, thing: Array) -> Array:
    """(K,) bool: whether points at pixels (K, 2) and depths (K,) of things (K,) are seen in a pixel around."""
    ids, seen = view.channel("segmentation")[row], view.channel("depth")[row]
    exact = np.nan_to_num(pixel, nan=-2.0) - 0.5
    low = np.floor(exact)
    room = HIDDEN[0] + HIDDEN[1] * depth
    found = np.zeros(len(pixel), dtype=bool)
    for right, under in ((0, 0), (1, 0), (0, 1), (1, 1)):
        u, v = low[:, 0] + right, low[:, 1] + under
        inside = (u >= 0) & (v >= 0) & (u < ids.shape[1]) & (v < ids.shape[0])
        inside &= (np.abs(u - exact[:, 0]) < AROUND) & (np.abs(v - exact[:, 1]) < AROUND)
        at = np.where(inside, v, 0).astype(int), np.where(inside, u, 0).astype(int)
        found |= inside & (ids[at] == thing) & np.isfinite(seen[at]) & (seen[at] >= depth - room)
    return found
