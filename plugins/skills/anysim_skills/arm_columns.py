"""Columns of an arm in the action of its channel, which may be one of several arms there."""

from dataclasses import replace

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.kinematics.chain import Chain
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView


class ArmColumns:
    """The part of a robot's action that moves one of its tools: a channel, or the group of it that the tool names.

    Attributes:
        chain: the joints, from the robot's base to the tool.
    """

    def __init__(self, env: TaskEnv, robot: RobotView, channel: str, tool: str) -> None:
        """See `Arm.of`.

        Raises:
            NameLookupError: the robot has no such channel or tool.
            TaskError: the channel has no controller, or one that does not take the joints of an arm by themselves.
        """
        world = env.engine.world
        self._slice = env.actions.slice_of(robot.name, channel)
        controller = self._slice.controller
        group = _group(robot, channel, tool)
        members = None if group is None else [env.engine.index.joint(f"{robot.name}.{name}") for name in group]
        chain = Chain.from_world(world, robot.name, channel, tool, joints=members)
        # under a planar base are joints that begin at zero: the chain is the same from the body that they move
        self.chain = replace(chain, root=controller.robot.root)
        self._drives = len(controller.channel)
        self._part: Array | None = None
        """(K,) columns of the channel's, in the chain's order; None: all of them."""
        if members is None:
            return
        if controller.dim != self._drives:
            raise TaskError(
                f"'{robot.name}.{channel}' moves the arm of '{tool}' as one of several, and "
                f"{type(controller).__name__} takes {controller.dim} numbers for {self._drives} joints; "
                "give the channel joint_position or joint_delta_position"
            )
        driven = [world.actuators[a].joint for a in controller.channel.actuators]
        self._part = np.array([driven.index(joint) for joint in chain.joints.tolist()])

    def write(self, ids: Array, joints: Array, action: Array) -> None:
        """Write what brings the chain's joints to positions (n, K) into the rows `ids` of the action."""
        controller, start = self._slice.controller, self._slice.start
        if self._part is None:
            action[ids, start : self._slice.stop] = controller.action_for(joints, ids)
            return
        targets = np.zeros((len(ids), self._drives))  # what they say of the other arms is not written
        targets[:, self._part] = joints
        action[ids[:, None], start + self._part] = controller.action_for(targets, ids)[:, self._part]


def _group(robot: RobotView, channel: str, tool: str) -> tuple[str, ...] | None:
    """The joints that the catalogue gives to the arm of a tool, where its channel has several arms."""
    entry = robot.model.entry
    if entry is None or channel not in entry.channels or tool not in entry.tools:
        return None
    return entry.channels[channel].groups.get(entry.tools[tool].group or "")
