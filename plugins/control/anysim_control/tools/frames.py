"""Tools of a channel, and the joints that move them.

Everything is in the frame of the robot's base, floating or not, so that a base that moves changes no kinematics.
"""

from collections.abc import Iterator

import numpy as np

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.kinematics.pinocchio_model import from_se3, pinocchio, se3
from anysim.model.world import JointType


class ToolFrames:
    """The tools of a channel and the joints that move them.

    Attributes:
        names: of the T tools, in the order of the action.
        frames: (T,) Pinocchio's indices of them.
        spread: (J, K) how the robot's joints move with the channel's: 1 for its own, a multiplier for a follower.
        reach: [m] no tool can be further from the base's origin, whatever the joints do.
    """

    def __init__(self, channel: ChannelView, wanted: str | tuple[str, ...] | None) -> None:
        self.channel, self.robot = channel, channel.robot
        self._model = channel.robot.kinematics
        self._floating = 6 if self._model.floating else 0
        columns = channel.joint_columns
        if len(set(columns.tolist())) != len(columns):
            raise TaskError(f"channel '{self.robot.name}.{channel.name}' drives a joint twice; a tool needs each once")
        joints = len(self._model.joints)
        self.spread = np.zeros((joints, len(columns)))
        self.spread[columns, np.arange(len(columns))] = 1.0
        self._followers: list[tuple[int, int, float, float]] = []
        for follower, leader, multiplier, offset in self._mimics():
            if follower not in columns and leader in columns:
                self.spread[follower] = multiplier * self.spread[leader]
                self._followers.append((follower, leader, multiplier, offset))
        self.moving = np.flatnonzero(np.abs(self.spread).sum(axis=1) > 0)
        self.names = self._chosen(wanted)
        self.frames = np.array([self._model.frame(name) for name in self.names], dtype=int)
        self.reach = max(self._reach(name) for name in self.names)
        self._data = self._model.model.createData()

    def __len__(self) -> int:
        """The number of tools T."""
        return len(self.names)

    # ------------------------------------------------------------------ computing

    def whole(self, measured: Array, channel_pos: Array) -> Array:
        """(E, J): measured positions, with the channel's (E, K) and what follows them in their places."""
        joint_pos = np.array(measured)
        joint_pos[:, self.channel.joint_columns] = channel_pos
        for follower, leader, multiplier, offset in self._followers:
            joint_pos[:, follower] = multiplier * joint_pos[:, leader] + offset
        return joint_pos

    def poses(self, joint_pos: Array) -> Array:
        """(E, T, 7) of the tools, base frame [m, xyzw], at joint positions (E, J)."""
        pin, model = pinocchio(), self._model.model
        out = np.empty((len(joint_pos), len(self), 7))
        for row, position in enumerate(joint_pos):
            pin.forwardKinematics(model, self._data, self._model.q(position))
            for t, frame in enumerate(self.frames):
                out[row, t] = from_se3(pin.updateFramePlacement(model, self._data, int(frame)))
        return out

    def poses_and_jacobians(self, position: Array) -> tuple[list, Array]:
        """Pinocchio's placements of the tools at joint positions (J,), and their Jacobians (T, 6, K), base axes."""
        pin, model, data = pinocchio(), self._model.model, self._data
        pin.computeJointJacobians(model, data, self._model.q(position))
        jacobian = np.empty((len(self), 6, self.spread.shape[1]))
        places = []
        for t, frame in enumerate(self.frames):
            places.append(pin.updateFramePlacement(model, data, int(frame)).copy())
            whole = pin.getFrameJacobian(model, data, int(frame), pin.LOCAL_WORLD_ALIGNED)
            jacobian[t] = whole[:, self._floating :] @ self.spread
        return places, jacobian

    def errors(self, places: list, targets: Array) -> Array:
        """(T, 6) from the tools to their targets (T, 7): distance [m] and rotation vector [rad], base axes."""
        pin = pinocchio()
        out = np.empty((len(places), 6))
        for t, place in enumerate(places):
            goal = se3(targets[t])
            out[t, :3] = goal.translation - place.translation
            out[t, 3:] = pin.log3(goal.rotation @ place.rotation.T)
        return out

    # ------------------------------------------------------------------ choosing

    def ancestors(self, tool: str) -> tuple[int, ...]:
        """The robot's joints (of its J) between the base and a tool, from the base."""
        model = self._model.model
        joint = model.frames[self._model.frame(tool)].parentJoint
        found: list[int] = []
        while joint > 0:
            if model.joints[joint].nv == 1:
                found.append(model.joints[joint].idx_v - self._floating)
            joint = model.parents[joint]
        return tuple(reversed(found))

    def _mimics(self) -> Iterator[tuple[int, int, float, float]]:
        first = int(self._model.joints[0]) if len(self._model.joints) else 0
        for column, joint in enumerate(self._model.joints):
            mimic = self.robot.world.joints[joint].mimic
            if mimic is not None:
                yield column, mimic.joint - first, mimic.multiplier, mimic.offset

    def _chosen(self, wanted: str | tuple[str, ...] | None) -> tuple[str, ...]:
        where = f"'{self.robot.name}.{self.channel.name}'"
        known = list(self.robot.robot.tools)
        moved = [name for name in known if set(self.ancestors(name)) & set(self.moving.tolist())]
        if wanted is None:
            if not moved:
                words = f"tools of the robot: {listing(known)}" if known else "the robot has none in the catalogue"
                raise TaskError(f"channel {where} moves no tool ({words}); controllers of tools need one")
            return self._of_groups(moved) or (moved[0],)
        names = (wanted,) if isinstance(wanted, str) else tuple(wanted)
        if not names or len(set(names)) != len(names):
            raise TaskError(f"`tool` of {where}: expected one name or several different ones, got {list(names)}")
        for name in names:
            if name not in known:
                raise TaskError(f"{where}: there is no tool '{name}'{suggest(name, known)} (tools: {listing(known)})")
            if name not in moved:
                raise TaskError(f"channel {where} does not move tool '{name}' (it moves: {listing(moved)})")
        return names

    def _of_groups(self, moved: list[str]) -> tuple[str, ...]:
        """The first tool of each group of the channel."""
        entry = self.robot.robot.entry
        if entry is None or self.channel.name not in entry.channels:
            return ()
        tools = {name: entry.tools[name].group for name in moved if name in entry.tools}
        firsts = [
            next((name for name, group in tools.items() if group == wanted), None)
            for wanted in entry.channels[self.channel.name].groups
        ]
        return tuple(name for name in firsts if name is not None)

    def _reach(self, tool: str) -> float:
        model = self._model.model
        frame = model.frames[self._model.frame(tool)]
        total, joint = float(np.sqrt((frame.placement.translation**2).sum())), frame.parentJoint
        while joint > 0:
            if model.joints[joint].nv == 1:
                total += float(np.sqrt((model.jointPlacements[joint].translation ** 2).sum()))
                column = model.joints[joint].idx_v - self._floating
                if self.robot.world.joints[self._model.joints[column]].type is JointType.PRISMATIC:
                    total += float(max(abs(self._model.lower[column]), abs(self._model.upper[column])))
            joint = model.parents[joint]
        return total
