"""A Panda that presses a link or its fingers against a fixed block, and what the contact says its drives exert."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from anysim.api import compile_world
from anysim.conventions import WORLD, Array
from anysim.engine.base import SimEngine
from anysim.math import pose as P
from anysim.model.world import Actuation, Box, ContactSensor, Geom, Mesh, MeshShape, Quat, Surface, World

SMOOTH = Surface(friction=0.0)
GAP = 0.002
"""[m] that a link is away from the block that it presses on."""

HOLDING = {"kp": 20000.0, "kd": 2000.0, "effort_limit": np.inf}
"""Drives of the joints that only hold still."""

BASE = {"world": {"robots": {"panda": {"robot": "franka_panda", "position": [0.0, 0.0, 0.5]}}}}


class Press(NamedTuple):
    """A world, the actuators that press, the sense in which they do, and the efforts (K,) that the contact shows."""

    world: World
    actuators: tuple[int, ...]
    sense: float
    efforts: Callable[[SimEngine], Array]


def panda(actuation: Actuation = Actuation.IMPLICIT_PD, dt: float = 0.002) -> World:
    """The catalogue's Panda at home, its base half a metre up, nothing else."""
    world = compile_world(BASE)
    return replace(world, physics=replace(world.physics, dt=dt, control_dt=10 * dt, actuation=actuation))


def arm_joint(joint: int, actuation: Actuation = Actuation.IMPLICIT_PD) -> Press:
    """Joint number `joint` (0 to 6) turns its own link against a smooth block, far from its axis.

    Only this link collides, and the other joints hold whatever it takes. The effort is the moment of the sensor's force
    about the joint; its line of action passes through the middle of the contact points.
    """
    world = panda(actuation)
    moved = world.joints[joint]
    pose = world.initial_body_pose[moved.body]
    axis, anchor = P.rotate(pose[3:], np.array(moved.axis)), _place(pose, np.array(moved.anchor))
    points = np.concatenate([_corners(world, g, pose) for g in world.geoms if g.body == moved.body and g.collides])
    # of all directions about the axis the one in which the link's outermost corner has the longest lever
    side = np.linalg.svd(axis[None])[2][1]
    angles = np.linspace(0.0, 2 * np.pi, 72, endpoint=False)[:, None]
    ways = np.cos(angles) * side + np.sin(angles) * np.cross(axis, side)
    touch = points[np.argmax(points @ ways.T, axis=0)]
    best = int(np.argmax(np.cross(touch - anchor, ways) @ axis))
    way, half = ways[best], (0.02, 0.05, 0.05)
    turn = _quat(P.from_matrix(np.stack([way, np.cross(axis, way), axis], axis=1)))
    world = replace(
        world,
        geoms=tuple(replace(g, surface=SMOOTH, collides=g.collides and g.body == moved.body) for g in world.geoms),
        actuators=tuple(a if a.joint == joint else replace(a, **HOLDING) for a in world.actuators),
    )
    world = _with_fixed(world, Box(half), touch[best] + (half[0] + GAP) * way, turn, (moved.body,))

    def efforts(engine: SimEngine) -> Array:
        state, points = engine.get_state(), engine.contacts()
        now = state.body_pose[0, moved.body]
        size = np.linalg.norm(points.force, axis=1)
        if not size.sum():
            return np.zeros(1)
        middle = size @ points.position / size.sum()
        arm = np.cross(P.rotate(now[3:], np.array(moved.axis)), middle - _place(now, np.array(moved.anchor)))
        return np.array([-arm @ state.contact_force[0, 0]])

    number = next(i for i, a in enumerate(world.actuators) if a.joint == joint)
    return Press(world, (number,), 1.0, efforts)


def fingers(actuation: Actuation = Actuation.IMPLICIT_PD) -> Press:
    """Both fingers close on a smooth fixed block that they touch at home, each from its side."""
    world = panda(actuation)
    joints = tuple(j for j, joint in enumerate(world.joints) if "finger" in joint.name)
    poses = world.initial_body_pose
    ways, touch = [], []
    for j in joints:
        pose = poses[world.joints[j].body]
        opening = P.rotate(pose[3:], np.array(world.joints[j].axis))
        points = np.concatenate([_corners(world, g, pose) for g in world.geoms if g.body == world.joints[j].body])
        pad = points[points[:, 2] < points[:, 2].min() + 0.01]  # the hand points down; what is lowest is the tip
        ways.append(opening)
        touch.append(pad[np.argmin(pad @ opening)])
    gap = float(abs((touch[0] - touch[1]) @ ways[0]))
    across = np.cross(ways[0], [0.0, 0.0, 1.0])
    turn = _quat(P.from_matrix(np.stack([across, ways[0], [0.0, 0.0, 1.0]], axis=1)))
    centre = 0.5 * (touch[0] + touch[1])
    world = replace(world, geoms=tuple(replace(g, surface=SMOOTH) for g in world.geoms))
    bodies = tuple(world.joints[j].body for j in joints)
    world = _with_fixed(world, Box((0.02, 0.5 * gap - GAP, 0.01)), centre, turn, bodies)

    def efforts(engine: SimEngine) -> Array:
        forces = engine.get_state().contact_force[0]
        return np.array([-way @ force for way, force in zip(ways, forces, strict=True)])

    numbers = tuple(next(i for i, a in enumerate(world.actuators) if a.joint == j) for j in joints)
    return Press(world, numbers, -1.0, efforts)


def _place(pose: Array, point: Array) -> Array:
    return pose[:3] + P.rotate(pose[3:], point)


def _corners(world: World, geom: Geom, pose: Array) -> Array:
    """World positions (V, 3) of the corners of a mesh or box on a body at `pose`."""
    if isinstance(geom.shape, MeshShape):
        meshes: dict[str, Mesh] = {mesh.name: mesh for mesh in world.meshes}
        points = np.asarray(meshes[geom.shape.mesh].vertices, dtype=float)
    else:
        assert isinstance(geom.shape, Box)
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * geom.shape.half_size
    whole = P.compose(pose, np.array([*geom.position, *geom.quaternion]))
    return whole[:3] + P.rotate(np.broadcast_to(whole[3:], (len(points), 4)), points)


def _quat(quaternion: Array) -> Quat:
    x, y, z, w = quaternion.tolist()
    return (x, y, z, w)


def _with_fixed(world: World, shape: Box, place: Array, turn: Quat, pressed: tuple[int, ...]) -> World:
    """A smooth fixed block, and a contact sensor for each body that presses on it."""
    position = (float(place[0]), float(place[1]), float(place[2]))
    return replace(
        world,
        geoms=(*world.geoms, Geom("post", WORLD, shape, position, turn, surface=SMOOTH)),
        contact_sensors=tuple(ContactSensor(f"press{b}", (b,), (WORLD,)) for b in pressed),
    )
