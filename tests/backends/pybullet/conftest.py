"""Hand-built worlds for the PyBullet backend's own tests."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.model.world import (
    Body as WorldBody,
    BodyKind,
    Box,
    ContactSensor,
    ControlMode,
    Cylinder,
    Geom,
    Inertial,
    JointType,
    Sphere,
    World,
)
from anysim.testing.sketch import Sketch, inertial

pytest.importorskip("pybullet", reason="the package pybullet is not installed")


@pytest.fixture
def build() -> Iterator[Callable[..., SimEngine]]:
    made: list[SimEngine] = []

    def make(world: World, num_envs: int = 1, name: str = "pybullet", **options: Any) -> SimEngine:
        made.append(create_simulation(name, **options).create_world(world, num_envs))
        return made[-1]

    yield make
    for engine in made:
        engine.destroy()


def skew_arm(free: bool = False, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), **joint: Any) -> World:
    """Three links with skew axes, anchors, frames and inertias, the middle one prismatic, on a turned base."""
    s = Sketch("skew", gravity=gravity)
    turn = (0.0, 0.0, float(np.sin(0.4)), float(np.cos(0.4)))
    base = s.robot("arm", (0.2, -0.1, 1.0), turn)
    if free:
        body = Inertial(3.0, (0.05, 0.02, -0.03), (0.05, 0.06, 0.07, 0.004, -0.002, 0.003))
        s.bodies[base] = WorldBody("arm.base", BodyKind.FREE, -1, (0.2, -0.1, 1.0), turn, body)
    one = Inertial(1.2, (0.1, 0.02, 0.0), (0.02, 0.03, 0.025, 0.002, 0.001, -0.003))
    two = Inertial(0.7, (0.0, 0.05, 0.1), (0.01, 0.012, 0.008, 0.001, 0.0, 0.002))
    three = Inertial(0.4, (0.03, 0.0, 0.08), (0.004, 0.005, 0.003, 0.0, 0.001, 0.0))
    a = s.link(
        "a",
        base,
        JointType.REVOLUTE,
        (0.0, 0.6, 0.8),
        one,
        position=(0.0, 0.0, 0.2),
        quaternion=turn,
        anchor=(0.05, -0.02, 0.01),
        initial=0.3,
        **joint,
    )
    b = s.link("b", a, JointType.PRISMATIC, (1.0, 0.0, 0.0), two, position=(0.3, 0.0, 0.1), initial=0.05, **joint)
    c = s.link(
        "c",
        b,
        JointType.REVOLUTE,
        (0.0, 1.0, 0.0),
        three,
        position=(0.0, 0.1, 0.1),
        anchor=(0.0, 0.03, 0.0),
        quaternion=turn,
        initial=-0.5,
        **joint,
    )
    for link in (a, b, c):
        s.drive(link, ControlMode.POSITION, 60.0, 6.0, 30.0)
    return s.world()


def compounds(count: int = 5) -> World:
    """Bodies of three shapes each, falling onto each other."""
    s = Sketch("compounds")
    s.ground()
    for i in range(count):
        body = s.free(f"b{i}", Box((0.1, 0.1, 0.05)), (0.03 * i, 0.0, 0.1 + 0.25 * i))
        s.geoms.append(Geom(f"ball{i}", body, Sphere(0.06), (0.1, 0.0, 0.05)))
        s.geoms.append(Geom(f"can{i}", body, Cylinder(0.04, 0.05), (-0.1, 0.0, 0.05)))
    return s.world()


def pile(count: int = 24) -> World:
    """Boxes and balls that fall onto each other."""
    s, rng = Sketch("pile"), np.random.default_rng(0)
    s.ground()
    for i in range(count):
        x, y = (float(v) for v in rng.uniform(-0.15, 0.15, 2))
        s.free(f"b{i}", Box((0.1, 0.08, 0.06)) if i % 2 else Sphere(0.08), (x, y, 0.2 + 0.2 * i))
    return s.world()


def pressed(mass: float = 1.0, armature: float = 0.01, kp: float = 100.0, kd: float = 10.0) -> World:
    """A driven carriage 1 cm before a wall, with a contact sensor."""
    s = Sketch("pressed", gravity=(0.0, 0.0, 0.0))
    rail = s.robot("rail")
    shape = Box((0.05, 0.05, 0.05))
    link = s.link("carriage", rail, JointType.PRISMATIC, (1.0, 0.0, 0.0), inertial(shape, mass), armature=armature)
    s.shape(link, shape)
    s.drive(link, ControlMode.POSITION, kp, kd, 40.0)
    s.fixed("wall", Box((0.05, 0.2, 0.2)), (0.11, 0.0, 0.0))
    s.sensors.append(ContactSensor("carriage", (link,)))
    return s.world()


@pytest.fixture
def own() -> SimpleNamespace:
    """The worlds above."""
    return SimpleNamespace(skew_arm=skew_arm, compounds=compounds, pile=pile, pressed=pressed)
