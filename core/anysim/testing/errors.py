"""Errors that engines may declare of their approximations, each with the world in which it is measured.

`approximately("within {bounce:g} of the coefficient", bounce=0.07)` declares one. An engine that declares no number for
an error of a capability is held to what engines that are exact are held to.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import cos, radians, sin, sqrt
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability as C
from anysim.model.world import Box, Compliance, ContactSensor, ControlMode, Cylinder, Sphere, Surface
from anysim.testing import coupled, drive_errors as drives, tolerances, worlds
from anysim.testing.compare import sliding_friction
from anysim.testing.drive_errors import Build
from anysim.testing.sketch import Sketch
from anysim.testing.varying import having, reduced, shared_bodies, varied

G = 9.81
MEETING = sqrt(2 * G * 0.3)
"""[m/s] at which a ball meets the ground after 0.3 m."""


class Measure(NamedTuple):
    """An error of an engine: of which capability, what it is, what an exact engine may have, and how it is found."""

    capability: C
    what: str
    exact: float
    found: Callable[[Build], float]


def allowed(capabilities: Capabilities, name: str) -> float:
    """How large an error may be: what the engine declares, else what exact ones are held to."""
    measure = MEASURES[name]
    support = capabilities.supported.get(measure.capability)
    return measure.exact if support is None else support.errors.get(name, measure.exact)


def _heights(engine: SimEngine) -> Array:
    return engine.get_state().body_pose[0, :, 2]


def sink(build: Build) -> float:
    """[m] of a box of 1 kg into the ground under its own weight."""
    engine = build(worlds.resting(Box((0.1, 0.1, 0.1)), 0.1))
    engine.step(1000)
    return abs(float(_heights(engine)[0]) - 0.1)


def pressed(build: Build) -> float:
    """[m] of a box of 1 kg into the ground under 49 kg that stand on it."""
    s = Sketch("pressed")
    s.ground()
    under = s.free("under", Box((0.1, 0.1, 0.1)), (0.0, 0.0, 0.1), 1.0)
    s.free("load", Box((0.1, 0.1, 0.1)), (0.0, 0.0, 0.3), 49.0)
    engine = build(s.world())
    engine.step(1500)
    return abs(float(_heights(engine)[under]) - 0.1)


def squeezed(build: Build) -> float:
    """[m] of a finger of 50 g into a fixed thing, pressed with 3 N."""
    engine = build(drives.pressing(ControlMode.EFFORT, 0.05))
    engine.set_control(effort=3.0)
    engine.step(1000)
    return abs(float(engine.get_state().joint_pos[0, 0]) - 0.001)


def remixed(build: Build) -> float:
    """Absolute, on the friction of a thing of 0.2 on one of 0.2 above a ground of 0.8, built with 0.8 throughout."""
    rough = Surface(friction=0.8)
    s = Sketch("remixed")
    s.ground(rough)
    s.free("slab", Box((1.0, 0.9, 0.1)), (0.0, 0.0, 0.1), 2000.0, surface=rough)
    box = s.free("box", Box((0.1, 0.1, 0.02)), (-0.8, 0.0, 0.22), surface=rough)
    engine = build(s.world())
    if "geom.friction" not in engine.parameters:
        return 0.0
    engine.set_parameters("geom.friction", [[0.8, 0.2, 0.2]])
    return abs(float(sliding_friction(engine, [box])[0]) - 0.2)


def creep(build: Build) -> float:
    """[m/s] of a box on a slope of 15 degrees with a coefficient of 0.4, at which it should not slide."""
    engine = build(worlds.slope(radians(15), 0.4))
    engine.step(500)
    start = engine.get_state().body_pose[0, 1, :3]
    engine.step(1000)
    return float(np.linalg.norm(engine.get_state().body_pose[0, 1, :3] - start))


def rolling(build: Build) -> float:
    """Relative, on the distance of a solid cylinder that rolls down 15 degrees for 0.6 s: 2/3 g sin a."""
    angle, radius = radians(15), 0.1
    s = Sketch("roll", 0.001)
    s.fixed("slab", Box((3.0, 1.0, 0.1)), (0.0, 0.0, 0.0), quaternion=worlds.turn(worlds.Y, angle))
    along_y = worlds.turn(worlds.X, np.pi / 2)
    up = 0.1 + radius
    where = (up * sin(angle), 0.0, up * cos(angle))
    s.free("roll", Cylinder(radius, 0.1), where, quaternion=along_y, surface=Surface(friction=1.0))
    engine = build(s.world())
    engine.step(200)
    speed = float(np.linalg.norm(engine.get_state().body_twist[0, 1, :3]))
    engine.step(400)
    gained = float(np.linalg.norm(engine.get_state().body_twist[0, 1, :3])) - speed
    return abs(gained / (0.4 * 2 / 3 * G * sin(angle)) - 1)


def _balls(build: Build, dt: float, *coefficients: float) -> SimEngine:
    """Balls of these coefficients whose lowest points are 0.3 m above the ground."""
    s = Sketch("bounces", dt)
    s.ground()
    for i, e in enumerate(coefficients):
        s.free(f"ball{i}", Sphere(0.1), (float(i), 0.0, 0.4), surface=Surface(restitution=e))
    return build(s.world())


def _bounces(build: Build, *coefficients: float) -> float:
    """The largest difference of a ratio of speeds after and before the touch of a ball from its coefficient."""
    engine = _balls(build, 0.001, *coefficients)
    engine.step(240)
    best = np.zeros(len(coefficients))
    for _ in range(60):
        engine.step(2)
        best = np.maximum(best, engine.get_state().body_twist[0, :, 2])
    return float(np.abs(best / MEETING - coefficients).max())


def bounce(build: Build) -> float:
    """Absolute, on the ratio of a ball's speeds after and before a touch, for coefficients from 0.2 to 0.9."""
    return _bounces(build, 0.2, 0.35, 0.5, 0.7, 0.9)


def dead(build: Build) -> float:
    """The ratio of the speeds after and before a touch where nothing bounces, beside things that do."""
    return _bounces(build, 0.0)


def dent(build: Build) -> float:
    """[m for each m/s] that balls sink into the ground when they touch it, at 2 ms."""
    engine = _balls(build, 0.002, 0.0, 0.2, 0.5, 0.9)
    lowest = 0.4
    for _ in range(180):
        engine.step()
        lowest = min(lowest, float(_heights(engine).min()))
    return (0.1 - lowest) / MEETING


def torsion(build: Build) -> float:
    """Relative, on the torque that resists a ball spinning where it stands: its weight times the coefficient [m]."""
    surface = Surface(friction=1.0, torsional=True, torsional_friction=0.01)
    world = worlds.resting(Sphere(0.1), 0.1)
    engine = build(replace(world, geoms=tuple(replace(geom, surface=surface) for geom in world.geoms)))
    engine.step(200)
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 0.0, 0.0, 12.0])
    engine.step(50)
    before = float(engine.get_state().body_twist[0, 0, 5])
    engine.step(100)
    lost = before - float(engine.get_state().body_twist[0, 0, 5])
    moment = engine.world.bodies[0].inertial.inertia[2]
    return abs(lost / (0.01 * G / moment * 0.2) - 1)


def unyielding(build: Build) -> float:
    """Relative, on how deep a ball sinks that gives way with a given stiffness: g (1 - d) / k, 5 mm."""
    given, share = 981.0, 0.5
    compliance = Compliance((-given, -60.0), (share, share, 0.001, 0.5, 2.0))
    world = worlds.resting(Sphere(0.1), 0.1)
    surface = Surface(compliance=compliance)
    engine = build(replace(world, geoms=tuple(replace(geom, surface=surface) for geom in world.geoms)))
    engine.step(1500)
    return abs((0.1 - float(_heights(engine)[0])) / (G * (1 - share) / given) - 1)


def felt(build: Build) -> float:
    """Relative to the weight: the force that a sensor reads on a box at rest on a slope of 20 degrees."""
    world = replace(worlds.slope(radians(20), 0.8), contact_sensors=(ContactSensor("box", (1,)),))
    engine = build(world)
    engine.step(800)
    weight = np.array([0.0, 0.0, G])
    return float(np.abs(engine.get_state().contact_force[0, 0] - weight).max() / G)


def shift(build: Build) -> float:
    """[m] of what is there over 3.6 s, contacts included, against a world without what is absent."""
    whole = varied(build(worlds.falling_ball()).capabilities)
    less = reduced(whole, "mug~2", "chest~1")
    engine, alone = build(whole), build(less)
    engine.reset(present=having(whole, "mug~2", "chest~1"))
    ours, theirs = shared_bodies(whole, less)
    worst = 0.0
    for _ in range(60):
        engine.step(30)
        alone.step(30)
        off = engine.get_state().body_pose[:, ours] - alone.get_state().body_pose[:, theirs]
        worst = max(worst, float(np.abs(off).max()))
    return worst


MEASURES: Mapping[str, Measure] = {
    function.__name__: Measure(capability, str(function.__doc__).splitlines()[0], exact, function)
    for function, capability, exact in (
        (sink, C.CONTACTS_STATIC, tolerances.REST_HEIGHT),
        (pressed, C.CONTACTS_STATIC, tolerances.REST_HEIGHT),
        (squeezed, C.CONTACTS_STATIC, tolerances.REST_HEIGHT),
        (remixed, C.CONTACTS_STATIC, tolerances.FRICTION),
        (creep, C.CONTACTS_STATIC, tolerances.CREEP),
        (rolling, C.CONTACTS_STATIC, tolerances.ROLLING),
        (bounce, C.RESTITUTION, tolerances.RESTITUTION["exact"]),
        (dead, C.RESTITUTION, tolerances.RESTITUTION["exact"]),
        (dent, C.RESTITUTION, tolerances.DENT),
        (torsion, C.TORSIONAL_FRICTION, tolerances.SLIDING),
        (unyielding, C.COMPLIANCE, tolerances.SLIDING),
        (felt, C.CONTACT_SENSORS, tolerances.WEIGHT),
        (shift, C.VARYING_ENTITIES, tolerances.ABSENT),
        (coupled.apart, C.CONNECTS, tolerances.HELD),
        (coupled.askew, C.WELDS, tolerances.HELD),
        (coupled.dragged, C.TENDONS, tolerances.FOLLOWER),
        (drives.lag, C.MIMIC_JOINTS, tolerances.FOLLOWER),
        (drives.beyond, C.JOINT_LIMITS, tolerances.LIMIT),
        (drives.late, C.JOINT_LIMITS, tolerances.LATE),
        (drives.chatter, C.JOINT_LIMITS, tolerances.BLOCKED),
        (drives.swing, C.EFFORT_LIMITS, tolerances.TRANSIENT),
        (drives.track, C.CONTROL_POSITION, tolerances.TRANSIENT),
        (drives.settled, C.CONTROL_POSITION, tolerances.AT_REST),
        (drives.buildup, C.CONTROL_POSITION, tolerances.BLOCKED),
        (drives.astray, C.ACTUATION_NATIVE, tolerances.TRANSIENT),
        (drives.stalled, C.ACTUATION_NATIVE, tolerances.BLOCKED),
    )
}
"""By name."""
