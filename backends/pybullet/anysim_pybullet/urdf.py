"""A tree of the World as a URDF that Bullet takes at its word.

Everything that Bullet would make up is written: inertia in principal axes, limits, zero damping and friction. Each
further shape of a body is on a massless link of its own, rigidly joined: a state that is saved with several shapes on
one link does not continue exactly in Bullet. Lines are short, because its reader has a buffer of fixed length.
"""

from collections.abc import Mapping, Sequence
from math import atan2, hypot, isfinite
from pathlib import Path

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Geom, JointType, Mesh, MeshShape, Sphere, World
from anysim_mechanics.trees import Frames, Tree, link_pose

UNLIMITED = 1e10
"""Stands for infinity where Bullet wants a number: the open side of a limit."""

_NOTHING = '<mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'


def body_link(body: int) -> str:
    """The name of a body's link."""
    return f"b{body}"


def shape_link(shape: int) -> str:
    """The name of the link that carries a further shape of a body."""
    return f"g{shape}"


def joint_name(joint: int) -> str:
    """The name of a joint of the World."""
    return f"j{joint}"


def write_meshes(world: World, folder: Path) -> dict[str, Path]:
    """Each mesh that collides as an .obj file, of whose vertices Bullet takes the convex hull."""
    wanted = {g.shape.mesh for g in world.geoms if g.collides and isinstance(g.shape, MeshShape)}
    files = {}
    for number, mesh in enumerate(m for m in world.meshes if m.name in wanted):
        files[mesh.name] = folder / f"m{number}.obj"
        files[mesh.name].write_text(obj_text(mesh), encoding="ascii")
    return files


def obj_text(mesh: Mesh) -> str:
    """A mesh as one object of an .obj file."""
    lines = ["o mesh"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(mesh.vertices, dtype=float).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in np.asarray(mesh.faces).tolist()]
    return "\n".join(lines) + "\n"


def tree_urdf(
    world: World, frames: Frames, tree: Tree, shapes: Mapping[int, Sequence[tuple[int, Geom]]], meshes: dict[str, Path]
) -> str:
    """The URDF of a tree, with these numbered shapes on its bodies."""
    lines = [f'<robot name="t{tree.number}">']
    for body in tree.bodies.tolist():
        weightless = world.bodies[body].inertial.mass <= 0
        lines += [
            f'<link name="{body_link(body)}">',
            *([_inertial_of_nothing()] if weightless else _inertial(world, frames, body)),
        ]
        lines += [line for _, geom in shapes[body][:1] for line in _collision(geom, frames.anchor[body], meshes)]
        lines.append("</link>")
        for index, geom in shapes[body][1:]:
            lines += [f'<link name="{shape_link(index)}">', _inertial_of_nothing()]
            lines += [*_collision(geom, frames.anchor[body], meshes), "</link>"]
            lines += [
                f'<joint name="f{index}" type="fixed">',
                f'<parent link="{body_link(body)}"/>',
                f'<child link="{shape_link(index)}"/>',
                "</joint>",
            ]
    for body in tree.bodies[1:].tolist():
        lines += _joint(world, frames, body)
    return "\n".join([*lines, "</robot>"]) + "\n"


def world_geom_urdf(geom: Geom, meshes: dict[str, Path]) -> str:
    """A shape that is fixed to the world, as a robot of one link whose frame is the world's."""
    lines = ['<robot name="w">', '<link name="w">', _inertial_of_nothing(), *_collision(geom, np.zeros(3), meshes)]
    return "\n".join([*lines, "</link>", "</robot>"]) + "\n"


def _inertial_of_nothing() -> str:
    return f"<inertial>{_NOTHING}</inertial>"


def _inertial(world: World, frames: Frames, body: int) -> list[str]:
    x, y, z = (float(m) for m in frames.moments[body])
    return [
        "<inertial>",
        _origin(frames.inertial[body]),
        f'<mass value="{float(world.bodies[body].inertial.mass)!r}"/>',
        f'<inertia ixx="{float(x)!r}" ixy="0" ixz="0"',
        f' iyy="{float(y)!r}" iyz="0" izz="{float(z)!r}"/>',
        "</inertial>",
    ]


def _collision(geom: Geom, anchor: Array, meshes: dict[str, Path]) -> list[str]:
    pose = np.array([*(np.array(geom.position) - anchor), *geom.quaternion])
    triangles = isinstance(geom.shape, MeshShape) and geom.shape.concave
    return [
        '<collision concave="yes">' if triangles else "<collision>",
        _origin(pose),
        f"<geometry>{_shape(geom, meshes)}</geometry>",
        "</collision>",
    ]


def _shape(geom: Geom, meshes: dict[str, Path]) -> str:
    match geom.shape:
        case Box((x, y, z)):
            return f'<box size="{float(2 * x)!r} {float(2 * y)!r} {float(2 * z)!r}"/>'
        case Sphere(r):
            return f'<sphere radius="{float(r)!r}"/>'
        case Capsule(r, h):
            return f'<capsule radius="{float(r)!r}" length="{float(2 * h)!r}"/>'
        case Cylinder(r, h):
            return f'<cylinder radius="{float(r)!r}" length="{float(2 * h)!r}"/>'
        case MeshShape(name):
            return f'<mesh filename="{meshes[name].name}"/>'
        case _:
            kind = type(geom.shape).__name__
            raise EngineError(f"pybullet can fix a {kind} to the world alone; geom '{geom.name}' is on a body")


def _joint(world: World, frames: Frames, body: int) -> list[str]:
    index = world.body_joint[body]
    joint = world.joints[index]
    limited = isfinite(joint.lower) or isfinite(joint.upper)
    revolute = joint.type is JointType.REVOLUTE
    kind = ("revolute" if limited else "continuous") if revolute else "prismatic"
    # the reader takes a lower limit above the upper one for none
    lower = max(joint.lower, -UNLIMITED) if limited else 1.0
    upper = min(joint.upper, UNLIMITED) if limited else -1.0
    x, y, z = joint.axis
    return [
        f'<joint name="{joint_name(index)}" type="{kind}">',
        f'<parent link="{body_link(world.bodies[body].parent)}"/>',
        f'<child link="{body_link(body)}"/>',
        _origin(link_pose(world, frames, body)),
        f'<axis xyz="{float(x)!r} {float(y)!r} {float(z)!r}"/>',
        f'<limit lower="{float(lower)!r}" upper="{float(upper)!r}"',
        f' effort="{UNLIMITED!r}" velocity="{UNLIMITED!r}"/>',
        '<dynamics damping="0" friction="0"/>',
        "</joint>",
    ]


def _origin(pose: Array) -> str:
    x, y, z = (float(v) for v in pose[:3])
    roll, pitch, yaw = roll_pitch_yaw(pose[3:])
    return f'<origin xyz="{x!r} {y!r} {z!r}"\n rpy="{roll!r} {pitch!r} {yaw!r}"/>'


def roll_pitch_yaw(quaternion: Array) -> tuple[float, float, float]:
    """Fixed-axis roll, pitch and yaw [rad] of a rotation, as in URDF; the rotation is met within 1e-8.

    Near a pitch of a right angle roll and yaw turn about almost the same axis: there the yaw is 0, because the small
    numbers that would tell them apart are rounding errors.
    """
    m = P.to_matrix(np.asarray(quaternion, dtype=float)).tolist()
    level = hypot(m[0][0], m[1][0])
    pitch = atan2(-m[2][0], level)
    if level < 1e-8:  # error of the one way: level; of the other: 1e-16 / level
        return atan2(-m[1][2], m[1][1]), pitch, 0.0
    return atan2(m[2][1], m[2][2]), pitch, atan2(m[1][0], m[0][0])
