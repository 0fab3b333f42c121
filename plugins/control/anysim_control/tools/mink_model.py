"""A robot of a World as a MuJoCo model for kinematics alone: bodies, joints, sites and inertias, no geometry."""

from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.kinematics.inertia import tensor
from anysim.model.world import JointType, World


def kinematic_model(world: World, robot: str) -> mujoco.MjModel:
    """The model: the base stands at the origin, floating or not, so poses are in the base's frame.

    Joints and bodies have the names and the order of the World's, sites too. `qpos` is (J,).

    Raises:
        NameLookupError: the World has no such robot.
    """
    entity = next((e for e in world.entities if e.name == robot), None)
    if entity is None:
        known = [r.name for r in world.robots]
        raise NameLookupError(f"there is no robot '{robot}'{suggest(robot, known)} (robots: {listing(known)})")
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    # A frame without mass is what it is: nothing is simulated here.
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-9, 1e-12
    made: dict[int, Any] = {}
    for number in range(entity.body_start, entity.body_stop):
        body = world.bodies[number]
        if number == entity.root:
            made[number] = spec.worldbody.add_body(name=body.name)
        else:
            made[number] = made[body.parent].add_body(name=body.name, pos=body.position, quat=_wxyz(body.quaternion))
            _add_joint(made[number], world, world.body_joint[number])
        _add_inertia(made[number], world, number)
    for site in world.sites:
        if site.body in made:
            made[site.body].add_site(name=site.name, pos=site.position, quat=_wxyz(site.quaternion))
    return spec.compile()


def _add_joint(body: Any, world: World, index: int) -> None:
    joint = world.joints[index]
    slides = joint.type is JointType.PRISMATIC
    limited = bool(np.isfinite(joint.lower) and np.isfinite(joint.upper))
    body.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        pos=joint.anchor,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE,
        range=(joint.lower, joint.upper) if limited else (0.0, 0.0),
    )


def _add_inertia(body: Any, world: World, number: int) -> None:
    inertial = world.bodies[number].inertial
    if inertial.mass <= 0.0:
        return
    matrix = tensor(inertial)
    body.explicitinertial = True
    body.mass, body.ipos = inertial.mass, inertial.com
    body.fullinertia = [matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2]]


def _wxyz(quaternion: Array | tuple[float, ...]) -> list[float]:
    """MuJoCo's order."""
    x, y, z, w = (float(c) for c in quaternion)
    return [w, x, y, z]
