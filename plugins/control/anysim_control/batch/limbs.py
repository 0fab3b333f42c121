"""The serial chains of a channel, one for each tool, and where each begins."""

from dataclasses import dataclass

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.errors import TaskError, listing
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.forward_kinematics import joint_pose
from anysim.model.world import ORIGIN, World
from anysim_control.tools.frames import ToolFrames


@dataclass(frozen=True)
class Limb:
    """A tool's chain.

    Attributes:
        chain: its joints from the base to the tool.
        columns: (K',) of the channel's K joints, in the chain's order.
    """

    chain: Chain
    columns: Array
    _world: World
    _before: tuple[tuple[int, int], ...]
    """(body, joint's column among the robot's J) between the base and the chain's first joint."""

    def base(self, joint_pos: Array) -> Array:
        """(E, 7) where the chain begins, in the base's frame.

        The chain takes what lies before its first joint to stand at its initial position; it stands where `joint_pos`
        (E, J) says.
        """
        here = _identity(len(joint_pos))
        initial = _identity(1)
        for body, column in self._before:
            joint = self._world.body_joint[body]
            frame = self._world.bodies[body]
            rest = np.array([*frame.position, *frame.quaternion])
            start = np.array([self._world.joints[joint].initial])
            here = P.compose(
                P.compose(here, np.broadcast_to(rest, here.shape)), joint_pose(self._world, joint, joint_pos[:, column])
            )
            initial = P.compose(P.compose(initial, rest[None]), joint_pose(self._world, joint, start))
        return P.compose(here, np.broadcast_to(P.inverse(initial), here.shape)) if self._before else here


def limbs(frames: ToolFrames) -> list[Limb]:
    """The chains of the tools of a channel.

    Raises:
        TaskError: two tools share a joint, a joint of another channel lies between two of a chain, or a joint follows
            another; says which controller can do it.
    """
    channel, robot = frames.channel, frames.robot
    where = f"batched_ik of '{robot.name}.{channel.name}'"
    remedy = "pink_ik takes it"
    names = robot.kinematics.joint_names
    own = channel.joint_columns.tolist()
    if len(frames.moving) != len(own):
        followers = [names[c] for c in frames.moving if c not in own]
        raise TaskError(f"{where}: {listing(followers)} follow joints of the channel (mimic), not a chain; {remedy}")
    made: list[Limb] = []
    taken: dict[int, str] = {}
    for tool in frames.names:
        path = frames.ancestors(tool)
        mine = [c for c in path if c in own]
        for column in mine:
            if column in taken:
                words = f"tools '{taken[column]}' and '{tool}' share the joint '{names[column]}'; {remedy}"
                raise TaskError(f"{where}: {words}")
            taken[column] = tool
        first = path.index(mine[0])
        between = [names[c] for c in path[first:] if c not in own]
        if between:
            raise TaskError(f"{where}: {listing(between)} of another channel lie between its joints; {remedy}")
        chain = Chain.from_world(robot.world, robot.name, channel.name, tool, joints=robot.joints[mine])
        world = robot.world
        before = tuple((world.joints[robot.joints[c]].body, int(c)) for c in path[:first])
        made.append(Limb(chain, np.array([own.index(c) for c in mine]), world, before))
    return made


def _identity(rows: int) -> Array:
    return np.tile(P.pose(ORIGIN, IDENTITY_QUATERNION), (rows, 1))
