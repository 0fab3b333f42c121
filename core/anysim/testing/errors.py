"""Errors that engines may declare of their approximations, each with the world in which it is measured.

`approximately("within {bounce:g} of the coefficient", bounce=0.07)` declares one. An engine that declares no number for
an error of a capability is held to what engines that are exact are held to.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import cos, radians, sin, sqrt
from typing import NamedTuple, Protocol

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability as C
from anysim.model.world import Box, ContactSensor, ControlMode, Cylinder, Mimic, Sphere, Surface, World
from anysim.testing import tolerances, worlds
from anysim.testing.sketch import Sketch, inertial

G = 9.81


class _Build(Protocol):
    def __call__(self, world: World, num_envs: int = 1) -> SimEngine: ...


class Measure(NamedTuple):
    """An error of an engine: of which capability, what it is, what an exact engine may have, and how it is found."""

    capability: C
    what: str
    exact: float
    found: Callable[[_Build], float]


def allowed(capabilities: Capabilities, name: str) -> float:
    """How large an error may be: what the engine declares, else what exact ones are held to."""
    measure = MEASURES[name]
    support = capabilities.supported.get(measure.capability)
    return measure.exact if support is None else support.errors.get(name, measure.exact)


def _heights(engine: SimEngine) -> Array:
    return engine.get_state().body_pose[0, :, 2]


def sink(build: _Build) -> float:
    """[m] of a box of 1 kg into the ground under its own weight."""
    engine = build(worlds.resting(Box((0.1, 0.1, 0.1)), 0.1))
    engine.step(1000)
    return abs(float(_heights(engine)[0]) - 0.1)


def creep(build: _Build) -> float:
    """[m/s] of a box on a slope of 15 degrees, a third below the coefficient at which it would slide."""
    engine = build(worlds.slope(radians(15), 0.4))
    engine.step(500)
    start = engine.get_state().body_pose[0, 1, :3]
    engine.step(1000)
    return float(np.linalg.norm(engine.get_state().body_pose[0, 1, :3] - start))


def rolling(build: _Build) -> float:
    """Relative, on the way of a solid cylinder that rolls down 15 degrees for 0.6 s: 2/3 g sin a."""
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


def _bounces(build: _Build, *coefficients: float) -> float:
    """The largest difference of a ratio of speeds after and before the touch of a ball from its coefficient."""
    s = Sketch("bounces", 0.001)
    s.ground()
    for i, e in enumerate(coefficients):
        s.free(f"ball{i}", Sphere(0.1), (float(i), 0.0, 0.4), surface=Surface(restitution=e))
    engine = build(s.world())
    engine.step(240)
    best = np.zeros(len(coefficients))
    for _ in range(60):
        engine.step(2)
        best = np.maximum(best, engine.get_state().body_twist[0, :, 2])
    return float(np.abs(best / sqrt(2 * G * 0.3) - coefficients).max())


def bounce(build: _Build) -> float:
    """Absolute, on the ratio of a ball's speeds after and before a touch, for coefficients from 0.2 to 0.9."""
    return _bounces(build, 0.2, 0.35, 0.5, 0.7, 0.9)


def dead(build: _Build) -> float:
    """The ratio of the speeds after and before a touch where nothing bounces, beside things that do."""
    return _bounces(build, 0.0)


def torsion(build: _Build) -> float:
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


def lag(build: _Build) -> float:
    """[m] of a finger of 15 g behind the one that it follows, pressed with 20 N against something fixed."""
    s = Sketch("grip", gravity=worlds.WEIGHTLESS)
    base = s.robot("hand")
    finger = inertial(Box((0.01, 0.01, 0.03)), 0.015)
    left = s.link("left", base, worlds.PRISMATIC, worlds.Y, finger, lower=0.0, upper=0.1, armature=0.1)
    right = s.link(
        "right", base, worlds.PRISMATIC, (0.0, -1.0, 0.0), finger, position=(0.0, -0.1, 0.0), mimic=Mimic(0, 1.0, 0.0)
    )
    s.shape(right, Box((0.01, 0.01, 0.03)))
    s.drive(left, ControlMode.EFFORT, limit=20.0)
    s.fixed("stop", Box((0.05, 0.05, 0.05)), (0.0, -0.18, 0.0))
    engine = build(s.world())
    engine.set_control(effort=20.0)
    engine.step(1000)
    place = engine.get_state().joint_pos[0]
    return abs(float(place[1] - place[0]))


def beyond(build: _Build) -> float:
    """[rad] beyond a joint's limit, pressed on it with 87 N m, on 0.1 kg m^2."""
    s = Sketch("stop", gravity=worlds.WEIGHTLESS)
    base = s.robot("arm")
    link = s.link("link", base, worlds.REVOLUTE, worlds.Z, inertial(Sphere(0.5), 1.0), lower=-1.0, upper=0.1)
    s.drive(link, ControlMode.EFFORT, limit=87.0)
    engine = build(s.world())
    engine.set_control(effort=87.0)
    engine.step(1000)
    return float(engine.get_state().joint_pos[0, 0]) - 0.1


def felt(build: _Build) -> float:
    """Relative to the weight: the force that a sensor reads on a box at rest on a slope of 20 degrees."""
    world = replace(worlds.slope(radians(20), 0.8), contact_sensors=(ContactSensor("box", (1,)),))
    engine = build(world)
    engine.step(800)
    weight = np.array([0.0, 0.0, G])
    return float(np.abs(engine.get_state().contact_force[0, 0] - weight).max() / G)


def swing(build: _Build) -> float:
    """[rad] off the solution: a stiff drive (kp 4500, kd 450 on 0.05 kg m^2) clipped in motion at 87 N m."""
    kp, kd, limit, moment, dt = 4500.0, 450.0, 87.0, 0.05, 0.002
    s = Sketch("stiff", dt, worlds.WEIGHTLESS)
    base = s.robot("arm")
    even = inertial(Sphere(0.1), 1.0)._replace(inertia=(moment, moment, moment, 0.0, 0.0, 0.0))
    link = s.link("link", base, worlds.REVOLUTE, worlds.Z, even)
    s.drive(link, ControlMode.POSITION, kp, kd, limit)
    engine = build(s.world())
    engine.set_control(position=0.5)
    q = v = worst = 0.0
    for _ in range(150):
        engine.step()
        for _ in range(200):  # the law in fine steps
            torque = float(np.clip(kp * (0.5 - q) - kd * v, -limit, limit))
            v += dt / 200 * torque / moment
            q += dt / 200 * v
        worst = max(worst, abs(float(engine.get_state().joint_pos[0, 0]) - q))
    return worst


MEASURES: Mapping[str, Measure] = {
    function.__name__: Measure(capability, str(function.__doc__).splitlines()[0], exact, function)
    for function, capability, exact in (
        (sink, C.CONTACTS_STATIC, tolerances.REST_HEIGHT),
        (creep, C.CONTACTS_STATIC, tolerances.CREEP),
        (rolling, C.CONTACTS_STATIC, tolerances.ROLLING),
        (bounce, C.RESTITUTION, tolerances.RESTITUTION["exact"]),
        (dead, C.RESTITUTION, tolerances.RESTITUTION["exact"]),
        (torsion, C.TORSIONAL_FRICTION, tolerances.SLIDING),
        (lag, C.MIMIC_JOINTS, tolerances.FOLLOWER),
        (beyond, C.JOINT_LIMITS, tolerances.LIMIT),
        (swing, C.EFFORT_LIMITS, tolerances.TRANSIENT),
        (felt, C.CONTACT_SENSORS, tolerances.WEIGHT),
    )
}
"""By name."""
