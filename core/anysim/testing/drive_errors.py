"""Errors of drives and joints that engines may declare, each with the world in which it is measured."""

from typing import NamedTuple, Protocol

import numpy as np

from anysim.engine.base import SimEngine
from anysim.model.world import Actuation, Box, ContactSensor, ControlMode, Mimic, Sphere, World
from anysim.testing import worlds
from anysim.testing.sketch import Sketch, inertial


class Build(Protocol):
    """Makes an engine with a world; skips the running test where the engine declares that it cannot."""

    def __call__(self, world: World, num_envs: int = 1) -> SimEngine: ...


def lag(build: Build) -> float:
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


def beyond(build: Build) -> float:
    """[rad] beyond a joint's limit, pressed on it with 87 N m, on 0.1 kg m^2."""
    s = Sketch("stop", gravity=worlds.WEIGHTLESS)
    base = s.robot("arm")
    link = s.link("link", base, worlds.REVOLUTE, worlds.Z, inertial(Sphere(0.5), 1.0), lower=-1.0, upper=0.1)
    s.drive(link, ControlMode.EFFORT, limit=87.0)
    engine = build(s.world())
    engine.set_control(effort=87.0)
    engine.step(1000)
    return float(engine.get_state().joint_pos[0, 0]) - 0.1


def swing(build: Build) -> float:
    """[rad] off the solution: a stiff drive (kp 4500, kd 450 on 0.05 kg m^2 at 2 ms) clipped in motion at 87 N m."""
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


def late(build: Build) -> float:
    """Beyond a joint's limit, of a mass that meets it at 5 m/s, in ways of one step."""
    engine = build(worlds.slider(mass=1.0, lower=-1.0, upper=0.1, drive=False))
    engine.set_joint_state(position=[[0.0]], velocity=[[5.0]])
    furthest = 0.0
    for _ in range(60):
        engine.step()
        furthest = max(furthest, float(engine.get_state().joint_pos[0, 0]))
    return max(furthest - 0.1, 0.0) / (5.0 * 0.002)


def chatter(build: Build) -> float:
    """Relative, on the 20 N of a stiff drive that presses on its joint's limit: kd 300 on 0.115 kg at 2 ms."""
    world = worlds.slider(ControlMode.POSITION, 1000.0, 300.0, mass=0.115, lower=-1.0, upper=0.1)
    engine = build(world)
    engine.set_control(position=0.12)
    engine.step(500)
    forces: list[float] = []
    for _ in range(100):
        engine.step()
        forces.append(float(engine.get_state().joint_effort[0, 0]))
    return float(np.abs(np.array(forces) / 20.0 - 1.0).max())


class _Tracking(NamedTuple):
    """Distances [rad] from the solution of the law: the largest on the way, and that at the end."""

    worst: float
    last: float


def _tracking(build: Build, actuation: Actuation) -> _Tracking:
    """A joint (kp 400, kd 40 on 0.5 kg m^2) follows a sine of 0.5 rad and 0.5 Hz for 2 s, then rests for 2 s."""
    kp, kd, limit, moment, dt = 400.0, 40.0, 87.0, 0.5, 0.002
    s = Sketch("tracking", dt, worlds.WEIGHTLESS)
    base = s.robot("arm")
    even = inertial(Sphere(0.1), 1.0)._replace(inertia=(moment, moment, moment, 0.0, 0.0, 0.0))
    s.drive(s.link("link", base, worlds.REVOLUTE, worlds.Z, even), ControlMode.POSITION, kp, kd, limit)
    engine = build(worlds.actuated(s.world(), actuation))
    q = v = worst = off = 0.0
    for tick in range(200):
        target = 0.5 * float(np.sin(np.pi * 0.02 * tick)) if tick < 100 else 0.3
        engine.set_control(position=target)
        engine.step(10)
        for _ in range(200):  # the law in fine steps
            torque = float(np.clip(kp * (target - q) - kd * v, -limit, limit))
            v += dt / 20 * torque / moment
            q += dt / 20 * v
        off = abs(float(engine.get_state().joint_pos[0, 0]) - q)
        worst = max(worst, off)
    return _Tracking(worst, off)


def track(build: Build) -> float:
    """[rad] off the solution: a joint in motion, kp 400 and kd 40 on 0.5 kg m^2."""
    return _tracking(build, Actuation.IMPLICIT_PD).worst


def settled(build: Build) -> float:
    """[rad] off the target: a joint at rest, kp 400 and kd 40 on 0.5 kg m^2."""
    return _tracking(build, Actuation.IMPLICIT_PD).last


def astray(build: Build) -> float:
    """[rad] off the solution of the law: the engine's own drive in motion, kp 400 and kd 40 on 0.5 kg m^2."""
    return _tracking(build, Actuation.NATIVE).worst


def _pressing(build: Build, actuation: Actuation) -> float:
    s = Sketch("pressing", gravity=worlds.WEIGHTLESS)
    base = s.robot("hand")
    tip = Box((0.01, 0.01, 0.03))
    link = s.link("finger", base, worlds.PRISMATIC, worlds.X, inertial(tip, 1.0))
    s.shape(link, tip)
    s.drive(link, ControlMode.POSITION, 1000.0, 50.0, 87.0)
    s.fixed("stop", Box((0.05, 0.05, 0.05)), (0.061, 0.0, 0.0))
    s.sensors.append(ContactSensor("finger", (link,)))
    engine = build(worlds.actuated(s.world(), actuation))
    engine.set_control(position=0.021)
    engine.step(50)
    state = engine.get_state()
    asked = 1000.0 * (0.021 - float(state.joint_pos[0, 0]))
    return abs(float(np.linalg.norm(state.contact_force[0, 0])) / asked - 1.0)


def buildup(build: Build) -> float:
    """Relative, on the force of a finger of 1 kg that has pressed for 0.1 s with 20 N."""
    return _pressing(build, Actuation.IMPLICIT_PD)


def stalled(build: Build) -> float:
    """Relative, on the force of a finger whose own drive asks for 20 N and may take 87 N, and is blocked."""
    return _pressing(build, Actuation.NATIVE)
