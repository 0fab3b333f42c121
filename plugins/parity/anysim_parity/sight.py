"""View of a pinhole camera on the neutral geometry, ray by ray: the answer for rendered images.

A pixel's ray goes through its centre: the pixel in column u and row v of a W x H image looks along
((u + 1/2 - W/2) / f, (v + 1/2 - H/2) / f, 1) in the optical frame, f = H / (2 tan(fov / 2)). Boxes, spheres, planes,
cylinders and capsules are met exactly; meshes and height fields triangle by triangle. There is no anti-aliasing.
"""

from dataclasses import replace
from math import radians, tan
from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.cameras import CameraView
from anysim.math import pose as P
from anysim.model.world import (
    Box,
    Capsule,
    Cylinder,
    Geom,
    HeightField,
    HeightFieldShape,
    MeshShape,
    Plane,
    Sphere,
    World,
)


class Sight(NamedTuple):
    """depth (H, W) [m] along the optical axis, inf where nothing is; segmentation (H, W) int32, entity ids."""

    depth: Array
    segmentation: Array


def focal_length(fov: float, height: int) -> float:
    """[pixels] of a camera with a vertical field of view [degrees]."""
    return height / (2 * tan(radians(fov) / 2))


def rays(fov: float, width: int, height: int) -> Array:
    """Directions (H, W, 3) in the optical frame, 1 along its axis, through the centres of the pixels."""
    f = focal_length(fov, height)
    x = (np.arange(width) + 0.5 - width / 2) / f
    y = (np.arange(height) + 0.5 - height / 2) / f
    u, v = np.meshgrid(x, y)
    return np.stack([u, v, np.ones_like(u)], axis=-1)


def project(points: Array, view: CameraView, row: int = 0) -> Array:
    """Where points (..., 3) [m] of the world fall: (..., 2) [pixels], column and row; 0.5 is a pixel's centre."""
    local = P.rotate_inverse(view.pose[row, 3:], points - view.pose[row, :3])
    f = focal_length(float(view.fov[row]), view.height)
    return local[..., :2] / local[..., 2:] * f + np.array([view.width, view.height]) / 2


def sight(world: World, poses: Array, view: CameraView, row: int = 0) -> Sight:
    """What the camera sees, bodies at poses (B, 7)."""
    view = replace(view, pose=view.pose[[row]], fov=view.fov[[row]])
    directions = rays(float(view.fov[0]), view.width, view.height)
    depth = np.full((view.height, view.width), np.inf)
    owner = np.zeros((view.height, view.width), dtype=np.int32)
    entity = {WORLD: 0} | {body: e + 1 for body, e in enumerate(world.body_entity)}
    for geom in world.geoms:
        if not geom.visible:
            continue
        local = P.pose(geom.position, geom.quaternion)
        place = local if geom.body == WORLD else P.compose(poses[geom.body], local)
        seen = P.compose(P.inverse(view.pose[0]), place)  # the geom's frame in the optical one
        found = _depth(world, geom, seen, directions, view)
        nearer = (found < depth) & (found >= view.near) & (found <= view.far)
        depth[nearer] = found[nearer]
        owner[nearer] = entity[geom.body]
    return Sight(depth, owner)


def _depth(world: World, geom: Geom, seen: Array, directions: Array, view: CameraView) -> Array:
    """Depth (H, W) at which the rays enter a geom; inf where they pass it."""
    match geom.shape:
        case MeshShape(name):
            mesh = next(m for m in world.meshes if m.name == name)
            corners = seen[:3] + P.rotate(seen[3:], np.asarray(mesh.vertices, dtype=float))
            return _triangles(corners[np.asarray(mesh.faces)], directions, view)
        case HeightFieldShape(name):
            field = next(f for f in world.heightfields if f.name == name)
            return _triangles(seen[:3] + P.rotate(seen[3:], _relief(field)), directions, view)
        case _:
            pass
    turned = P.conjugate(seen[3:])
    origin, along = P.rotate(turned, -seen[:3]), P.rotate(turned, directions)
    with np.errstate(divide="ignore", invalid="ignore"):
        match geom.shape:
            case Plane(size):
                t = -origin[2] / along[..., 2]
                at = origin[:2] + t[..., None] * along[..., :2]
                hit = (np.abs(at) <= size).all(axis=-1) & (along[..., 2] < 0)
                found = np.where(hit, t, np.inf)
            case Box(half):
                found = _box(origin, along, np.array(half))
            case Sphere(radius):
                found = _ball(origin, along, radius)
            case Cylinder(radius, length):
                found = np.minimum(_tube(origin, along, radius, length), _discs(origin, along, radius, length))
            case Capsule(radius, length):
                ends = [_ball(origin - np.array([0.0, 0.0, z]), along, radius) for z in (-length, length)]
                found = np.minimum(_tube(origin, along, radius, length), np.minimum(*ends))
            case _:
                raise TypeError(f"no ray is known to meet a {type(geom.shape).__name__}")
    return np.where(found > 0, found, np.inf)


def _box(origin: Array, along: Array, half: Array) -> Array:
    """Entry into a box: the last of its three slabs that is entered, if none was left before."""
    one, two = (-half - origin) / along, (half - origin) / along
    enters, leaves = np.minimum(one, two).max(axis=-1), np.maximum(one, two).min(axis=-1)
    return np.where(enters <= leaves, enters, np.inf)


def _root(a: Array, b: Array, c: Array | float) -> Array:
    """The smaller root of a t^2 + 2 b t + c; inf where there is none."""
    inside = b * b - a * c
    return np.where(inside >= 0, (-b - np.sqrt(np.maximum(inside, 0.0))) / a, np.inf)


def _ball(origin: Array, along: Array, radius: float) -> Array:
    return _root((along**2).sum(-1), (along * origin).sum(-1), float(origin @ origin) - radius**2)


def _tube(origin: Array, along: Array, radius: float, half_length: float) -> Array:
    """Entry through the side of an upright cylinder."""
    flat, start = along[..., :2], origin[:2]
    t = _root((flat**2).sum(-1), (flat * start).sum(-1), float(start @ start) - radius**2)
    return np.where(np.abs(origin[2] + t * along[..., 2]) <= half_length, t, np.inf)


def _discs(origin: Array, along: Array, radius: float, half_length: float) -> Array:
    """Entry through an end of an upright cylinder: the one that faces the ray."""
    z = np.where(along[..., 2] < 0, half_length, -half_length)
    t = (z - origin[2]) / along[..., 2]
    at = origin[:2] + t[..., None] * along[..., :2]
    return np.where((at**2).sum(-1) <= radius**2, t, np.inf)


def _triangles(corners: Array, directions: Array, view: CameraView) -> Array:
    """The nearest of triangles (T, 3, 3) in the optical frame. Counterclockwise is their front; backs are not seen."""
    depth = np.full(directions.shape[:2], np.inf)
    f, size = focal_length(float(view.fov[0]), view.height), np.array([view.width, view.height])
    ahead = np.all(corners[..., 2] > view.near, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = np.asarray(corners[..., :2] / corners[..., 2:] * f + size / 2 - 0.5)
    first_pixel = np.where(ahead[:, None], np.ceil(flat.min(axis=1)), 0)
    last_pixel = np.where(ahead[:, None], np.floor(flat.max(axis=1)), size - 1)
    low: Array = np.clip(first_pixel, 0, size).astype(int)
    high: Array = np.clip(last_pixel, -1, size - 1).astype(int)
    some = np.all(low <= high, axis=1) & np.any(corners[..., 2] > view.near, axis=1)
    for k in np.flatnonzero(some).tolist():
        (u, v), (right, down) = low[k].tolist(), high[k].tolist()
        window = (slice(v, down + 1), slice(u, right + 1))
        a, b, c = corners[k]
        ray, one, two = directions[window], b - a, c - a
        across = P.cross(ray, np.broadcast_to(two, ray.shape))
        scale = across @ one
        with np.errstate(divide="ignore", invalid="ignore"):
            first = -(across @ a) / scale
            turned = np.cross(-a, one)
            second, t = (ray @ turned) / scale, float(two @ turned) / scale
        hit = (scale > 0) & (first >= 0) & (second >= 0) & (first + second <= 1) & (t > 0)
        depth[window] = np.where(hit, np.minimum(depth[window], t), depth[window])
    return depth


def _relief(field: HeightField) -> Array:
    """Triangles (T, 3, 3) of a height field in its own frame."""
    heights = np.asarray(field.heights, dtype=float)
    rows, cols = heights.shape
    x = np.linspace(-field.size[0] / 2, field.size[0] / 2, cols)
    y = np.linspace(-field.size[1] / 2, field.size[1] / 2, rows)
    points = np.stack([*np.meshgrid(x, y), heights], axis=-1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return np.concatenate([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)]).reshape(-1, 3, 3)
