"""A planning world as the text of a URDF and as pieces of shapes, in the terms that roboplan has.

The links of the text are the frames of the planned joints. Capsules are a cylinder and two balls, the ground is a large
box, and padding grows shapes by at least what is asked for.
"""

from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.geometry.triangles import convex_hull
from anysim.kinematics.pinocchio_model import from_se3
from anysim.math import pose as P
from anysim.model.shapes import Box, Capsule, Cylinder, HeightFieldShape, MeshShape, Plane, Shape, Sphere
from anysim.model.world import JointType, World
from anysim_planning.scene import PlanningWorld, surface_triangles

GROUND = 20.0
"""[m] half the edge of the box that stands for an infinite plane."""
CORNERS = 64
"""Of the hull of a mesh, at most."""
PACKAGE = "pieces"
"""The folder of the files, in the text."""
TURNS = 4 * np.pi
"""[rad] limits of a joint that has none."""


class Piece(NamedTuple):
    """A part of a shape and its pose in it: `box`, `sphere` or `cylinder` with its sizes [m], or `mesh`.

    A mesh has the name of a file, and its vertices (V, 3) [m] and triangles (T, 3).
    """

    kind: str
    size: tuple[float, ...]
    pose: Array
    file: str = ""
    triangles: tuple[Array, Array] | None = None


def pieces(world: World, shape: Shape, padding: float, name: str) -> list[Piece]:
    """A shape grown by a padding [m]; `name` is for a file of triangles."""
    origin = _at(0.0)
    match shape:
        case Box(half):
            return [Piece("box", tuple(2 * (h + padding) for h in half), origin)]
        case Sphere(radius):
            return [Piece("sphere", (radius + padding,), origin)]
        case Cylinder(radius, half):
            return [Piece("cylinder", (radius + padding, 2 * (half + padding)), origin)]
        case Capsule(radius, half):
            rod = Piece("cylinder", (radius + padding, 2 * half), origin)
            return [rod, *(Piece("sphere", (radius + padding,), _at(z)) for z in (-half, half))]
        case Plane():
            return [Piece("box", (2 * GROUND,) * 3, _at(padding - GROUND))]
        case HeightFieldShape(known):
            field = next(f for f in world.heightfields if f.name == known)
            vertices, faces = surface_triangles(field.heights, field.size)
        case MeshShape(known, concave):
            mesh = next(m for m in world.meshes if m.name == known)
            vertices, faces = np.asarray(mesh.vertices, dtype=float), mesh.faces
            if not concave:
                corners = padding * np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
                vertices = (vertices[:, None] + corners).reshape(-1, 3) if padding else vertices
                vertices, faces = convex_hull(vertices, CORNERS)
    return [Piece("mesh", (), origin, f"{name}.obj", (vertices, faces))]


def urdf(world: World, planned: PlanningWorld, shapes: dict[int, list[Piece]]) -> str:
    """The planned joints under their names, links `link_N` at their frames, some geoms as links `geom_G` of these."""
    model, lines = planned.model, ['<robot name="anysim">', '<link name="link_0"/>']
    for k in planned.order:
        joint = world.joints[planned.joints[k]]
        number = model.getJointId(joint.name)
        kind = "prismatic" if joint.type is JointType.PRISMATIC else "revolute"
        low, high = (float(np.clip(limit[k], -TURNS, TURNS)) for limit in (planned.lower, planned.upper))
        lines += [
            f'<link name="link_{number}"/>',
            f'<joint name={quoteattr(joint.name)} type="{kind}">',
            f'<parent link="link_{model.parents[number]}"/><child link="link_{number}"/>',
            _origin(from_se3(model.jointPlacements[number])),
            f'<axis xyz="{_numbers(joint.axis)}"/>',
            f'<limit lower="{low!r}" upper="{high!r}" velocity="1" effort="1"/></joint>',
        ]
    for g, parts in shapes.items():
        placed = planned.geometry.geometryObjects[g]
        frame = from_se3(placed.placement)
        lines.append(f'<link name="geom_{g}">')
        lines += [
            f"<collision>{_origin(P.compose(frame, piece.pose))}<geometry>{_tag(piece)}</geometry></collision>"
            for piece in parts
        ]
        lines.append(f'</link><joint name="fixed_{g}" type="fixed">')
        lines.append(f'<parent link="link_{placed.parentJoint}"/><child link="geom_{g}"/></joint>')
    return "\n".join([*lines, "</robot>"])


def write(piece: Piece, folder: Path) -> None:
    """The triangles of a mesh as its file; nothing for other pieces."""
    if piece.triangles is None:
        return
    vertices, faces = piece.triangles
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in np.asarray(faces).tolist()]
    (folder / piece.file).write_text("\n".join(lines) + "\n", "utf-8")


def matrix(pose: Array) -> Array:
    """(4, 4) of a pose (7,), column by column, as roboplan takes it."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = P.to_matrix(pose[3:]), pose[:3]
    return np.asfortranarray(made)


def _at(z: float) -> Array:
    return P.pose((0.0, 0.0, z), IDENTITY_QUATERNION)


def _tag(piece: Piece) -> str:
    match piece.kind:
        case "box":
            return f'<box size="{_numbers(piece.size)}"/>'
        case "sphere":
            return f'<sphere radius="{piece.size[0]!r}"/>'
        case "cylinder":
            return f'<cylinder radius="{piece.size[0]!r}" length="{piece.size[1]!r}"/>'
        case _:
            return f"<mesh filename={quoteattr(f'package://{PACKAGE}/{piece.file}')}/>"


def _origin(pose: Array) -> str:
    m = matrix(pose)
    level = float(np.hypot(m[0, 0], m[1, 0]))
    pitch = float(np.arctan2(-m[2, 0], level))
    roll, yaw = float(np.arctan2(m[2, 1], m[2, 2])), float(np.arctan2(m[1, 0], m[0, 0]))
    if level < 1e-9:  # roll and yaw turn about one axis
        roll, yaw = 0.0, float(np.arctan2(-m[0, 1], m[1, 1]))
    return f'<origin xyz="{_numbers(pose[:3])}" rpy="{roll!r} {pitch!r} {yaw!r}"/>'


def _numbers(values: Array | tuple[float, ...]) -> str:
    return " ".join(repr(float(v)) for v in values)
