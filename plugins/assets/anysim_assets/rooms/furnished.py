"""Furnished rooms: the plan, walls around its openings, a floor, and furniture that fits, as static things."""

from math import cos, sin
from typing import NamedTuple

import numpy as np

from anysim import cache
from anysim.assets.model import ImportedModel
from anysim.compile.room import MAIN, ROOM, RoomThing
from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import Issues
from anysim.model.appearance import Rgb, nominal_rgb
from anysim.model.world import ORIGIN, Body, BodyKind, Box, Geom, Mesh, MeshShape, Quat, Surface
from anysim_assets.rooms import outlines as G
from anysim_assets.rooms.furnish import NoPlace, PlacedPiece, furnish
from anysim_assets.rooms.plan import RoomPlan, plan_of, wall_boxes
from anysim_schemas.rooms import RoomSpec

FLOOR = 0.06
"""[m] thickness of the floor, downwards from height 0."""

GLASS = (0.72, 0.86, 0.94, 0.35)


class Furnished(NamedTuple):
    """A room with what stands in it."""

    plan: RoomPlan
    pieces: tuple[PlacedPiece, ...]


def room_of(spec: RoomSpec, issues: Issues) -> Furnished | None:
    """The plan of a room with its furniture in place; None with the reasons in `issues`, whose path is the room's."""
    plan = plan_of(spec, issues)
    if plan is None:
        return None
    try:
        return Furnished(plan, tuple(furnish(plan, spec.pieces, spec.walkway, spec.seed)))
    except NoPlace as error:
        issues.add("furniture" if spec.furniture or spec.style == "empty" else "style", str(error))
        return None


def furnished(spec: RoomSpec, issues: Issues) -> list[RoomThing]:
    """Rooms of a rectangular or polygonal plan, with furniture from primitives."""
    made = room_of(spec, issues)
    if made is None:
        return []
    things = [RoomThing(ROOM, "room", _shell(spec, made.plan, issues), ORIGIN, IDENTITY_QUATERNION)]
    color = (
        None
        if spec.furniture_color is None
        else nominal_rgb(spec.furniture_color, (0.7, 0.7, 0.7), issues, "furniture_color")
    )
    for one in made.pieces:
        x, y = (float(v) for v in one.middle)
        things.append(RoomThing(one.name, one.kind, _piece(spec, one, color), (x, y, 0.0), _turn(one.yaw)))
    return things


def _turn(yaw: float) -> Quat:
    return (0.0, 0.0, sin(yaw / 2), cos(yaw / 2))


def _shell(spec: RoomSpec, plan: RoomPlan, issues: Issues) -> ImportedModel:
    touch = Surface(friction=spec.friction)
    floor = nominal_rgb(spec.floor_color, (0.62, 0.50, 0.38), issues, "floor_color")
    paint = nominal_rgb(spec.wall_color, (0.87, 0.85, 0.80), issues, "wall_color")
    mesh = _floor_mesh(plan)
    geoms = [Geom("floor", 0, MeshShape(mesh.name), color=(*floor, 1.0), collides=False)]
    for box in wall_boxes(plan, spec.ceiling):
        color = GLASS if box.kind == "pane" else (0.95, 0.95, 0.94, 1.0) if box.kind == "ceiling" else (*paint, 1.0)
        geoms.append(Geom(box.name, 0, Box(box.half), box.middle, _turn(box.yaw), color=color, surface=touch))
    return ImportedModel(ROOM, (Body("", BodyKind.STATIC),), geoms=tuple(geoms), meshes=(mesh,))


def _floor_mesh(plan: RoomPlan) -> Mesh:
    """A slab of the form of the room, widened into the walls below the doors; its top is at height 0."""
    outline, n = plan.outline, len(plan.outline)
    top = G.triangles(outline)
    corners = np.concatenate([np.column_stack([outline, np.full(n, z)]) for z in (0.0, -FLOOR)])
    i = np.arange(n)
    j = (i + 1) % n
    sides = [np.stack([i, i + n, j + n], axis=1), np.stack([i, j + n, j], axis=1)]
    vertices, faces = [corners], [top, top[:, ::-1] + n, *sides]
    count = 2 * n
    for opening in plan.openings:  # thresholds
        if opening.is_door:
            wall = plan.walls[opening.wall]
            middle = wall.at((opening.low + opening.high) / 2, -plan.thickness / 2)
            rectangle = G.oriented_rectangle(middle, ((opening.high - opening.low) / 2, plan.thickness / 2), wall.yaw)
            vertices.append(np.column_stack([rectangle, np.zeros(4)]))
            faces.append(np.array([[0, 1, 2], [0, 2, 3]]) + count)
            count += 4
    points = np.round(np.concatenate(vertices), 9)
    triangles = np.concatenate(faces).astype(np.int32)
    for array in (points, triangles):
        array.setflags(write=False)
    digest = cache.digest("anysim-floor-1", repr(points.tolist()), repr(triangles.tolist()))
    return Mesh("floor", points, triangles, digest)


def _piece(spec: RoomSpec, one: PlacedPiece, color: Rgb | None) -> ImportedModel:
    touch = Surface(friction=spec.friction)
    geoms: list[Geom] = []
    for k, part in enumerate(one.piece.parts):
        shown = color if part.main and color is not None else part.color
        geoms.append(
            Geom(
                f"{MAIN if part.main else 'part'}{k}",
                0,
                part.shape,
                part.position,
                color=(*shown, 1.0),
                surface=touch,
                collides=part.collides,
            )
        )
    return ImportedModel(one.name, (Body("", BodyKind.STATIC),), geoms=tuple(geoms))
