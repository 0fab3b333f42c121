"""Audit: read a world back from a live engine and compare it with the World it was built from.

Native importers and builders change things in silence. Here the engine's own numbers are made into the same rows as the
World's, and its body frames are compared with the neutral forward kinematics at random joint positions, which also
finds a wrong order of bodies or joints.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.math import pose as P
from anysim.world import inertia
from anysim.world.audit import AuditRow, world_rows
from anysim.world.kinematics import forward_kinematics
from anysim.world.model import BodyKind, Inertial

CONFIGURATIONS = 20
INERTIALS = ("body.mass", "body.com", "body.inertia")
RELATIVE, ABSOLUTE = 1e-5, 1e-8
"""Engines in single precision keep six digits."""
FRAME_TOLERANCE = 1e-5
"""[m] and [rad], largest difference of a body frame over all configurations."""


class AuditLine(NamedTuple):
    """One comparison. `found` is empty where the engine does not report the quantity; then `ok` is None."""

    subject: str
    quantity: str
    expected: tuple[float, ...]
    found: tuple[float, ...]
    ok: bool | None


def audit(engine: SimEngine) -> list[AuditLine]:
    """Compare masses, centres, moments, limits, joint constants, volumes and frames of env 0. The engine is reset."""
    engine.reset([0])
    expected = world_rows(engine.world)
    found = {(row.subject, row.quantity): row.value for row in engine_rows(engine)}
    lines = []
    for row in expected:
        value = found.get((row.subject, row.quantity), ())
        same = len(value) == len(row.value) and bool(np.allclose(value, row.value, rtol=RELATIVE, atol=ABSOLUTE))
        lines.append(AuditLine(row.subject, row.quantity, row.value, value, same if value else None))
    return lines + _frames(engine)


def engine_rows(engine: SimEngine) -> list[AuditRow]:
    """What the engine says, in the rows of `anysim.world.audit`; quantities it does not report are left out."""
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
        ("friction", "joint.friction"),
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
        add("limits", joints, more["joint.limits"])
    if "geom.volume" in more:
        add("volume", geoms, more["geom.volume"])
    return rows


def _frames(engine: SimEngine) -> list[AuditLine]:
    """Body frames at random joint positions within the limits, against the neutral forward kinematics."""
    world = engine.world
    if not world.joints:
        return []
    rng = np.random.default_rng(0)
    lower = np.array([max(j.lower, -np.pi) for j in world.joints])
    upper = np.array([min(j.upper, np.pi) for j in world.joints])
    leaders = np.array([i for i, j in enumerate(world.joints) if j.mimic is None])
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
