"""Compilation of a room: a static thing for its shell, and one for each piece in it."""

from dataclasses import replace
from math import cos, sin
from typing import NamedTuple

import numpy as np

from anysim import cache
from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.conventions import IDENTITY_QUATERNION
from anysim.geometry import polygon as G
from anysim.issues import Issues
from anysim.model.colors import Rgb, nominal_rgb
from anysim.model.world import ORIGIN, Body, BodyKind, Box, EntityKind, Geom, Mesh, MeshShape, Quat, Surface
from anysim.rooms.furnish import NoPlace, Placed, furnish, names_of
from anysim.rooms.plan import RoomPlan, plan_of, wall_boxes
from anysim_schemas.rooms import RoomSpec
from anysim_schemas.run import WorldSpec

ROOM = "room"
"""The name of the shell of a room as an entity."""

MAIN = "main"
"""How the names of those geoms of a piece begin that have its colour."""

FLOOR = 0.06
"""[m] thickness of the floor, downwards from height 0."""

GLASS = (0.72, 0.86, 0.94, 0.35)


class Furnished(NamedTuple):
    """A room with what stands in it."""

    plan: RoomPlan
    pieces: tuple[Placed, ...]


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


def furniture_names(spec: RoomSpec) -> list[str]:
    """The entities that the furniture of a room becomes."""
    return [name for name, _ in names_of(spec.pieces)]


def add_room(builder: WorldBuilder, content: WorldSpec, issues: Issues) -> None:
    """The room of a world, if it has one; what is wrong goes to `issues`, whose path is that of the world."""
    spec = content.room
    if spec is None:
        return
    if content.terrain.kind != "plane":
        issues.add("room", f"a room stands on a plane; world.terrain is {content.terrain.kind}")
    names = [ROOM, *furniture_names(spec)]
    for key, taken in (("objects", content.objects), ("robots", content.robots)):
        for name in taken:
            if name in names:
                what = "the room itself" if name == ROOM else "a piece of furniture"
                issues.add(f"{key}.{name}", f"'{name}' is {what} (world.room); give this one another name")
    made = room_of(spec, issues.at("room"))
    if made is None:
        return
    # the floor is seen in place of the ground, which stays what things touch
    builder.geoms = [_unseen(geom) for geom in builder.geoms]
    _add(builder, ROOM, _shell(spec, made.plan, issues.at("room")), "room", ORIGIN, IDENTITY_QUATERNION)
    color = (
        None
        if spec.furniture_color is None
        else nominal_rgb(spec.furniture_color, (0.7, 0.7, 0.7), issues.at("room"), "furniture_color")
    )
    for one in made.pieces:
        x, y = (float(v) for v in one.middle)
        turn = (0.0, 0.0, sin(one.yaw / 2), cos(one.yaw / 2))
        _add(builder, one.name, _piece(spec, one, color), one.kind, (x, y, 0.0), turn)


def _unseen(geom: Geom) -> Geom:
    return replace(geom, visible=False)


def _add(
    builder: WorldBuilder, name: str, model: ImportedModel, label: str, place: tuple[float, float, float], turn: Quat
) -> None:
    builder.add(
        name,
        EntityKind.OBJECT,
        model,
        root=BodyKind.STATIC,
        position=place,
        quaternion=turn,
        label=label,
        source=f"room:{label}",
    )


def _shell(spec: RoomSpec, plan: RoomPlan, issues: Issues) -> ImportedModel:
    touch = Surface(friction=spec.friction)
    floor = nominal_rgb(spec.floor_color, (0.62, 0.50, 0.38), issues, "floor_color")
    paint = nominal_rgb(spec.wall_color, (0.87, 0.85, 0.80), issues, "wall_color")
    mesh = _floor_mesh(plan)
    geoms = [Geom("floor", 0, MeshShape(mesh.name), color=(*floor, 1.0), collides=False)]
    for box in wall_boxes(plan, spec.ceiling):
        color = GLASS if box.kind == "pane" else (0.95, 0.95, 0.94, 1.0) if box.kind == "ceiling" else (*paint, 1.0)
        turn = (0.0, 0.0, sin(box.yaw / 2), cos(box.yaw / 2))
        geoms.append(Geom(box.name, 0, Box(box.half), box.middle, turn, color=color, surface=touch))
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


def _piece(spec: RoomSpec, one: Placed, color: Rgb | None) -> ImportedModel:
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
