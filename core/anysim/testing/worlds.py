"""The worlds of the contract suite: small enough to know the answers by hand."""

from dataclasses import replace
from math import cos, inf, pi, sin
from typing import Any

import numpy as np

from anysim.conventions import WORLD
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.requirements import needs_of
from anysim.math import pose as P
from anysim.model.world import (
    Actuation,
    Box,
    Camera,
    ContactSensor,
    ControlMode,
    Geom,
    HeightField,
    HeightFieldShape,
    Inertial,
    JointType,
    Light,
    Mesh,
    MeshShape,
    Mimic,
    Quat,
    Scenery,
    Shape,
    Site,
    Sphere,
    Surface,
    Vec3,
    World,
)
from anysim.testing.sketch import ORIGIN, Sketch, inertial

REVOLUTE, PRISMATIC = JointType.REVOLUTE, JointType.PRISMATIC
X: Vec3 = (1.0, 0.0, 0.0)
Y: Vec3 = (0.0, 1.0, 0.0)
Z: Vec3 = (0.0, 0.0, 1.0)
WEIGHTLESS: Vec3 = ORIGIN
SMOOTH = Surface(friction=0.0)


def turn(axis: Vec3, angle: float) -> Quat:
    """The quaternion of a rotation."""
    x, y, z, w = (float(v) for v in P.from_axis_angle(np.array(axis), np.array(angle)))
    return (x, y, z, w)


# ---------------------------------------------------------------------- the everyday scene


def scene(cameras: bool = False, sensor: bool = False) -> World:
    """A driven two-link arm, a box, a ball that falls on it, and a fixed table, on the ground.

    It asks for no more than any engine should have; cameras and a contact sensor on the box are extra.
    """
    s = Sketch("scene")
    s.ground()
    _arm(s, position=(0.0, 0.0, 0.3))
    s.fixed("table", Box((0.2, 0.2, 0.05)), (0.8, 0.0, 0.05))
    box = s.free("box", Box((0.1, 0.1, 0.1)), (0.8, 0.0, 0.201), 2.0)
    s.free("ball", Sphere(0.05), (0.83, 0.02, 0.37), 0.5)
    if sensor:
        s.sensors.append(ContactSensor("box", (box,)))
    if cameras:
        eye, middle = (0.8, -2.0, 0.6), (0.8, 0.0, 0.2)
        channels = ("rgb", "depth", "segmentation")
        s.cameras.append(Camera("front", WORLD, eye, _looking(eye, middle), 50.0, 64, 48, channels))
    return s.world()


def lit(cameras: bool = False) -> World:
    """The scene with a light from far away and one from a place, and surroundings of its own."""
    lights = (
        Light("sun", (0.0, 0.6, -0.8), None, (1.0, 0.9, 0.8), 0.6),
        Light("lamp", (0.0, 0.0, -1.0), (0.0, 0.5, 2.0), (0.5, 0.6, 1.0), 0.3),
    )
    return replace(scene(cameras), lights=lights, scenery=Scenery((0.2, 0.3, 0.5), (0.3, 0.3, 0.4), False))


def _arm(s: Sketch, position: Vec3 = ORIGIN) -> None:
    """Two links of 0.3 m; the shoulder turns about z, the elbow about y, each with a drive."""
    rod = Box((0.15, 0.02, 0.02))
    bar = inertial(rod, 1.0, (0.15, 0.0, 0.0))
    motor: dict[str, Any] = {"damping": 0.1, "armature": 0.01, "velocity_limit": 3.0}
    base = s.robot("arm", position)
    upper = s.link("shoulder", base, REVOLUTE, Z, bar, lower=-2.0, upper=2.0, initial=0.2, **motor)
    lower = s.link("elbow", upper, REVOLUTE, Y, bar, position=(0.3, 0.0, 0.0), lower=-1.5, upper=1.5, **motor)
    for link in (upper, lower):
        s.shape(link, rod, (0.15, 0.0, 0.0))
        s.drive(link, ControlMode.POSITION, 60.0, 6.0, 40.0)
    s.sites.append(Site("arm.tool", lower, (0.3, 0.0, 0.0)))


def _looking(eye: Vec3, target: Vec3) -> Quat:
    x, y, z, w = (float(v) for v in P.look_at(np.array(eye), np.array(target)))
    return (x, y, z, w)


# ---------------------------------------------------------------------- free bodies


def falling_ball(height: float = 10.0, dt: float = 0.002) -> World:
    """A ball and nothing to land on."""
    s = Sketch("falling_ball", dt)
    s.free("ball", Sphere(0.1), (0.0, 0.0, height))
    return s.world()


def drifting(com: Vec3 = ORIGIN, count: int = 1, gravity: Vec3 = WEIGHTLESS, dt: float = 0.002) -> World:
    """Boxes without contacts; the centre of mass may lie off the frame's origin."""
    s = Sketch("drifting", dt, gravity)
    shape = Box((0.1, 0.2, 0.3))
    for i in range(count):
        s.free(f"box{i}", shape, (2.0 * i, 0.0, 1.0), 2.0, com=com, collides=False)
    return s.world()


def loose() -> World:
    """Free bodies with their centres off their frames, and a fixed post, under gravity; nothing collides.

    The everyday scene of engines without joints or contacts, in which every engine of rigid bodies is exact.
    """
    s = Sketch("loose")
    s.fixed("post", Box((0.1, 0.1, 1.0)), (-2.0, 0.0, 1.0), collides=False)
    s.free("box", Box((0.1, 0.2, 0.3)), (0.0, 0.0, 4.0), 2.0, com=(0.05, -0.02, 0.1), collides=False)
    s.free("ball", Sphere(0.05), (1.0, 0.0, 5.0), 0.5, collides=False)
    s.free("slab", Box((0.4, 0.3, 0.02)), (2.0, 0.0, 6.0), 1.0, quaternion=turn(X, 0.7), collides=False)
    return s.world()


def everyday(capabilities: Capabilities, cameras: bool = False) -> World:
    """The scene, or the loose bodies for an engine that lacks joints or contacts."""
    whole = scene(cameras)
    return whole if all(need.capability in capabilities for need in needs_of(whole)) else loose()


def buildable(engine: SimEngine, cameras: bool = False) -> World:
    """The everyday world; for an engine that refuses it a falling ball, and for one without free bodies a pendulum."""
    if Capability.RIGID_BODIES not in engine.capabilities:
        return pendulum()
    whole = everyday(engine.capabilities, cameras)
    return falling_ball() if engine.refusals(whole, engine.options) else whole


def spinning_ball(dt: float = 0.002) -> World:
    """One sphere without gravity: its inertia is the same about every axis."""
    s = Sketch("spinning_ball", dt, WEIGHTLESS)
    s.free("ball", Sphere(0.2), (0.0, 0.0, 0.0), 2.0, collides=False)
    return s.world()


def colliding(restitution: float, dt: float = 0.001) -> World:
    """Two smooth spheres of 1 and 2 kg on the x axis, 0.3 m between their surfaces, without gravity."""
    s = Sketch("colliding", dt, WEIGHTLESS)
    surface = Surface(friction=0.0, restitution=restitution)
    s.free("left", Sphere(0.1), (-0.25, 0.0, 0.0), 1.0, surface=surface)
    s.free("right", Sphere(0.1), (0.25, 0.0, 0.0), 2.0, surface=surface)
    return s.world()


# ---------------------------------------------------------------------- bodies on the ground


def resting(shape: Shape, height: float, mass: float = 1.0, gap: float = 0.0, inertia: Inertial | None = None) -> World:
    """One body on the ground, its origin at `height` + `gap`, with a contact sensor."""
    s = Sketch("resting")
    s.ground()
    body = s.free("thing", shape, (0.0, 0.0, height + gap), mass, inertia=inertia)
    s.sensors.append(ContactSensor("thing", (body,)))
    return s.world()


def resting_mesh(half: float = 0.1) -> World:
    """A cube given as a mesh, whose frame is in its lower corner."""
    s = Sketch("resting_mesh")
    s.ground()
    corners = np.array([[x, y, z] for x in (0.0, 2 * half) for y in (0.0, 2 * half) for z in (0.0, 2 * half)])
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
    s.more["meshes"] = (Mesh("cube", corners, np.array(faces, dtype=np.int32), "contract-cube"),)
    cube = inertial(Box((half, half, half)), 1.0, (half, half, half))
    s.free("thing", MeshShape("cube"), (0.0, 0.0, 0.002), inertia=cube)
    return s.world()


def on_heightfield() -> World:
    """A ball above the flat top (z = 0.5, x > 0) of a field whose other half is at z = 0.1."""
    s = Sketch("on_heightfield")
    heights = np.full((21, 21), 0.1)
    heights[:, 11:] = 0.5
    s.more["heightfields"] = (HeightField("steps", heights, (4.0, 4.0)),)
    s.geoms.append(Geom("terrain", WORLD, HeightFieldShape("steps")))
    s.free("high", Sphere(0.1), (1.0, 0.5, 0.61))
    s.free("low", Sphere(0.1), (-1.0, 0.5, 0.21))
    return s.world()


def slope(angle: float, friction: float, other: float = 0.0) -> World:
    """A box lying on a tilted static slab; the slab's friction is `other`, so the pair's is the larger of the two.

    The box starts in touch with the slab; downhill is +x turned by `angle` about y.
    """
    s = Sketch("slope", 0.001)
    tilt = turn(Y, angle)
    s.fixed("slab", Box((3.0, 1.0, 0.1)), (0.0, 0.0, 0.0), quaternion=tilt, surface=Surface(friction=other))
    up = 0.1 + 0.05
    s.free(
        "box",
        Box((0.1, 0.1, 0.05)),
        (up * sin(angle), 0.0, up * cos(angle)),
        quaternion=tilt,
        surface=Surface(friction=friction),
    )
    return s.world()


def bouncing_ball(restitution: float, height: float = 0.5, dt: float = 0.001) -> World:
    """A ball of radius 0.1 m whose underside is `height` above the ground; the ground itself does not bounce."""
    s = Sketch("bouncing_ball", dt)
    s.ground()
    s.free("ball", Sphere(0.1), (0.0, 0.0, 0.1 + height), surface=Surface(restitution=restitution))
    return s.world()


# ---------------------------------------------------------------------- joints


def pendulum(length: float = 0.5, dt: float = 0.001, damping: float = 0.0) -> World:
    """A ball on a massless rod. The link's frame is at the ball, turned, and the hinge is an offset anchor.

    Its axis is the world's y; at zero it hangs straight down from 2 m.
    """
    s = Sketch("pendulum", dt)
    base = s.robot("pendulum", (0.0, 0.0, 2.0))
    bob = inertial(Sphere(0.05), 0.7)
    # the frame is turned by 90 degrees about x: its y axis is the world's z, its -z axis the world's y
    s.link(
        "bob",
        base,
        REVOLUTE,
        (0.0, 0.0, -1.0),
        bob,
        position=(0.0, 0.0, -length),
        quaternion=turn(X, pi / 2),
        anchor=(0.0, length, 0.0),
        damping=damping,
    )
    return s.world()


def double_pendulum(dt: float = 0.0005) -> World:
    """Two rods of 0.4 m that swing about y without damping."""
    s = Sketch("double_pendulum", dt)
    rod = Box((0.02, 0.02, 0.2))
    bar = inertial(rod, 1.0, (0.0, 0.0, -0.2))
    base = s.robot("chain", (0.0, 0.0, 2.0))
    upper = s.link("upper", base, REVOLUTE, Y, bar, initial=1.2)
    s.link("lower", upper, REVOLUTE, Y, bar, position=(0.0, 0.0, -0.4), initial=0.4)
    return s.world()


def tree(gravity: Vec3 = WEIGHTLESS) -> World:
    """Two branches from one base, mixed joint types, turned and shifted frames; and a free box before and after.

    Depth first: base, a1, a2, b1, b2, each link listed with its own joint.
    """
    s = Sketch("tree", gravity=gravity)
    shape = Box((0.05, 0.05, 0.05))
    block = inertial(shape, 0.5, (0.02, 0.01, 0.0))
    s.free("before", shape, (3.0, 0.0, 0.5), collides=False)
    base = s.robot("tree", (0.0, 0.0, 1.0), turn(Z, 0.5))
    a1 = s.link("zulu", base, REVOLUTE, Z, block, position=(0.1, 0.0, 0.0), quaternion=turn(X, 0.3), initial=0.1)
    s.link("mike", a1, PRISMATIC, X, block, position=(0.2, 0.0, 0.1), quaternion=turn(Y, -0.4), lower=-0.5, upper=0.5)
    b1 = s.link("bravo", base, REVOLUTE, (0.6, 0.0, 0.8), block, position=(-0.1, 0.1, 0.0), anchor=(0.0, -0.1, 0.05))
    s.link("alpha", b1, REVOLUTE, X, block, position=(0.0, 0.2, 0.0), quaternion=turn(Z, 1.0), initial=-0.3)
    s.free("after", shape, (-3.0, 0.0, 0.5), collides=False)
    return s.world()


def slider(
    mode: ControlMode = ControlMode.EFFORT,
    kp: float = 0.0,
    kd: float = 0.0,
    limit: float = inf,
    *,
    mass: float = 2.0,
    dt: float = 0.002,
    gravity: Vec3 = WEIGHTLESS,
    axis: Vec3 = X,
    compensated: bool = False,
    drive: bool = True,
    **joint: Any,
) -> World:
    """One driven carriage on a rail: m a = u - d v, the simplest place to see a drive's law."""
    s = Sketch("slider", dt, gravity)
    base = s.robot("rail")
    block = inertial(Box((0.1, 0.1, 0.1)), mass)
    link = s.link("carriage", base, PRISMATIC, axis, block, gravity_compensation=compensated, **joint)
    if drive:
        s.drive(link, mode, kp, kd, limit)
    return s.world()


def sliders(count: int, limit: float = inf, **joint: Any) -> World:
    """Several carriages of 2 kg on one rail base, each with a position drive (kp 200, kd 40); no gravity."""
    s = Sketch("sliders", gravity=WEIGHTLESS)
    base = s.robot("rail")
    for number in range(count):
        part = inertial(Box((0.1, 0.1, 0.1)), 2.0)
        link = s.link(f"carriage{number}", base, PRISMATIC, X, part, position=(0.0, 1.0 * number, 0.0), **joint)
        s.drive(link, ControlMode.POSITION, 200.0, 40.0, limit)
    return s.world()


def actuated(world: World, actuation: Actuation) -> World:
    """The same world with another actuation."""
    return replace(world, physics=replace(world.physics, actuation=actuation))


def gripper() -> World:
    """Two fingers, the right one mimicking the left: right = 0.5 left + 0.01."""
    s = Sketch("gripper", gravity=WEIGHTLESS)
    base = s.robot("gripper")
    finger = inertial(Box((0.01, 0.01, 0.03)), 0.1)
    left = s.link("left", base, PRISMATIC, Y, finger, lower=0.0, upper=0.1)
    s.link("right", base, PRISMATIC, Y, finger, mimic=Mimic(0, 0.5, 0.01), initial=0.01)
    s.drive(left, ControlMode.POSITION, 200.0, 10.0, 20.0)
    return s.world()


def blocked(kp: float = 100.0, kd: float = 10.0, limit: float = inf) -> World:
    """A bar of 0.5 m that turns about z, its tip's side in touch with a fixed post at 0.4 m; no gravity."""
    s = Sketch("blocked", gravity=WEIGHTLESS)
    base = s.robot("bar")
    rod = Box((0.25, 0.02, 0.02))
    link = s.link("swing", base, REVOLUTE, Z, inertial(rod, 1.0, (0.25, 0.0, 0.0)), armature=0.01)
    s.shape(link, rod, (0.25, 0.0, 0.0), surface=SMOOTH)
    s.drive(link, ControlMode.POSITION, kp, kd, limit)
    s.fixed("post", Sphere(0.05), (0.4, 0.07, 0.0), surface=SMOOTH)
    s.sensors.append(ContactSensor("bar", (link,)))
    return s.world()


# ---------------------------------------------------------------------- cameras


def wall(cameras: bool = True) -> World:
    """A camera on a driven link looks along +x at a wall 2 m away; a small red and a small green cube stand before it.

    The image's left is +y. The cubes' near faces are at x = 1, their middles at y = 0.3 and -0.3.
    """
    s = Sketch("wall", gravity=WEIGHTLESS)
    base = s.robot("mast")
    pole = s.link("pan", base, REVOLUTE, Z, inertial(Sphere(0.02), 0.2), damping=0.1)
    s.drive(pole, ControlMode.POSITION, 20.0, 2.0)
    s.fixed("wall", Box((0.05, 5.0, 5.0)), (2.05, 0.0, 0.0))
    s.fixed("red", Box((0.1, 0.1, 0.1)), (1.1, 0.3, 0.0))
    s.fixed("green", Box((0.1, 0.1, 0.1)), (1.1, -0.3, 0.0))
    ahead = _looking(ORIGIN, X)
    channels = ("rgb", "depth", "segmentation")
    if cameras:
        s.cameras.append(Camera("eye", pole, ORIGIN, ahead, 60.0, 64, 48, channels))
        s.cameras.append(Camera("fixed", WORLD, ORIGIN, ahead, 60.0, 64, 48, channels))
    return s.world()
