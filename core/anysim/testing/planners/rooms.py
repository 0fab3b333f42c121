"""Worlds for planners: arms of capsules before a wall, one of them on wheels, and two arms that face each other."""

from math import pi

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.parts import Site
from anysim.model.world import Box, Capsule, Geom, JointType, Sphere, World
from anysim.planning.motion import PlanRequest, Scene, ToolGoal
from anysim.testing.arms import PANDA_LINKS, PANDA_TOOL
from anysim.testing.sketch import Sketch, inertial

LEFT = np.array([0.8, 0.4, 0.0, -2.0, 0.0, 2.4, 0.785])
RIGHT = np.array([-0.8, 0.4, 0.0, -2.0, 0.0, 2.4, 0.785])
WALL = (0.25, 0.02, 0.35)
"""Half sizes [m]; it stands between `LEFT` and `RIGHT`."""
CUBE = 0.02
HAND = "arm.link7"
IN_HAND = np.array([0.0, 0.0, 0.208, 0.0, 0.0, 0.0, 1.0])
"""Pose of the cube in the last link of an arm that holds it."""
LONG = 60.0
"""[s]: a planner may have to compile itself at its first request."""
FAR = np.array([5.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0])

_SHAPES = (
    (0, Capsule(0.06, 0.05), (0.0, 0.0, 0.17), 0.0),
    (2, Capsule(0.06, 0.10), (0.0, -0.158, 0.0), pi / 2),
    (4, Capsule(0.05, 0.13), (-0.0825, 0.2, 0.0), pi / 2),
    (6, Sphere(0.045), (0.04, 0.0, 0.0), 0.0),
    (7, Capsule(0.04, 0.045), (0.0, 0.0, 0.1), 0.0),
)
"""Link, shape, position, and turn about x; the arm is a Panda's, its shapes are slimmer."""
_BASE = (
    ("base_x", JointType.PRISMATIC, (1.0, 0.0, 0.0)),
    ("base_y", JointType.PRISMATIC, (0.0, 1.0, 0.0)),
    ("base_yaw", JointType.REVOLUTE, (0.0, 0.0, 1.0)),
)


def one_arm() -> World:
    """An arm at the origin on the ground, a wall before it, and a free cube to the left of the wall."""
    sketch = Sketch("one_arm")
    sketch.ground()
    _arm(sketch, "arm", (0.0, 0.0, 0.0), 0.0)
    sketch.fixed("wall", Box(WALL), (0.5, 0.0, WALL[2]))
    sketch.free("cube", Box((CUBE, CUBE, CUBE)), (0.5, 0.3, CUBE + 0.001), 0.1)
    return sketch.world()


def two_arms() -> World:
    """Two arms 1.1 m apart that face each other, on the ground."""
    sketch = Sketch("two_arms")
    sketch.ground()
    _arm(sketch, "left", (-0.55, 0.0, 0.0), 0.0)
    _arm(sketch, "right", (0.55, 0.0, 0.0), pi)
    return sketch.world()


def on_wheels() -> World:
    """An arm on a base that slides along x and y and turns about z, on the ground, and a wall before it."""
    sketch = Sketch("on_wheels")
    sketch.ground()
    _arm(sketch, "arm", (0.0, 0.0, 0.2), 0.0, wheels=True)
    sketch.fixed("wall", Box(WALL), (1.0, 0.0, WALL[2]))
    return sketch.world()


def across(world: World, **more: object) -> PlanRequest:
    """From one side of the wall to the other."""
    more.setdefault("deadline", LONG)
    return PlanRequest(joints(world), LEFT, joint_goal=RIGHT, **more)  # pyright: ignore[reportArgumentType]


def reach(world: World, poses: Array, **more: object) -> PlanRequest:
    """From the left of the wall to poses (G, 7) of the tool."""
    goals = (ToolGoal("arm", "tool", poses),)
    more.setdefault("deadline", LONG)
    return PlanRequest(joints(world), LEFT, goals, **more)  # pyright: ignore[reportArgumentType]


def joints(world: World) -> tuple[str, ...]:
    """Names of all joints."""
    return tuple(joint.name for joint in world.joints)


def tool_pose(world: World, scene: Scene, joint_pos: Array, robot: str = "arm") -> Array:
    """World poses (..., 7) of a robot's tool, at its own joints (..., 7)."""
    chain = Chain.from_world(world, robot, "arm", "tool")
    joint_pos = np.asarray(joint_pos, dtype=float)
    base = np.broadcast_to(scene.body_pose[chain.root], (*joint_pos.shape[:-1], 7))
    return chain.tool_pose(base, joint_pos)


def _arm(sketch: Sketch, name: str, position: tuple[float, float, float], yaw: float, *, wheels: bool = False) -> None:
    bodies = [sketch.robot(name, position, _turn((0.0, 0.0, yaw)))]
    for joint, kind, axis in _BASE if wheels else ():
        heavy = inertial(Sphere(0.1), 20.0)
        body = sketch.link(joint, bodies[0], kind, axis, heavy, lower=-3.0, upper=3.0, velocity_limit=1.0)
        sketch.drive(body)
        bodies = [body]
    if wheels:
        sketch.geoms.append(Geom(f"{name}.wheels", bodies[0], Box((0.2, 0.15, 0.05)), (0.0, 0.0, -0.1)))
    for number, link in enumerate(PANDA_LINKS, 1):
        body = sketch.link(
            f"link{number}",
            bodies[-1],
            link.type,
            link.axis,
            inertial(Sphere(0.05), 1.0),
            position=link.xyz,
            quaternion=_turn(link.rpy),
            lower=link.lower,
            upper=link.upper,
            velocity_limit=link.velocity_limit,
            initial=link.initial,
        )
        sketch.drive(body)
        bodies.append(body)
    for link, shape, place, turn in _SHAPES:
        geom = f"{name}.geom{link}"
        sketch.geoms.append(Geom(geom, bodies[link], shape, place, _turn((turn, 0.0, 0.0))))
    sketch.sites.append(Site(f"{name}.tool", bodies[-1], PANDA_TOOL[0], _turn(PANDA_TOOL[1])))


def _turn(rpy: tuple[float, float, float]) -> tuple[float, float, float, float]:
    x, y, z, w = P.from_roll_pitch_yaw(np.array(rpy)).tolist()
    return (x, y, z, w)
