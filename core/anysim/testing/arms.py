"""Worlds that hold one serial arm and nothing else, for tests and benchmarks of kinematics. No meshes, no engine."""

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION
from anysim.math import pose as P
from anysim.model.world import (
    ORIGIN,
    Body,
    BodyKind,
    Channel,
    Entity,
    EntityKind,
    Inertial,
    Joint,
    JointType,
    Quat,
    Robot,
    Site,
    Vec3,
    World,
)


class Link(NamedTuple):
    """A link and the joint that moves it: rest frame in the previous link (xyz [m], rpy [rad]), axis and limits."""

    xyz: Vec3
    rpy: Vec3 = ORIGIN
    axis: Vec3 = (0.0, 0.0, 1.0)
    anchor: Vec3 = ORIGIN
    lower: float = -pi
    upper: float = pi
    type: JointType = JointType.REVOLUTE
    initial: float = 0.0
    velocity_limit: float = 2.0


PANDA_LINKS = (
    Link((0.0, 0.0, 0.333), lower=-2.8973, upper=2.8973, velocity_limit=2.175),
    Link((0.0, 0.0, 0.0), (-pi / 2, 0.0, 0.0), lower=-1.7628, upper=1.7628, initial=-pi / 8, velocity_limit=2.175),
    Link((0.0, -0.316, 0.0), (pi / 2, 0.0, 0.0), lower=-2.8973, upper=2.8973, velocity_limit=2.175),
    Link(
        (0.0825, 0.0, 0.0), (pi / 2, 0.0, 0.0), lower=-3.0718, upper=-0.0698, initial=-5 * pi / 8, velocity_limit=2.175
    ),
    Link((-0.0825, 0.384, 0.0), (-pi / 2, 0.0, 0.0), lower=-2.8973, upper=2.8973, velocity_limit=2.61),
    Link((0.0, 0.0, 0.0), (pi / 2, 0.0, 0.0), lower=-0.0175, upper=3.7525, initial=pi / 2, velocity_limit=2.61),
    Link((0.088, 0.0, 0.0), (pi / 2, 0.0, 0.0), lower=-2.8973, upper=2.8973, initial=pi / 4, velocity_limit=2.61),
)
"""The published geometry and limits of the Franka Emika Panda."""

PANDA_TOOL = ((0.0, 0.0, 0.2104), (0.0, 0.0, -pi / 4))
"""The point between the fingers (xyz, rpy) in the last link: flange 0.107 m, hand turned by -45 degrees, 0.1034 m."""


def serial_arm(
    links: Sequence[Link],
    tool: tuple[Vec3, Vec3] = (ORIGIN, ORIGIN),
    *,
    channel: Sequence[int] | None = None,
    name: str = "robot",
    base: tuple[Vec3, Quat] = (ORIGIN, IDENTITY_QUATERNION),
) -> World:
    """A World with one arm on a static base: channel `arm` of the joints `channel` (all if None), tool `tool`.

    Args:
        links: from the base outward.
        tool: (xyz, rpy) in the last link.
        channel: positions in `links`.
        name: of the robot.
        base: pose of the base body in the world.
    """
    bodies = [Body(f"{name}.base", BodyKind.STATIC, position=base[0], quaternion=base[1])]
    joints: list[Joint] = []
    for i, link in enumerate(links):
        quaternion = _quaternion(link.rpy)
        solid = Inertial(1.0, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0))
        bodies.append(Body(f"{name}.link{i + 1}", BodyKind.LINK, i, link.xyz, quaternion, solid))
        joints.append(
            Joint(
                f"{name}.joint{i + 1}",
                i + 1,
                link.type,
                link.axis,
                link.anchor,
                link.lower,
                link.upper,
                link.velocity_limit,
                initial=link.initial,
            )
        )
    chosen = tuple(range(len(links))) if channel is None else tuple(channel)
    return World(
        name=name,
        bodies=tuple(bodies),
        joints=tuple(joints),
        sites=(Site(f"{name}.tool", len(links), tool[0], _quaternion(tool[1])),),
        entities=(Entity(name, EntityKind.ROBOT, 0, len(bodies), 0, len(joints)),),
        robots=(Robot(name, name, {"arm": Channel("arm", chosen, ())}, {"tool": 0}),),
    )


def panda_arm(base: tuple[Vec3, Quat] = (ORIGIN, IDENTITY_QUATERNION)) -> World:
    """The Panda's seven joints under the name `panda`."""
    return serial_arm(PANDA_LINKS, PANDA_TOOL, name="panda", base=base)


def _quaternion(rpy: Vec3) -> Quat:
    x, y, z, w = P.from_roll_pitch_yaw(np.array(rpy)).tolist()
    return (x, y, z, w)
