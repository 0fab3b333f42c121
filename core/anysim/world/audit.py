"""What a World says in numbers, as flat rows: an engine's read-back is made into the same rows and compared.

A row is `(subject, quantity, value)`. Subjects are neutral names; values are floats or tuples of floats, in SI units.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from anysim.world import inertia
from anysim.world.model import Body, BodyKind, Entity, World
from anysim.world.shapes import is_ground


class AuditRow(NamedTuple):
    """One number (or a few) about one thing; the key of a comparison is (subject, quantity)."""

    subject: str
    quantity: str
    value: tuple[float, ...]


class Difference(NamedTuple):
    """A row that differs: `found` is None where it is missing, `expected` where it should not be there."""

    subject: str
    quantity: str
    expected: tuple[float, ...] | None
    found: tuple[float, ...] | None


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
        rows.append(AuditRow(joint.name, "limits", (joint.lower, joint.upper)))
        rows.append(AuditRow(joint.name, "damping", (joint.damping,)))
        rows.append(AuditRow(joint.name, "friction", (joint.friction,)))
        rows.append(AuditRow(joint.name, "armature", (joint.armature,)))
    for actuator in world.actuators:
        rows.append(AuditRow(actuator.name, "effort limit", (actuator.effort_limit,)))
    meshes = {mesh.name: mesh for mesh in world.meshes}
    for geom in world.geoms:
        if geom.collides and not is_ground(geom.shape):
            rows.append(AuditRow(geom.name, "volume", (inertia.volume(geom.shape, meshes),)))
            rows.append(AuditRow(geom.name, "friction", (geom.surface.friction,)))
    return rows


def moving_bodies(world: World, entity: Entity) -> list[Body]:
    """The bodies of an entity whose masses count: engines drop the mass of what cannot move."""
    return [b for b in world.bodies[entity.body_start : entity.body_stop] if b.kind is not BodyKind.STATIC]


def differences(
    expected: Iterable[AuditRow], found: Iterable[AuditRow], *, relative: float = 1e-6, absolute: float = 1e-9
) -> list[Difference]:
    """Rows whose values differ by more than `absolute + relative * |expected|`, or that only one side has.

    A quantity that the found side reports for no subject at all is skipped: an engine need not report everything.
    """
    wanted = {(row.subject, row.quantity): row.value for row in expected}
    have = {(row.subject, row.quantity): row.value for row in found}
    reported = {quantity for _, quantity in have}
    result: list[Difference] = []
    for key, value in wanted.items():
        other = have.pop(key, None)
        if other is None:
            if key[1] in reported:
                result.append(Difference(*key, value, None))
        elif len(value) != len(other) or not np.allclose(other, value, rtol=relative, atol=absolute):
            result.append(Difference(*key, value, other))
    result += [Difference(*key, None, value) for key, value in have.items()]
    return result
