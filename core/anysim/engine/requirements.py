"""What a world needs of an engine, each need with the name that causes it."""

from math import isfinite

from anysim.compile.lights import DEFAULT_LIGHTS
from anysim.engine.capability import Capability, Need
from anysim.model.world import Actuation, BodyKind, ControlMode, HeightFieldShape, MeshShape, Plane, World


def needs_of(world: World) -> list[Need]:
    """Every capability the world needs, once, with the first thing that needs it."""
    found: dict[Capability, str] = {}

    def need(capability: Capability, why: str) -> None:
        found.setdefault(capability, why)

    for body in world.bodies:
        if body.kind is BodyKind.FREE:
            need(Capability.RIGID_BODIES, f"body '{body.name}' is free")
        elif body.kind is BodyKind.LINK:
            need(Capability.ARTICULATIONS, f"body '{body.name}' is a link")
        if body.gravity_compensation:
            need(Capability.GRAVITY_COMPENSATION, f"body '{body.name}' is gravity compensated")
        if any(body.damping):
            need(Capability.BODY_DAMPING, f"body '{body.name}' is damped")
        if body.solver is not None:
            need(
                Capability.SOLVER_SETTINGS,
                f"body '{body.name}' has `solver` settings of its own; `engine.options` has those of a whole engine",
            )
    for joint in world.joints:
        what = f"joint '{joint.name}'"
        if joint.mimic is not None:
            need(Capability.MIMIC_JOINTS, f"{what} follows '{world.joints[joint.mimic.joint].name}'")
        if joint.friction > 0:
            need(Capability.JOINT_FRICTION, f"{what} has dry friction")
        if joint.armature > 0:
            need(Capability.ARMATURE, f"{what} has armature")
        if isfinite(joint.lower) or isfinite(joint.upper):
            need(Capability.JOINT_LIMITS, f"{what} is limited")
    for actuator in world.actuators:
        capability = {
            ControlMode.POSITION: Capability.CONTROL_POSITION,
            ControlMode.VELOCITY: Capability.CONTROL_VELOCITY,
            ControlMode.EFFORT: Capability.CONTROL_EFFORT,
        }[actuator.mode]
        need(capability, f"drive '{actuator.name}' is {actuator.mode} controlled")
        if isfinite(actuator.effort_limit):
            need(Capability.EFFORT_LIMITS, f"drive '{actuator.name}' is limited")
    needed_by_mode = {
        Actuation.EXPLICIT_PD: Capability.ACTUATION_EXPLICIT,
        Actuation.NATIVE: Capability.ACTUATION_NATIVE,
    }
    if world.actuators and world.physics.actuation in needed_by_mode:
        need(needed_by_mode[world.physics.actuation], f"physics.actuation is {world.physics.actuation}")
    if world.physics.velocity_limits:
        for actuator in world.actuators:
            if isfinite(world.joints[actuator.joint].velocity_limit):
                need(Capability.VELOCITY_LIMITS, f"drive '{actuator.name}' heeds its joint's velocity limit")
    for geom in world.geoms:
        what = f"geom '{geom.name}'"
        if not geom.collides:
            continue
        need(Capability.CONTACTS, f"{what} collides")
        if isinstance(geom.shape, Plane):
            need(Capability.TERRAIN_PLANE, f"{what} is a plane")
        elif isinstance(geom.shape, HeightFieldShape):
            need(Capability.TERRAIN_HEIGHTFIELD, f"{what} is a height field")
        elif isinstance(geom.shape, MeshShape) and geom.shape.concave:
            need(
                Capability.TERRAIN_TRIMESH,
                f"{what} is a triangle mesh; `kind: heightfield` with the same `file` is its heights seen from above",
            )
        elif isinstance(geom.shape, MeshShape):
            need(Capability.SHAPE_MESH, f"{what} is a mesh")
        if geom.surface.restitution > 0:
            need(Capability.RESTITUTION, f"{what} bounces")
        if geom.surface.contact_offset is not None:
            need(Capability.CONTACT_OFFSET, f"{what} has a contact offset")
        if geom.surface.torsional:
            need(Capability.TORSIONAL_FRICTION, f"{what} has torsional friction")
    for slot in world.slots:
        need(Capability.VARYING_ENTITIES, f"'{slot.name}' is not the same in every env")
    for sensor in world.contact_sensors:
        need(Capability.CONTACT_SENSORS, f"contact sensor '{sensor.name}'")
    shows = [camera.name for camera in world.cameras if "rgb" in camera.channels]
    several = len(world.lights) > 1 or any(light.position is not None for light in world.lights)
    if shows and several and world.lights != DEFAULT_LIGHTS:
        need(Capability.RENDER_LIGHTS, f"camera '{shows[0]}' shows {len(world.lights)} lights")
    if shows and world.scenery.shadows:
        need(Capability.RENDER_SHADOWS, f"camera '{shows[0]}' shows shadows")
    for camera in world.cameras:
        for channel in camera.channels:
            need(Capability(f"render: {channel}"), f"camera '{camera.name}' gives {channel}")
        if "rgb" in camera.channels and world.textures:
            need(Capability.TEXTURES, f"camera '{camera.name}' sees the texture '{world.textures[0].name}'")
        if "rgb" in camera.channels and world.materials:
            need(Capability.MATERIALS, f"camera '{camera.name}' sees the material '{world.materials[0].name}'")
    return [Need(capability, why) for capability, why in found.items()]
