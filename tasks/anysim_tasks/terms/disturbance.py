"""Disturbances of walking robots: shoves, and where the mass is."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contract import changes_nothing_seen
from anysim.task.scene import RobotView, SceneView
from anysim_schemas.values import FloatValue, Vec3Value

Draw = Callable[..., Array]


class Shove:
    """For `when: step`: what a robot's base has of velocity grows at once by so much, every so many seconds.

    The base's joints keep their rates, so the whole robot is moved, and its feet have to follow.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        robot: RobotView,
        velocity: Annotated[Vec3Value, Field(description="world axes [m/s]")],
        every: Annotated[float, Field(gt=0, description="[s]")] = 5.0,
    ) -> None:
        self._scene, self._velocity = scene, velocity
        self._root = scene.index.entity(robot.name).root
        self._every = max(1, round(every / scene.engine.world.physics.control_dt))

    def __call__(self, draw: Draw) -> None:
        scene = self._scene
        due = scene.elapsed[scene.rows] % self._every == 0
        if not due.any():
            return
        ids = scene.env_ids[due]
        twist = scene.state.body_twist[ids, self._root][:, None].copy()
        twist[:, 0, :3] += draw("velocity", self._velocity, due)
        scene.engine.set_body_state(None, twist, ids, [self._root])


@changes_nothing_seen
def tip_over(
    scene: SceneView,
    draw: Draw,
    *,
    robot: RobotView,
    roll: Annotated[FloatValue, Field(description="[rad]")] = 0.0,
    pitch: Annotated[FloatValue, Field(description="[rad]")] = 0.0,
    lift: Annotated[FloatValue, Field(description="above where it was put [m]")] = 0.0,
) -> None:
    """A robot's base begins the episode tipped over about its own axes, and lifted so that it has room."""
    root = scene.index.entity(robot.name).root
    pose = scene.state.body_pose[scene.env_ids, root].copy()
    turn = P.from_roll_pitch_yaw(np.stack([draw("roll", roll), draw("pitch", pitch), np.zeros(len(pose))], axis=1))
    pose[:, 3:] = P.multiply(pose[:, 3:], turn)
    pose[:, 2] += draw("lift", lift)
    scene.engine.set_body_state(pose[:, None], None, scene.env_ids, [root])


@changes_nothing_seen
def com_offset(
    scene: SceneView,
    draw: Draw,
    *,
    robot: RobotView,
    offset: Annotated[Vec3Value, Field(description="in the axes of the base [m]")],
) -> None:
    """The centre of mass of a robot's base lies elsewhere in this episode."""
    root = scene.index.entity(robot.name).root
    built = np.array(scene.engine.world.bodies[root].inertial.com)
    scene.engine.set_parameters("body.com", (built + draw("offset", offset))[:, None], scene.env_ids, [root])
