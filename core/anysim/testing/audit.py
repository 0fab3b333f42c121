"""Audit: read a world back from a live engine and compare it with the World it was built from.

Native importers and builders change things in silence. Here the engine's own numbers are made into the same rows as the
World's, and its body frames are compared with the neutral forward kinematics at random joint positions, which also
finds a wrong order of bodies or joints.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.shapes import is_ground
from anysim.model.world import FAR, Body, BodyKind, Entity, Inertial, JointType, MeshShape, World

CONFIGURATIONS = 20
INERTIALS = ("body.mass", "body.com", "body.inertia")
RELATIVE, ABSOLUTE = 1e-5, 1e-8
"""Engines in single precision keep six digits."""
FRAME_TOLERANCE = 1e-5
"""[m] and [rad], largest difference of a body frame over all configurations; of an axis, in its components."""
PROBE = 0.1
"""[rad or m] by which a joint is moved to see what moves with it."""


class AuditRow(NamedTuple):
    """One number (or a few) about one thing; the key of a comparison is (subject, quantity)."""

    subject: str
    quantity: str
    value: tuple[float, ...]


class AuditLine(NamedTuple):
    """One comparison. `found` is empty where the engine does not report the quantity; then `ok` is None.

    `note` says what the engine declares, where the difference is larger than rounding and within that.
    """

    subject: str
    quantity: str
    expected: tuple[float, ...]
    found: tuple[float, ...]
    ok: bool | None
    note: str = ""


def audit(engine: SimEngine) -> list[AuditLine]:
    """Compare masses, centres, moments, limits, joint constants, volumes, axes, order and frames of env 0.

    The engine is reset. An axis is how the link turns or shifts against its parent when its joint alone is moved, in
    the link's frame; the order is which bodies do (`moves`, indices into `World.bodies`). Of what may be absent the
    first of each slot is looked at, then the second, and so on; who was there is there again afterwards.
    """
    world, before = engine.world, engine.presence
    expected = world_rows(world)
    rounds = max((len(slot.entities) for slot in world.slots), default=1)
    lines: dict[tuple[str, str, tuple[float, ...]], AuditLine] = {}
    for number in range(rounds):
        present = _present(world, number)
        engine.reset([0], present=present[None])
        found = {(row.subject, row.quantity): row.value for row in engine_rows(engine)}
        seen = [_line(engine, row, found.get((row.subject, row.quantity), ())) for row in expected]
        there = _subjects(world, present)
        for line in (*seen, *_axes_and_order(engine), *_frames(engine)):
            if line.subject in there:
                lines.setdefault((line.subject, line.quantity, line.expected), line)
    if rounds > 1:
        engine.reset([0], present=before[:1])
    return list(lines.values())


def world_rows(world: World) -> list[AuditRow]:
    """Masses, principal moments, joint limits and constants, volumes of collision geoms, entity totals."""
    rows: list[AuditRow] = []
    for entity in world.entities:
        mass = sum(b.inertial.mass for b in moving_bodies(world, entity))
        rows.append(AuditRow(entity.name, "total mass", (mass,)))
    for body in world.bodies:
        if body.kind is BodyKind.STATIC:
            continue
        moments = np.sort(np.linalg.eigvalsh(inertia.tensor(body.inertial)))
        rows.append(AuditRow(body.name, "mass", (body.inertial.mass,)))
        rows.append(AuditRow(body.name, "centre of mass", body.inertial.com))
        rows.append(AuditRow(body.name, "principal moments", tuple(float(m) for m in moments)))
    for joint in world.joints:
        rows.append(AuditRow(joint.name, "limits", _ends((joint.lower, joint.upper))))
        rows.append(AuditRow(joint.name, "damping", (joint.damping,)))
        rows.append(AuditRow(joint.name, "dry friction", (joint.friction,)))
        rows.append(AuditRow(joint.name, "armature", (joint.armature,)))
    for actuator in world.actuators:
        rows.append(AuditRow(actuator.name, "effort limit", (actuator.effort_limit,)))
    meshes = {mesh.name: mesh for mesh in world.meshes}
    for geom in world.geoms:
        triangles = isinstance(geom.shape, MeshShape) and geom.shape.concave
        if geom.collides and not is_ground(geom.shape) and not triangles:
            rows.append(AuditRow(geom.name, "volume", (inertia.volume(geom.shape, meshes),)))
            rows.append(AuditRow(geom.name, "friction", (geom.surface.friction,)))
    return rows


def _ends(limits: Iterable[float]) -> tuple[float, ...]:
    """Limits that are none as infinite ones."""
    return tuple(float(x) if abs(x) < FAR or np.isnan(x) else float(np.copysign(np.inf, x)) for x in limits)


def moving_bodies(world: World, entity: Entity) -> list[Body]:
    """The bodies of an entity whose masses count: engines drop the mass of what cannot move."""
    return [b for b in world.bodies[entity.body_start : entity.body_stop] if b.kind is not BodyKind.STATIC]


def _present(world: World, number: int) -> Array:
    """(E,) bool: what is always there, and of each slot the entity of this number or its last one."""
    present = world.initial_presence.copy()
    for slot in world.slots:
        present[list(slot.entities)] = False
        present[slot.entities[min(number, len(slot.entities) - 1)]] = True
    return present


def _subjects(world: World, present: Array) -> set[str]:
    """The names of what is there: entities, bodies, joints, actuators and geoms."""
    bodies = [bool(present[entity]) for entity in world.body_entity] + [True]  # the last one is the world's own
    names = {entity.name for entity, there in zip(world.entities, present, strict=True) if there}
    names |= {body.name for body, there in zip(world.bodies, bodies, strict=False) if there}
    names |= {joint.name for joint in world.joints if bodies[joint.body]}
    names |= {actuator.name for actuator in world.actuators if bodies[world.joints[actuator.joint].body]}
    return names | {geom.name for geom in world.geoms if bodies[geom.body]}


def _line(engine: SimEngine, row: AuditRow, value: tuple[float, ...]) -> AuditLine:
    if not value:
        return AuditLine(*row, value, None)
    if len(value) == len(row.value) and np.allclose(value, row.value, rtol=RELATIVE, atol=ABSOLUTE):
        return AuditLine(*row, value, True)
    allowed = engine.audit_allowances.get(row.quantity)
    if allowed is None or not np.allclose(value, row.value, rtol=allowed.relative, atol=ABSOLUTE):
        return AuditLine(*row, value, False)
    return AuditLine(*row, value, True, f"within the declared {100 * allowed.relative:g} %: {allowed.reason}")


def engine_rows(engine: SimEngine) -> list[AuditRow]:
    """What the engine says, in the rows of `world_rows`; quantities it does not report are left out."""
    world = engine.world
    rows: list[AuditRow] = []

    def add(quantity: str, names: list[str], values: Array) -> None:
        for name, value in zip(names, values, strict=True):
            rows.append(AuditRow(name, quantity, tuple(float(v) for v in np.atleast_1d(value))))

    moving = [i for i, body in enumerate(world.bodies) if body.kind is not BodyKind.STATIC]
    bodies = [world.bodies[i].name for i in moving]
    more = engine.read_back()
    inertials = {name: more[name] for name in INERTIALS if name in more}
    for name in engine.parameters.intersection(INERTIALS).difference(inertials):
        inertials[name] = engine.get_parameters(name, [0])[0]
    if len(inertials) == len(INERTIALS):
        mass = inertials["body.mass"]
        add("mass", bodies, mass[moving])
        add("centre of mass", bodies, inertials["body.com"][moving])
        tensors = [inertia.tensor(Inertial(1.0, inertia=tuple(i))) for i in inertials["body.inertia"][moving]]
        add("principal moments", bodies, np.array([np.sort(np.linalg.eigvalsh(t)) for t in tensors]).reshape(-1, 3))
        counted = np.where([body.kind is BodyKind.STATIC for body in world.bodies], 0.0, mass)
        totals = [counted[e.body_start : e.body_stop].sum() for e in world.entities]
        add("total mass", [e.name for e in world.entities], np.array(totals))
    joints = [joint.name for joint in world.joints]
    for quantity, parameter in (
        ("damping", "joint.damping"),
        ("dry friction", "joint.friction"),
        ("armature", "joint.armature"),
    ):
        if parameter in engine.parameters:
            add(quantity, joints, engine.get_parameters(parameter, [0])[0])
    if "actuator.effort_limit" in engine.parameters:
        names = [actuator.name for actuator in world.actuators]
        add("effort limit", names, engine.get_parameters("actuator.effort_limit", [0])[0])
    geoms = [geom.name for geom in world.geoms]
    if "geom.friction" in engine.parameters:
        add("friction", geoms, engine.get_parameters("geom.friction", [0])[0])
    if "joint.limits" in more:
        add("limits", joints, np.array([_ends(ends) for ends in more["joint.limits"]]).reshape(-1, 2))
    if "geom.volume" in more:
        add("volume", geoms, more["geom.volume"])
    return rows


def _axes_and_order(engine: SimEngine) -> list[AuditLine]:
    """What each joint does when it alone is moved; a follower is moved by its leader and has no row of its own."""
    world = engine.world
    lines: list[AuditLine] = []
    for i, joint in enumerate(world.joints):
        if joint.mimic is not None:
            continue
        engine.reset([0])
        before, start = engine.get_state().body_pose[0], engine.get_state().joint_pos[0, i]
        up, down = joint.upper - start, start - joint.lower
        room = min(PROBE, up) if up >= down else -min(PROBE, down)
        engine.set_joint_state([[start + room]], env_ids=[0], joints=[i])
        after = engine.get_state().body_pose[0]
        step = [P.compose(P.inverse(_in_parent(world, b, before)), _in_parent(world, b, after)) for b in _links(world)]
        size = {
            b: max(P.norm(s[:3]), P.norm(P.rotation_vector(s[3:]))) for b, s in zip(_links(world), step, strict=True)
        }
        moved = tuple(float(b) for b in _links(world) if size[b] > abs(room) / 1000)
        wanted = tuple(float(b) for b in sorted([joint.body, *_following(world, i)]))
        lines.append(AuditLine(joint.name, "moves", wanted, moved, moved == wanted))
        own = step[_links(world).index(joint.body)]
        axis = (own[:3] if joint.type is JointType.PRISMATIC else P.rotation_vector(own[3:])) / room
        same = bool(np.abs(axis - joint.axis).max() <= FRAME_TOLERANCE)
        lines.append(AuditLine(joint.name, "axis", joint.axis, tuple(float(v) for v in axis), same))
    engine.reset([0])
    return lines


def _links(world: World) -> list[int]:
    return [i for i, body in enumerate(world.bodies) if body.kind is BodyKind.LINK]


def _in_parent(world: World, body: int, poses: Array) -> Array:
    return P.compose(P.inverse(poses[world.bodies[body].parent]), poses[body])


def _following(world: World, joint: int) -> list[int]:
    """The bodies whose joints follow this one, also through others."""
    direct = [i for i, other in enumerate(world.joints) if other.mimic is not None and other.mimic.joint == joint]
    return [body for i in direct for body in (world.joints[i].body, *_following(world, i))]


def _frames(engine: SimEngine) -> list[AuditLine]:
    """Body frames at random joint positions within the limits, against the neutral forward kinematics."""
    world = engine.world
    if not world.joints:
        return []
    rng = np.random.default_rng(0)
    lower = np.array([max(j.lower, -np.pi) for j in world.joints])
    upper = np.array([min(j.upper, np.pi) for j in world.joints])
    here = engine.presence[0]
    leaders = np.array([i for i, j in enumerate(world.joints) if j.mimic is None and here[world.body_entity[j.body]]])
    if not len(leaders):
        return []
    worst = np.zeros((len(world.bodies), 2))
    for _ in range(CONFIGURATIONS):
        q = lower + (upper - lower) * rng.random(len(lower))
        engine.set_joint_state(q[leaders], np.zeros(len(leaders)), [0], leaders)
        state = engine.get_state()
        wanted = forward_kinematics(world, state.body_pose[:1], state.joint_pos[:1])[0]
        got = state.body_pose[0]
        distance = P.norm(got[:, :3] - wanted[:, :3])
        worst = np.maximum(worst, np.stack([distance, P.angle_between(got[:, 3:], wanted[:, 3:])], axis=1))
        asked = np.abs(state.joint_pos[0, leaders] - q[leaders]).max(initial=0.0)
        worst[[world.joints[j].body for j in leaders], 0] += asked if asked > FRAME_TOLERANCE else 0.0
    engine.reset([0])
    return [
        AuditLine(body.name, "frame", (0.0, 0.0), (float(p), float(a)), bool(max(p, a) <= FRAME_TOLERANCE))
        for body, (p, a) in zip(world.bodies, worst, strict=True)
        if body.kind is BodyKind.LINK
    ]
