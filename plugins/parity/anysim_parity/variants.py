"""Worlds made from one, in which a layer can be measured without the layers above it."""

from dataclasses import replace
from math import inf

from anysim.compile.edit import unseen, without_entity
from anysim.model.world import Actuator, Body, BodyKind, ControlMode, Joint, Physics, World


def mechanisms(world: World) -> World:
    """What has joints and nothing else, each on a held base and without any shape: nothing can touch anything."""
    world = unseen(world)
    for entity in world.entities:
        if entity.joint_start == entity.joint_stop:
            world = without_entity(world, entity.name)
    return replace(
        world,
        name=f"{world.name}: mechanisms",
        bodies=tuple(_held(body) for body in world.bodies),
        geoms=(),
        meshes=(),
        heightfields=(),
        excluded_pairs=frozenset(),
    )


def nominal_population(world: World) -> World:
    """With the entities alone that are there before anything is drawn: the same in every env, for any engine."""
    gone = [e.name for e, there in zip(world.entities, world.initial_presence, strict=True) if not there]
    standing = {slot.name: world.entities[slot.entities[0]].name for slot in world.slots if slot.initially}
    cameras = tuple(replace(c, look_at=standing.get(c.look_at or "", c.look_at)) for c in world.cameras)
    world = replace(world, cameras=cameras)
    for name in gone:
        world = without_entity(world, name)
    return replace(world, slots=())


def loose(world: World) -> World:
    """The mechanisms without gravity, damping, friction, limits and couplings; an effort drive on every joint.

    What a unit effort does in one step from rest is then a column of the inverse mass matrix.
    """
    world = mechanisms(world)
    p = world.physics
    return replace(
        world,
        name=f"{world.name}, loose",
        joints=tuple(_loose(joint) for joint in world.joints),
        actuators=tuple(Actuator(joint.name, i, ControlMode.EFFORT, 0.0, 0.0) for i, joint in enumerate(world.joints)),
        robots=(),
        physics=Physics(p.dt, p.dt, (0.0, 0.0, 0.0), p.friction_cone, p.impratio),
    )


def _held(body: Body) -> Body:
    return replace(body, kind=BodyKind.STATIC) if body.kind is BodyKind.FREE else body


def _loose(joint: Joint) -> Joint:
    return replace(
        joint, damping=0.0, friction=0.0, lower=-inf, upper=inf, velocity_limit=inf, effort_limit=inf, mimic=None
    )
