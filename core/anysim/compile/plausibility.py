"""Bounds of what a World holds, as `anysim_schemas.bounds` states them: sizes, masses and places."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import Issues
from anysim.geometry.bounds import shape_bounds
from anysim.kinematics.inertia import Inertial, tensor
from anysim.math import matrix as M
from anysim.model.shapes import is_ground
from anysim.model.world import BodyKind, EntityKind, Mesh, Shape, World
from anysim_schemas.bounds import LENGTH, MASS, MOMENT

_HERE = np.array([0.0, 0.0, 0.0, *IDENTITY_QUATERNION])


def size_problem(shape: Shape, meshes: Mapping[str, Mesh]) -> str:
    """Why a shape is too small or too large, in words that follow its name; empty if it is neither."""
    if is_ground(shape):
        return ""
    low, high = shape_bounds(shape, _HERE, meshes)
    edges = (high - low).tolist()
    wrong = next((edge for edge in edges if not LENGTH.holds(edge)), None)
    return "" if wrong is None else f"one of its sizes {LENGTH.sentence(wrong)}"


def inertial_problem(inertial: Inertial) -> str:
    """Why nothing that moves can have a mass or an inertia, in words that follow its name; empty if it can."""
    if not MASS.holds(inertial.mass):
        return f"its mass {MASS.sentence(inertial.mass)}"
    matrix = tensor(inertial)
    if not np.isfinite(matrix).all():
        return "its inertia is not finite"
    wrong = [moment for moment in M.eigen(matrix)[0].tolist() if not MOMENT.holds(moment)]
    return f"one of its moments of inertia {MOMENT.sentence(wrong[0])}" if wrong else ""


def check_places(world: World, issues: Issues) -> None:
    """See that everything begins inside of the world; `issues` is at its path."""
    extent = world.physics.extent
    for entity in world.entities:
        for body in world.bodies[entity.body_start : entity.body_stop]:
            if body.kind is BodyKind.LINK or max(map(abs, body.position)) <= extent:
                continue
            robot = entity.kind is EntityKind.ROBOT
            name = entity.category or entity.name
            far = max(map(abs, body.position))
            path = f"robots.{name}.position" if robot else f"layout.{name}"
            issues.add(
                path,
                f"'{entity.name}' begins {far:.3g} m from the origin, beyond the world's end at {extent:g} m; "
                f"put it nearer, or raise physics.extent",
            )
            break
