"""Questions about what a camera sees, by rays to points on a thing's surface against the shapes of all others."""

from collections.abc import Iterator

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.shapes import Box, Cylinder, MeshShape, Shape, Sphere, is_ground
from anysim_language.episode import View
from anysim_language.moment import Moment
from anysim_language.questions.question import Asker, Question
from anysim_language.things import Thing

SEEN, UNSEEN = 0.5, 0.02
"""Shares of a thing's facing surface: seen from the first on, unseen up to the second, else nothing is asked."""
GRID = (np.arange(5) + 0.5) / 2.5 - 1.0
"""Places of points along an edge, in half edges."""
LIFTED = 1e-3
"""[m] Points are so far above their surface, so that what a thing lies on does not hide its lower edge."""


def about_sight(asker: Asker) -> Iterator[Question]:
    """For one moment, every camera that stands still, and each thing of simple shapes.

    A camera on a robot has parts of it so near that the checker's buffer does not resolve them.
    """
    for view in (view for view in asker.episode.views if view.body < 0):
        for thing in asker.objects:
            bounds = seen_bounds(asker.moment, thing, view)
            if bounds is None or (bounds[0] < SEEN and bounds[1] > UNSEEN):
                continue
            answer = "yes" if bounds[0] >= SEEN else "no"
            program = {"thing": thing.name, "camera": view.name}
            camera = view.name.replace("_", " ")
            the = asker.naming.the(thing.name)
            yield asker.ask("visibility", answer, program, (thing.name,), thing=the, camera=camera)


def seen_bounds(moment: Moment, thing: Thing, view: View) -> tuple[float, float] | None:
    """Between which shares of what faces a camera is seen by it; None for a thing that has no simple surface.

    The lower one takes boxes around meshes for solid, the upper one looks through meshes.
    """
    pose = view.pose if view.body < 0 else P.compose(moment.poses[view.body], view.pose)
    eye = pose[:3]
    points = _facing(moment, thing, eye)
    if points is None or not len(points):
        return None
    inside = _in_image(P.rotate(P.conjugate(pose[3:]), points - eye), view)
    solid, maybe = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    for other in moment.things:
        if other.name == thing.name:
            continue
        entity = moment.world.entities[other.entity]
        for body in range(entity.body_start, entity.body_stop):
            for shape, at in _shapes(moment, body):
                hidden = _hides(moment, shape, at, eye, points)
                if isinstance(shape, MeshShape):
                    maybe |= hidden
                else:
                    solid |= hidden
    return float((inside & ~solid & ~maybe).mean()), float((inside & ~solid).mean())


def _shapes(moment: Moment, body: int) -> list[tuple[Shape, Array]]:
    """What a body collides with, else what is seen of it, with poses (7,)."""
    geoms = [moment.world.geoms[g] for g in moment.world.body_geoms[body]]
    solid = [g for g in geoms if not is_ground(g.shape)]
    return [
        (g.shape, P.compose(moment.poses[body], P.pose(g.position, g.quaternion)))
        for g in [g for g in solid if g.collides] or solid
    ]


def _facing(moment: Moment, thing: Thing, eye: Array) -> Array | None:
    """Points (P, 3) on the faces of a thing that look to the eye; None unless it is all boxes, balls and cylinders."""
    found: list[Array] = []
    entity = moment.world.entities[thing.entity]
    for body in range(entity.body_start, entity.body_stop):
        for shape, at in _shapes(moment, body):
            if not isinstance(shape, Box | Sphere | Cylinder):
                return None
            points, normals = _surface(shape)
            points, normals = at[:3] + P.rotate(at[3:], points), P.rotate(at[3:], normals)
            faces = np.einsum("ij,ij->i", normals, eye - points) > 0.0
            found.append((points + LIFTED * normals)[faces])
    return np.concatenate(found) if found else None


def _surface(shape: Box | Sphere | Cylinder) -> tuple[Array, Array]:
    """Points (P, 3) on a shape with their outward normals, in its frame."""
    if isinstance(shape, Sphere):
        k = np.arange(100) + 0.5
        up, turn = 1.0 - 2.0 * k / 100.0, np.pi * (1.0 + 5.0**0.5) * k
        around = np.sqrt(1.0 - up * up)
        unit = np.stack([around * np.cos(turn), around * np.sin(turn), up], axis=1)
        return shape.radius * unit, unit
    if isinstance(shape, Cylinder):
        turn, height = (a.ravel() for a in np.meshgrid(np.arange(24) * np.pi / 12.0, GRID))
        wall = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
        side = shape.radius * wall + np.array([0.0, 0.0, shape.half_length]) * height[:, None]
        share = np.sqrt((np.arange(30) + 0.5) / 30.0)
        spin = np.pi * (1.0 + 5.0**0.5) * np.arange(30)
        disc = np.stack([share * np.cos(spin), share * np.sin(spin), np.zeros(30)], axis=1) * shape.radius
        cap = np.array([0.0, 0.0, 1.0])
        ends = [disc + sign * shape.half_length * cap for sign in (1.0, -1.0)]
        return np.concatenate([side, *ends]), np.concatenate([wall, np.tile(cap, (30, 1)), np.tile(-cap, (30, 1))])
    u, v = (a.ravel() for a in np.meshgrid(GRID, GRID))
    half = np.array(shape.half_size)
    points: list[Array] = []
    normals: list[Array] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            unit = np.zeros((len(u), 3))
            unit[:, axis] = sign
            face = unit.copy()
            face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = u, v
            points.append(face * half)
            normals.append(unit)
    return np.concatenate(points), np.concatenate(normals)


def _in_image(local: Array, view: View) -> Array:
    """(P,) whether points (P, 3) in a camera's frame lie within its image."""
    slope = np.tan(np.radians(view.fov) / 2.0)
    depth = local[:, 2]
    wide = np.abs(local[:, 0]) < depth * slope * view.width / view.height
    return (depth > 0.02) & wide & (np.abs(local[:, 1]) < depth * slope)


def _hides(moment: Moment, shape: Shape, at: Array, eye: Array, points: Array) -> Array:
    """(P,) whether a shape at a pose (7,) is between the eye and points (P, 3); a mesh is the box around it."""
    back = P.conjugate(at[3:])
    start = P.rotate(back, eye - at[:3])
    way = P.rotate(back, points - at[:3]) - start
    if isinstance(shape, Sphere):
        a, b = (way * way).sum(axis=1), (way * start).sum(axis=1)
        inner = b * b - a * ((start * start).sum() - shape.radius**2)
        first = (-b - np.sqrt(np.maximum(inner, 0.0))) / a
        return (inner > 0.0) & (first > 0.0) & (first < 1.0 - 1e-6)
    low, high = _box(moment, shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (low - start) / way, (high - start) / way
    enter, leave = np.fmin(one, two), np.fmax(one, two)
    if isinstance(shape, Cylinder):
        a, b = (way[:, :2] ** 2).sum(axis=1), (way[:, :2] * start[:2]).sum(axis=1)
        inner = b * b - a * ((start[:2] ** 2).sum() - shape.radius**2)
        root = np.sqrt(np.maximum(inner, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            first = np.maximum((-b - root) / a, enter[:, 2])
            last = np.minimum((-b + root) / a, leave[:, 2])
        return (inner > 0.0) & (first < last) & (last > 0.0) & (first < 1.0 - 1e-6)
    begin, end = np.nanmax(enter, axis=1), np.nanmin(leave, axis=1)
    return (begin < end) & (end > 0.0) & (begin < 1.0 - 1e-6)


def _box(moment: Moment, shape: Shape) -> tuple[Array, Array]:
    """Corners (3,) of the box around a shape in its frame."""
    match shape:
        case Box(half):
            return -np.array(half), np.array(half)
        case Cylinder(r, h):
            return np.array([-r, -r, -h]), np.array([r, r, h])
        case MeshShape(mesh):
            vertices = moment.meshes[mesh].vertices
            return vertices.min(axis=0), vertices.max(axis=0)
        case _:
            r, h = getattr(shape, "radius", 0.0), getattr(shape, "half_length", 0.0)
            return np.array([-r, -r, -h - r]), np.array([r, r, h + r])
