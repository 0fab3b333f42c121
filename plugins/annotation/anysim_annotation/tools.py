"""Tools of robots as an annotator sees them: where they are, and where their drives were told to bring them."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.frames import FixedFrame, find_frame
from anysim.model.world import World
from anysim_annotation.view import View


class Tool(NamedTuple):
    """A named frame of a robot, such as `panda.tool`."""

    name: str
    robot: str
    frame: FixedFrame


def tools_of(world: World, names: tuple[str, ...] = ()) -> tuple[Tool, ...]:
    """Tools by name, those of all robots if none is named.

    Raises:
        NameLookupError: there is no such frame.
    """
    every = tuple(f"{robot.name}.{tool}" for robot in world.robots for tool in robot.tools)
    return tuple(Tool(name, name.partition(".")[0], find_frame(world, name)) for name in names or every)


def placed(frame: FixedFrame, body_pose: Array) -> Array:
    """Poses (E, 7) of a frame with bodies at poses (E, B, 7)."""
    local = P.pose(frame.position, frame.quaternion)
    if frame.body < 0:
        return np.repeat(local[None], len(body_pose), axis=0)
    return P.compose(body_pose[:, frame.body], np.broadcast_to(local, (len(body_pose), 7)))


def commanded(tool: Tool, view: View) -> Array | None:
    """Poses (E, 7) of a tool with its robot's joints where position drives are told to bring them; None if unknown."""
    world = view.scene.world
    if view.joint_pos is None or view.commands is None:
        return None
    joints = view.joint_pos.copy()
    owner = world.entities[world.entity_numbers[tool.robot]]
    for number, actuator in enumerate(world.actuators):
        if owner.joint_start <= actuator.joint < owner.joint_stop:
            joints[:, actuator.joint] = view.commands[:, number]
    for number in range(owner.joint_start, owner.joint_stop):
        follows = world.joints[number].mimic
        if follows is not None:
            joints[:, number] = follows.multiplier * joints[:, follows.joint] + follows.offset
    return placed(tool.frame, forward_kinematics(world, view.body_pose, joints))
