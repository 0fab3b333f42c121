"""Cameras and contact sensors of a spec, looked up in the World they belong to."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from anysim.conventions import WORLD
from anysim.errors import Issues, NameLookupError, listing, suggest
from anysim.math import pose as P
from anysim.model.frames import find_bodies, find_frame
from anysim.model.hash import split
from anysim.model.slots import members
from anysim.model.world import Camera, ContactSensor, World
from anysim.randomization.distributions import nominal
from anysim_schemas.cameras import CameraSpec
from anysim_schemas.contact_sensors import ContactSensorSpec


def compile_camera(world: World, name: str, spec: CameraSpec, issues: Issues) -> Camera | None:
    """The camera, or None where a name does not exist; `issues` is at the camera's path."""
    if spec.mount is not None:
        try:
            frame = find_frame(world, spec.mount)
        except NameLookupError as error:
            issues.add("mount", str(error))
            return None
        local = P.pose(nominal(spec.position), P.from_roll_pitch_yaw(np.array(nominal(spec.roll_pitch_yaw))))
        body, looks_at = frame.body, None
        pose = P.compose(P.pose(frame.position, frame.quaternion), local)
    else:
        assert spec.from_ is not None  # the spec has either a mount or a view point
        body, looks_at = WORLD, spec.look_at if isinstance(spec.look_at, str) else None
        target = _target(world, spec, issues)
        if target is None:
            return None
        eye, target = np.array(nominal(spec.from_)), target + np.array(nominal(spec.look_at_offset))
        if np.linalg.norm(target - eye) < 1e-6:
            issues.add("look_at", "is where the camera is; move one of them")
            return None
        pose = np.concatenate([eye, P.look_at(eye, target)])
    position, quaternion = split(pose)
    return Camera(
        name,
        body,
        position,
        quaternion,
        float(nominal(spec.fov)),
        spec.size[0],
        spec.size[1],
        spec.channels,
        looks_at,
        spec.near,
        spec.far,
    )


def _target(world: World, spec: CameraSpec, issues: Issues) -> np.ndarray | None:
    if not isinstance(spec.look_at, str):
        return np.array(spec.look_at, dtype=float)
    slots = members(world, spec.look_at)
    if len(slots) == 1:  # where several things can be it, the one that is there is looked at from reset on
        return world.initial_body_pose[world.entities[slots[0].entities[0]].root, :3]
    if slots:
        which = listing([slot.name for slot in slots])
        issues.add("look_at", f"there are {len(slots)} of '{spec.look_at}'; look at one of them: {which}")
        return None
    names = list(world.logical_objects)
    known = f"{suggest(spec.look_at, names)} (objects: {listing(names)})"
    issues.add("look_at", f"there is no object '{spec.look_at}' to look at{known}")
    return None


def compile_contact_sensor(world: World, name: str, spec: ContactSensorSpec, issues: Issues) -> ContactSensor | None:
    """The sensor, or None where a name does not exist; `issues` is at the sensor's path."""
    found: dict[str, tuple[int, ...]] = {}
    for key, reference in (("body", spec.body), ("against", spec.against)):
        try:
            if reference is not None:
                found[key] = find_bodies(world, reference)
        except NameLookupError as error:
            issues.add(key, str(error))
    if "body" not in found or ("against" not in found and spec.against is not None):
        return None
    if found["body"] == (WORLD,):
        issues.add("body", "the ground has no contact sensor; sense the other body `against` it")
        return None
    return ContactSensor(name, found["body"], found.get("against"))


def with_sensors(
    world: World, cameras: Mapping[str, CameraSpec], sensors: Mapping[str, ContactSensorSpec], issues: Issues
) -> World:
    """The World with these cameras and contact sensors, in the order of the spec; `issues` is at the world's path."""
    made = [compile_camera(world, name, spec, issues.at("cameras", name)) for name, spec in cameras.items()]
    felt = [
        compile_contact_sensor(world, name, spec, issues.at("contact_sensors", name)) for name, spec in sensors.items()
    ]
    return replace(
        world, cameras=tuple(c for c in made if c is not None), contact_sensors=tuple(s for s in felt if s is not None)
    )
