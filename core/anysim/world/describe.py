"""A World as rows of a table, for the command line and for reading back what was compiled."""

from math import degrees, inf
from typing import NamedTuple

from anysim.world.model import JointType, MeshShape, Shape, World


class EntityRow(NamedTuple):
    """One entity: counts and total mass [kg]."""

    name: str
    kind: str
    source: str
    bodies: int
    joints: int
    driven: int
    geoms: int
    mass: float


class BodyRow(NamedTuple):
    """One body: `parent` by name, `joint` as a phrase, mass [kg], what it collides with and how many geoms it shows.

    `matter` says what is not usual about it: damping, solver settings, textures and materials.
    """

    name: str
    kind: str
    parent: str
    joint: str
    mass: float
    collides: str
    visuals: int
    matter: str = ""


def entity_rows(world: World) -> list[EntityRow]:
    """One row an entity, in order."""
    rows: list[EntityRow] = []
    for e in world.entities:
        bodies, joints = range(e.body_start, e.body_stop), range(e.joint_start, e.joint_stop)
        model = next((r.model for r in world.robots if r.name == e.name), e.source)
        rows.append(
            EntityRow(
                e.name, str(e.kind), model, len(bodies), len(joints),
                sum(a.joint in joints for a in world.actuators), sum(g.body in bodies for g in world.geoms),
                sum(world.bodies[i].inertial.mass for i in bodies),
            )
        )  # fmt: skip
    return rows


def body_rows(world: World) -> list[BodyRow]:
    """One row a body, in order."""
    rows: list[BodyRow] = []
    for i, body in enumerate(world.bodies):
        own = [g for g in world.geoms if g.body == i]
        counts: dict[str, int] = {}
        for geom in own:
            if geom.collides:
                counts[shape_name(geom.shape)] = counts.get(shape_name(geom.shape), 0) + 1
        collides = ", ".join(name if n == 1 else f"{n} {name}" for name, n in counts.items())
        parent = "" if body.parent < 0 else world.bodies[body.parent].name
        rows.append(
            BodyRow(
                body.name, str(body.kind), parent, joint_phrase(world, world.body_joint[i]), body.inertial.mass,
                collides, sum(g.visible for g in own), matter_phrase(world, i),
            )
        )  # fmt: skip
    return rows


def matter_phrase(world: World, body: int) -> str:
    """`damped 0.5 and 0.1 /s, texture checker, material metal`; empty where nothing is unusual."""
    found, own = world.bodies[body], [g for g in world.geoms if g.body == body]
    parts: list[str] = []
    if any(found.damping):
        parts.append(f"damped {found.damping[0]:g} and {found.damping[1]:g} /s")
    if found.solver is not None:
        parts.append("solver settings of its own")
    parts += [f"texture {name}" for name in dict.fromkeys(g.texture for g in own) if name]
    parts += [f"material {name}" for name in dict.fromkeys(g.material for g in own) if name]
    return ", ".join(parts)


def joint_phrase(world: World, joint: int) -> str:
    """`revolute -166..166 deg`, `prismatic 0..40 mm`, `revolute, follows panda.finger1`; empty for no joint."""
    if joint < 0:
        return ""
    j = world.joints[joint]
    if j.mimic is not None:
        return f"{j.type}, follows {world.joints[j.mimic.joint].name}"
    if j.lower == -inf and j.upper == inf:
        return f"{j.type}, without end"
    turn = j.type is JointType.REVOLUTE
    low, high = ((degrees(v) if turn else v * 1000) for v in (j.lower, j.upper))
    return f"{j.type} {low:.0f}..{high:.0f} {'deg' if turn else 'mm'}"


def shape_name(shape: Shape) -> str:
    """`box`, `mesh`, `height field` and so on."""
    names = {"MeshShape": "mesh", "HeightFieldShape": "height field"}
    kind = type(shape).__name__
    if isinstance(shape, MeshShape) and shape.concave:
        return "triangle mesh"
    return names.get(kind, kind.lower())
