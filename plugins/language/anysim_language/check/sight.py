"""Visibility found a second time: everything's triangles splatted into a depth buffer, pixels counted."""

import numpy as np
from scipy.spatial.transform import Rotation

from anysim.conventions import Array
from anysim_language.check.scene import RawScene
from anysim_language.episode import Episode
from anysim_language.things import Thing

ROWS = 120
"""Of the depth buffer."""
SPAN = 1 << 14
"""More pixels than anything beside the image is away from its middle."""
BIAS = 0.004
"""[m] What is at most so far in front of a point does not hide it."""


def seen_share(episode: Episode, scene: RawScene, thing: Thing, camera: str) -> float:
    """The share of a thing's pixels, were it alone and the image unbounded to its sides, that are its own."""
    view = next(view for view in episode.views if view.name == camera)
    position, turn = view.pose[:3], Rotation.from_quat(np.array(view.pose[3:]))
    if view.body >= 0:
        mount = Rotation.from_quat(np.array(scene.poses[view.body, 3:]))
        position, turn = mount.apply(position) + scene.poses[view.body, :3], mount * turn
    focal = ROWS / 2.0 / np.tan(np.radians(view.fov) / 2.0)
    columns = round(ROWS * view.width / view.height)
    own = _splat(scene, view.name, scene.bodies(thing.entity), position, turn, focal)
    if not len(own):
        return 0.0
    pixels, which = np.unique(_key(own), return_inverse=True)
    depth, hidden = np.full(len(pixels), np.inf), np.full(len(pixels), np.inf)
    np.minimum.at(depth, which, own[:, 2])
    others = [b for t in episode.things if t.name != thing.name for b in scene.bodies(t.entity)]
    before = _splat(scene, view.name, others, position, turn, focal)
    keys = _key(before)
    place = np.minimum(np.searchsorted(pixels, keys), len(pixels) - 1)
    same = pixels[place] == keys
    np.minimum.at(hidden, place[same], before[same, 2])
    u, v = pixels // SPAN - SPAN // 2, pixels % SPAN - SPAN // 2
    inside = (np.abs(u + 0.5) < columns / 2) & (np.abs(v + 0.5) < ROWS / 2)
    return float((inside & (hidden > depth - BIAS)).mean())


def _key(points: Array) -> Array:
    """(P,) one number for each pixel; all far outside of the image share those of its rim."""
    limit = SPAN // 2 - 1
    u, v = (np.clip(points[:, k], -limit, limit).astype(np.int64) + SPAN // 2 for k in (0, 1))
    return u * SPAN + v


def _splat(scene: RawScene, camera: str, bodies: list[int], position: Array, turn: Rotation, focal: float) -> Array:
    """(P, 3) pixel column, row, both from the middle, and depth [m] of points on all triangles, denser than pixels."""
    for body in bodies:
        if (camera, body) not in scene.splats:
            scene.splats[camera, body] = _dots(scene, body, position, turn, focal)
    return np.concatenate([np.empty((0, 3)), *(scene.splats[camera, body] for body in bodies)])


def _dots(scene: RawScene, body: int, position: Array, turn: Rotation, focal: float) -> Array:
    """Those of one body, each pixel once, with its least depth."""
    points, faces = scene.triangles(body)
    if not len(faces):
        return np.empty((0, 3))
    corners = turn.inv().apply(points - position)[faces]
    corners = corners[corners[:, :, 2].max(axis=1) > 0.02]
    if not len(corners):
        return np.empty((0, 3))
    nearest = np.maximum(corners[:, :, 2].min(axis=1), 0.05)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    density = np.clip(np.ceil(1.5 * focal * edges / nearest), 1, 400).astype(int)
    found: list[Array] = []
    for n in np.unique(density):
        i, j = np.triu_indices(n + 1)
        weights = np.stack([i, j - i, n - j], axis=1) / n
        dots = np.einsum("pw,fwc->fpc", weights, corners[density == n]).reshape(-1, 3)
        dots = dots[dots[:, 2] > 0.02]
        found.append(np.column_stack([np.floor(focal * dots[:, :2] / dots[:, 2:]), dots[:, 2]]))
    dots = np.concatenate(found)
    order = np.lexsort((dots[:, 2], dots[:, 1], dots[:, 0]))
    dots = dots[order]
    first = np.ones(len(dots), dtype=bool)
    first[1:] = (dots[1:, :2] != dots[:-1, :2]).any(axis=1)
    return dots[first]
