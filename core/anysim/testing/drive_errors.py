"""Errors of drives and joints that engines may declare, each with the world in which it is measured."""

from typing import Protocol

import numpy as np

from anysim.engine.base import SimEngine
from anysim.model.world import Actuation, Box, ContactSensor, ControlMode, Mimic, Sphere, World
from anysim.testing import worlds
from anysim.testing.sketch import Sketch, inertial

STEP = 0.002
"""[s] of all worlds here."""


class Build(Protocol):
    """Makes an engine with a world; skips the running test where the engine declares that it cannot."""

    def __call__(self, world: World, num_envs: int = 1) -> SimEngine: ...


class _Law:
    """A drive on a joint that nothing else moves, integrated in fine steps: where it should be."""

    def __init__(self, kp: float, kd: float, limit: float, moment: float) -> None:
        self.kp, self.kd, self.limit, self.moment = kp, kd, limit, moment
        self.position = self.speed = 0.0

    def advance(self, target: float, dt: float, parts: int) -> float:
        """The position [rad] after `dt` [s] towards the target, in so many steps."""
        for _ in range(parts):
            torque = float(np.clip(self.kp * (target - self.position) - self.kd * self.speed, -self.limit, self.limit))
            self.speed += dt / parts * torque / self.moment
            self.position += dt / parts * self.speed
        return self.position

    def world(self) -> World:
        """The same as a world of one link."""
        s = Sketch("law", STEP, worlds.WEIGHTLESS)
        moments = (self.moment, self.moment, self.moment, 0.0, 0.0, 0.0)
        link = inertial(Sphere(0.1), 1.0)._replace(inertia=moments)
        joint = s.link("link", s.robot("arm"), worlds.REVOLUTE, worlds.Z, link)
        s.drive(joint, ControlMode.POSITION, self.kp, self.kd, self.limit)
        return s.world()


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
    law = _Law(4500.0, 450.0, 87.0, 0.05)
    engine = build(law.world())
    engine.set_control(position=0.5)
    worst = 0.0
    for _ in range(150):
        engine.step()
        worst = max(worst, abs(float(engine.get_state().joint_pos[0, 0]) - law.advance(0.5, STEP, 200)))
    return worst


def late(build: Build) -> float:
    """Beyond a joint's limit, of a mass that meets it at 5 m/s, in distances of one step."""
    engine = build(worlds.slider(mass=1.0, lower=-1.0, upper=0.1, drive=False))
    engine.set_joint_state(position=[[0.0]], velocity=[[5.0]])
    furthest = 0.0
    for _ in range(60):
        engine.step()
        furthest = max(furthest, float(engine.get_state().joint_pos[0, 0]))
    return max(furthest - 0.1, 0.0) / (5.0 * STEP)


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


_TRACKED = (400.0, 40.0, 87.0, 0.5)
"""kp, kd, limit [N m] and inertia [kg m^2] of a drive that is neither stiff nor slow."""


def _off_the_law(build: Build, actuation: Actuation) -> float:
    """The largest distance [rad] from the law on a sine of 0.5 rad and 0.5 Hz, and on a jump to 0.3 rad after it."""
    law = _Law(*_TRACKED)
    engine = build(worlds.actuated(law.world(), actuation))
    worst = 0.0
    for tick in range(200):
        target = 0.5 * float(np.sin(np.pi * 0.02 * tick)) if tick < 100 else 0.3
        engine.set_control(position=target)
        engine.step(10)
        worst = max(worst, abs(float(engine.get_state().joint_pos[0, 0]) - law.advance(target, 10 * STEP, 200)))
    return worst


def track(build: Build) -> float:
    """[rad] off the solution: a joint in motion, kp 400 and kd 40 on 0.5 kg m^2."""
    return _off_the_law(build, Actuation.IMPLICIT_PD)


def settled(build: Build) -> float:
    """[rad] off the target: a joint at rest, kp 400 and kd 40 on 0.5 kg m^2."""
    engine = build(_Law(*_TRACKED).world())
    engine.set_control(position=0.3)
    engine.step(1000)
    return abs(float(engine.get_state().joint_pos[0, 0]) - 0.3)


def astray(build: Build) -> float:
    """[rad] off the solution of the law: the engine's own drive in motion, kp 400 and kd 40 on 0.5 kg m^2."""
    return _off_the_law(build, Actuation.NATIVE)


def pressing(mode: ControlMode, mass: float, kp: float = 0.0, kd: float = 0.0) -> World:
    """A finger on a rail, 1 mm before a fixed thing, whose drive may take 87 N."""
    s = Sketch("pressing", STEP, worlds.WEIGHTLESS)
    tip = Box((0.01, 0.01, 0.03))
    link = s.link("finger", s.robot("hand"), worlds.PRISMATIC, worlds.X, inertial(tip, mass))
    s.shape(link, tip)
    s.drive(link, mode, kp, kd, 87.0)
    s.fixed("stop", Box((0.05, 0.05, 0.05)), (0.061, 0.0, 0.0))
    if mode is ControlMode.POSITION:
        s.sensors.append(ContactSensor("finger", (link,)))
    return s.world()


def _force_off(build: Build, actuation: Actuation) -> float:
    engine = build(worlds.actuated(pressing(ControlMode.POSITION, 1.0, 1000.0, 50.0), actuation))
    engine.set_control(position=0.021)
    engine.step(50)
    state = engine.get_state()
    asked = 1000.0 * (0.021 - float(state.joint_pos[0, 0]))
    return abs(float(np.linalg.norm(state.contact_force[0, 0])) / asked - 1.0)


def buildup(build: Build) -> float:
    """Relative, on the force of a finger of 1 kg that has pressed for 0.1 s with 20 N."""
    return _force_off(build, Actuation.IMPLICIT_PD)


def stalled(build: Build) -> float:
    """Relative, on the force of a finger whose own drive asks for 20 N and may take 87 N, and is blocked."""
    return _force_off(build, Actuation.NATIVE)
