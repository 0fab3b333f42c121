"""Hand-built worlds for the MuJoCo backend's own tests."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.model.world import (
    Actuator,
    Body,
    BodyKind,
    Box,
    Capsule,
    ContactSensor,
    ControlMode,
    Entity,
    EntityKind,
    Geom,
    Inertial,
    Joint,
    JointType,
    Mimic,
    Physics,
    Plane,
    Robot,
    Sphere,
    Surface,
    World,
)

OBJECT, ROBOT = EntityKind.OBJECT, EntityKind.ROBOT


def box_inertial(mass: float, half: tuple[float, float, float]) -> Inertial:
    x, y, z = (h * h for h in half)
    return Inertial(mass, inertia=(mass / 3 * (y + z), mass / 3 * (x + z), mass / 3 * (x + y), 0.0, 0.0, 0.0))


def ball(
    height: float = 1.0, mass: float = 0.5, surface: Surface = Surface(), ground: Surface = Surface(), **physics: Any
) -> World:
    """A ball of 5 cm radius above the ground."""
    inertia = 0.4 * mass * 0.05**2
    return World(
        "ball",
        Physics(**physics),
        bodies=(
            Body(
                "ball",
                BodyKind.FREE,
                position=(0.0, 0.0, height),
                inertial=Inertial(mass, inertia=(inertia, inertia, inertia, 0.0, 0.0, 0.0)),
            ),
        ),
        geoms=(Geom("ground", -1, Plane(), surface=ground), Geom("ball", 0, Sphere(0.05), surface=surface)),
        entities=(Entity("ball", OBJECT, 0, 1, 0, 0),),
        contact_sensors=(ContactSensor("touch", (0,)), ContactSensor("on_ground", (0,), (-1,))),
    )


def scene() -> World:
    """A two-link arm with skew axes, anchors and inertias on a turned base, a box and a ball on the ground."""
    turn = (0.0, 0.0, np.sin(0.4), np.cos(0.4))
    bodies = (
        Body(
            "ball",
            BodyKind.FREE,
            position=(0.0, 0.0, 0.3),
            inertial=Inertial(0.5, (0.0, 0.01, 0.0), (5e-4, 5e-4, 5e-4, 0, 0, 0)),
        ),
        Body(
            "box",
            BodyKind.FREE,
            position=(1.0, 0.0, 0.1),
            inertial=Inertial(1.0, (0.01, 0.0, 0.02), (4e-3, 5e-3, 6e-3, 5e-4, 0.0, 2e-4)),
        ),
        Body("base", BodyKind.STATIC, position=(0.0, 1.0, 0.5), quaternion=turn, inertial=Inertial(2.0)),
        Body(
            "upper",
            BodyKind.LINK,
            2,
            (0.0, 0.0, 0.1),
            inertial=Inertial(1.0, (0.2, 0.0, 0.0), (0.01, 0.02, 0.02, 0, 0, 0)),
        ),
        Body(
            "lower",
            BodyKind.LINK,
            3,
            (0.4, 0.0, 0.0),
            turn,
            Inertial(0.5, (0.1, 0.0, 0.05), (0.01, 0.02, 0.015, 1e-3, 0, 0)),
        ),
    )
    joints = (
        Joint(
            "shoulder",
            3,
            JointType.REVOLUTE,
            (0.0, 1.0, 0.0),
            (-0.05, 0.0, 0.02),
            -2.0,
            2.0,
            damping=0.1,
            armature=0.01,
            initial=0.3,
        ),
        Joint("elbow", 4, JointType.REVOLUTE, (0.0, 0.6, 0.8), (0.03, 0.01, 0.0), friction=0.05, initial=-0.4),
    )
    geoms = (
        Geom("ground", -1, Plane()),
        Geom("ball", 0, Sphere(0.05)),
        Geom("box", 1, Box((0.1, 0.1, 0.1)), color=(1.0, 0.0, 0.0, 1.0)),
        Geom("base", 2, Box((0.1, 0.1, 0.1))),
        Geom("upper", 3, Capsule(0.03, 0.15), (0.2, 0.0, 0.0), (0.0, 0.5**0.5, 0.0, 0.5**0.5)),
        Geom("lower", 4, Box((0.1, 0.02, 0.02)), (0.1, 0.0, 0.0)),
    )
    actuators = (
        Actuator("shoulder", 0, ControlMode.POSITION, 100.0, 10.0, 20.0),
        Actuator("elbow", 1, ControlMode.POSITION, 50.0, 5.0),
    )
    return World(
        "scene",
        bodies=bodies,
        joints=joints,
        geoms=geoms,
        actuators=actuators,
        entities=(
            Entity("ball", OBJECT, 0, 1, 0, 0),
            Entity("box", OBJECT, 1, 2, 0, 0),
            Entity("arm", ROBOT, 2, 5, 0, 2),
        ),
        robots=(Robot("arm", "two_links", {}, {}),),
        contact_sensors=(ContactSensor("box", (1,)),),
    )


def hinge(
    inertia: float = 0.1,
    mode: ControlMode = ControlMode.POSITION,
    kp: float = 0.0,
    kd: float = 0.0,
    limit: float = np.inf,
    dt: float = 0.002,
    **joint: Any,
) -> World:
    """One driven joint without gravity."""
    return World(
        "hinge",
        Physics(dt=dt, control_dt=dt, gravity=(0.0, 0.0, 0.0)),
        bodies=(
            Body("base", BodyKind.STATIC),
            Body("arm", BodyKind.LINK, 0, inertial=Inertial(1.0, inertia=(inertia, inertia, inertia, 0.0, 0.0, 0.0))),
        ),
        joints=(Joint("hinge", 1, JointType.REVOLUTE, (0.0, 1.0, 0.0), **joint),),
        actuators=(Actuator("hinge", 0, mode, kp, kd, limit),),
        entities=(Entity("arm", ROBOT, 0, 2, 0, 1),),
    )


def gripper(armature: float = 0.0) -> World:
    """Two fingers of 15 g along y, the right one coupled to the driven left one."""
    thin = Inertial(0.015, inertia=(1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0))
    slide: Any = {"lower": 0.0, "upper": 0.04, "initial": 0.02, "armature": armature}
    return World(
        "gripper",
        bodies=(
            Body("base", BodyKind.STATIC),
            Body("left", BodyKind.LINK, 0, inertial=thin),
            Body("right", BodyKind.LINK, 0, inertial=thin),
        ),
        joints=(
            Joint("left", 1, JointType.PRISMATIC, (0.0, 1.0, 0.0), **slide),
            Joint("right", 2, JointType.PRISMATIC, (0.0, -1.0, 0.0), mimic=Mimic(0), **slide),
        ),
        actuators=(Actuator("left", 0, ControlMode.POSITION, 1000.0, 20.0, 70.0),),
        entities=(Entity("gripper", ROBOT, 0, 3, 0, 2),),
    )


def with_body(world: World, body: Body, geom: Geom) -> World:
    """The world with one more object, whose geom's `body` is filled in."""
    place, joints = len(world.bodies), len(world.joints)
    entity = Entity(body.name, OBJECT, place, place + 1, joints, joints)
    return replace(
        world,
        bodies=(*world.bodies, body),
        geoms=(*world.geoms, replace(geom, body=place)),
        entities=(*world.entities, entity),
    )


@pytest.fixture
def worlds() -> SimpleNamespace:
    """The builders of this module."""
    return SimpleNamespace(
        ball=ball, scene=scene, hinge=hinge, gripper=gripper, with_body=with_body, box_inertial=box_inertial
    )


@pytest.fixture
def make() -> Iterator[Callable[..., SimEngine]]:
    """`make(world, num_envs, **options)`: an engine that is destroyed after the test."""
    engines: list[SimEngine] = []

    def build(world: World, num_envs: int = 1, **options: Any) -> SimEngine:
        engines.append(create_simulation("mujoco", **options).create_world(world, num_envs))
        return engines[-1]

    yield build
    for engine in engines:
        engine.destroy()


@pytest.fixture
def shake() -> Callable[..., list[np.ndarray]]:
    """`shake(engine, steps, seed, ids)`: drive with random targets, the same in every env; the states on the way."""

    def run(engine: SimEngine, steps: int = 20, seed: int = 0, ids: Any = None) -> list[np.ndarray]:
        rng, seen = np.random.default_rng(seed), []
        for _ in range(steps):
            engine.set_control(position=rng.normal(0.0, 0.5, len(engine.world.actuators)))
            engine.step(5, ids)
            state = engine.get_state()
            fields = (
                state.joint_pos,
                state.joint_vel,
                state.body_pose,
                state.body_twist,
                state.joint_effort,
                state.contact_force,
            )
            rows = np.concatenate([np.reshape(f, (engine.num_envs, -1)) for f in fields], axis=1)
            seen.append(rows if ids is None else rows[ids])
        return seen

    return run
