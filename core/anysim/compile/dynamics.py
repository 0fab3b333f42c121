"""A robot's drives, joints, masses and surfaces as its world wants them, with the nominal value of what is drawn."""

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from typing import NamedTuple

import numpy as np

from anysim.errors import Issues, NameLookupError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.world import BodyKind, Entity, Inertial, Vec3, World
from anysim.randomization.distributions import nominal
from anysim_schemas.dynamics import PayloadSpec, RobotDynamicsSpec
from anysim_schemas.robots import RobotSpec


class Adjustment(NamedTuple):
    """A parameter of the engine, and the fields of a spec that scale it and that are added to it."""

    parameter: str
    scale: str
    offset: str | None = None

    @property
    def target(self) -> str:
        """The list of the World that it belongs to."""
        return self.parameter.partition(".")[0] + "s"

    @property
    def field(self) -> str:
        """The attribute of the World's thing."""
        return self.parameter.partition(".")[2]


ADJUSTMENTS = (
    Adjustment("actuator.kp", "kp_scale"),
    Adjustment("actuator.kd", "kd_scale"),
    Adjustment("actuator.effort_limit", "effort_limit_scale"),
    Adjustment("joint.damping", "damping_scale", "damping_offset"),
    Adjustment("joint.friction", "friction_scale", "friction_offset"),
    Adjustment("joint.armature", "armature_scale", "armature_offset"),
)
"""What is a factor and an offset of one number; masses and surfaces have rules of their own."""


def adjusted_indices(world: World, entity: Entity, adjustment: Adjustment) -> list[int]:
    """The drives or joints of a robot that an adjustment changes: of effort limits those that there are."""
    joints = range(entity.joint_start, entity.joint_stop)
    if adjustment.target == "joints":
        return list(joints)
    chosen = [i for i, a in enumerate(world.actuators) if a.joint in joints]
    return [i for i in chosen if isfinite(getattr(world.actuators[i], adjustment.field))]


def moving_links(world: World, entity: Entity) -> list[int]:
    """The bodies of a robot that have a mass that matters."""
    return [i for i in range(entity.body_start, entity.body_stop) if world.bodies[i].kind is not BodyKind.STATIC]


def touching_geoms(world: World, entity: Entity) -> list[int]:
    """The geoms of a robot that collide."""
    bodies = range(entity.body_start, entity.body_stop)
    return [i for i, g in enumerate(world.geoms) if g.body in bodies and g.collides]


class Payload(NamedTuple):
    """Where a payload is: its body, and the point in the body's frame, or None for the body's centre of mass."""

    body: int
    point: Vec3 | None


def find_payload(world: World, robot: str, spec: PayloadSpec) -> Payload:
    """The place of a payload.

    Raises:
        NameLookupError: the robot has no such link.
    """
    frame = find_frame(world, f"{robot}.{spec.link}")
    if spec.position is None:
        return Payload(frame.body, None)
    place = P.compose(P.pose(frame.position, frame.quaternion), P.pose(spec.position, (0.0, 0.0, 0.0, 1.0)))
    return Payload(frame.body, (float(place[0]), float(place[1]), float(place[2])))


def loaded(body: Inertial, mass: float, point: Vec3 | None) -> Inertial:
    """A body with a point mass more, or with one less where `mass` is negative."""
    return inertia.composed((body, Inertial(mass, body.com if point is None else point))) if mass else body


def with_dynamics(world: World, robots: Mapping[str, RobotSpec], issues: Issues) -> World:
    """The World with the nominal dynamics of its robots; `issues` is at the path of the robots."""
    for name, robot in robots.items():
        if robot.dynamics == RobotDynamicsSpec():
            continue
        entity = next(e for e in world.entities if e.name == name)
        world = _adjusted(world, entity, robot.dynamics, issues.at(name, "dynamics"))
        world = _weighed(world, entity, robot.dynamics, issues.at(name, "dynamics"))
    return world


def _adjusted(world: World, entity: Entity, spec: RobotDynamicsSpec, issues: Issues) -> World:
    for adjustment in ADJUSTMENTS:
        scale = float(nominal(getattr(spec, adjustment.scale)))
        offset = 0.0 if adjustment.offset is None else float(nominal(getattr(spec, adjustment.offset)))
        if (scale, offset) == (1.0, 0.0):
            continue
        things = list(getattr(world, adjustment.target))
        for i in adjusted_indices(world, entity, adjustment):
            value = getattr(things[i], adjustment.field) * scale + offset
            if value < 0:
                issues.add(
                    adjustment.offset or adjustment.scale,
                    f"leaves '{things[i].name}' a {adjustment.field.replace('_', ' ')} of {value:g}; it must not be "
                    "negative",
                )
            things[i] = replace(things[i], **{adjustment.field: value})
        world = replace(world, **{adjustment.target: tuple(things)})
    return world


def _weighed(world: World, entity: Entity, spec: RobotDynamicsSpec, issues: Issues) -> World:
    bodies, geoms = list(world.bodies), list(world.geoms)
    factor, grip = float(nominal(spec.mass_scale)), float(nominal(spec.link_friction_scale))
    if factor != 1.0:
        for i in moving_links(world, entity):
            bodies[i] = replace(bodies[i], inertial=inertia.scaled(bodies[i].inertial, factor))
    if grip != 1.0:
        for i in touching_geoms(world, entity):
            surface = geoms[i].surface
            geoms[i] = replace(geoms[i], surface=replace(surface, friction=surface.friction * grip))
    if spec.payload is not None:
        try:
            place = find_payload(world, entity.name, spec.payload)
        except NameLookupError as error:
            issues.add("payload.link", str(error))
            return world
        body = bodies[place.body]
        if body.kind is BodyKind.STATIC:
            issues.add("payload.link", f"'{body.name}' does not move: nothing feels its payload; choose another")
        bodies[place.body] = replace(
            body, inertial=loaded(body.inertial, float(nominal(spec.payload.mass)), place.point)
        )
    return replace(world, bodies=tuple(bodies), geoms=tuple(geoms))


def inertial_arrays(inertials: list[Inertial]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masses (K,), centres of mass (K, 3) and inertias (K, 6)."""
    return (
        np.array([i.mass for i in inertials]),
        np.array([i.com for i in inertials]),
        np.array([i.inertia for i in inertials]),
    )
