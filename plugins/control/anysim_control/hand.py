"""Hands with several fingers: every joint by itself, or a few grasp postures blended."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest


class GripperMultiFinger(Controller):
    """Moves the fingers of a hand towards a posture, no faster than `speed`.

    With `mode: joints` the action is the posture: a target for each joint, within its limits. With `mode: synergies`
    it is one number in [0, 1] for each of the channel's synergies, and the posture is

        opened + sum_k action_k (synergy_k - opened)

    so that 0 opens, 1 of one alone is that grasp, and grasps may be blended. The sum is kept within the joints' limits,
    or as far beyond them as the catalogue's own postures go: what lies beyond contact is how hard the fingers press.

    A joint that follows another (mimic) is not commanded: it has no component of the action, and where it has a drive,
    that goes where the leader's target puts it.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        mode: Annotated[
            Literal["joints", "synergies"], Field(description="what the action is: every joint, or grasps by name")
        ] = "joints",
        synergies: Annotated[
            tuple[str, ...] | None,
            Field(min_length=1, description="mode synergies: which of the channel's, in the order of the action"),
        ] = None,
        speed: Annotated[
            float | None,
            Field(gt=0, description="how fast targets move [rad/s, m/s]; the joints' velocity limits where not given"),
        ] = None,
    ) -> None:
        super().__init__(channel, num_envs)
        self._leader, self._ratio, self._offset = _couplings(channel)
        """(K,) each: the target of drive k is ratio * target of drive leader + offset; its own for one that leads."""
        self._own = np.flatnonzero(self._leader == np.arange(len(channel)))
        limit = channel.velocity_limit if speed is None else np.minimum(channel.velocity_limit, speed)
        self._reach = limit * self.robot.control_dt
        """(K,) how far a target may move in a control step [rad, m]."""
        self._target = np.zeros((num_envs, len(channel)))
        self._postures: Array | None = None
        """(S, K) each synergy's way from `opened`."""
        if mode == "joints":
            if synergies is not None:
                raise TaskError("gripper_multi_finger has `synergies` chosen, but its `mode` is joints; set synergies")
            self.dim = len(self._own)
            self.low, self.high = channel.lower[self._own], channel.upper[self._own]
            names = _joint_names(channel)
            self.labels = tuple(names[k] for k in self._own)
            return
        opened, found = _synergies(channel, synergies)
        self.dim, self.labels = len(found), tuple(found)
        self.low, self.high = np.zeros(self.dim), np.ones(self.dim)
        self._opened, grasps = opened, np.array([found[name] for name in found])
        self._postures = grasps - opened
        self._lower = np.minimum(channel.lower, np.minimum(opened, grasps.min(axis=0)))
        self._upper = np.maximum(channel.upper, np.maximum(opened, grasps.max(axis=0)))

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._target[env_ids] = targets

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        now = self._target[rows]
        moved = now + np.minimum(np.maximum(self.posture(action) - now, -self._reach), self._reach)
        self._target[rows] = moved[:, self._leader] * self._ratio + self._offset
        return Command(position=self._target[rows])

    def posture(self, action: Array) -> Array:
        """Joint targets (E, K) that actions (E, dim) ask for in the end, whatever the speed."""
        if self._postures is None:
            wanted = np.zeros((len(action), len(self.channel)))
            wanted[:, self._own] = action
        else:
            wanted = np.tile(self._opened, (len(action), 1))
            for k, way in enumerate(self._postures):  # not a matrix product: a row's result is its own
                wanted += action[:, k : k + 1] * way
            wanted = np.minimum(np.maximum(wanted, self._lower), self._upper)
        return wanted[:, self._leader] * self._ratio + self._offset

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        """As `Controller.action_for`; with synergies the nearest posture by least squares, each within [0, 1]."""
        if self._postures is None:
            return np.minimum(np.maximum(targets[:, self._own], self.low), self.high)
        ways, wanted = self._postures[:, self._own], (targets - self._opened)[:, self._own]
        solved = [np.linalg.lstsq(ways.T, row, rcond=None)[0] for row in wanted]
        return np.minimum(np.maximum(np.array(solved).reshape(len(wanted), self.dim), 0.0), 1.0)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"target": self._target[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._target[env_ids] = data["target"]


def _joint_names(channel: ChannelView) -> list[str]:
    joints, prefix = channel.robot.world.joints, f"{channel.robot.name}."
    return [joints[channel.robot.joints[k]].name.removeprefix(prefix) for k in channel.joint_columns]


def _couplings(channel: ChannelView) -> tuple[Array, Array, Array]:
    """Of each drive: the drive of the channel that leads it, and the line between their targets. Chains are followed.

    Raises:
        TaskError: a joint of the channel follows one that the channel lacks.
    """
    joints = channel.robot.world.joints
    numbers = [int(channel.robot.joints[k]) for k in channel.joint_columns]
    drive = {joint: k for k, joint in enumerate(numbers)}
    leader, ratio, offset = np.arange(len(channel)), np.ones(len(channel)), np.zeros(len(channel))
    for k, joint in enumerate(numbers):
        at = joint
        while (mimic := joints[at].mimic) is not None:
            offset[k] += ratio[k] * mimic.offset
            ratio[k] *= mimic.multiplier
            at = mimic.joint
        if at not in drive:
            prefix = f"{channel.robot.name}."
            raise TaskError(
                f"'{joints[joint].name.removeprefix(prefix)}' follows '{joints[at].name.removeprefix(prefix)}', which "
                f"is not in the channel '{channel.name}'; put that one in it instead (it has: "
                f"{listing(_joint_names(channel))})"
            )
        leader[k] = drive[at]
    return leader, ratio, offset


def _synergies(channel: ChannelView, chosen: tuple[str, ...] | None) -> tuple[Array, dict[str, Array]]:
    """The opened posture (K,) and the chosen synergies (K,) by name.

    Raises:
        TaskError: the catalogue lacks one of them.
    """
    known = channel.robot.entry.channels[channel.name].synergies
    if channel.opened is None or not known:
        lacking = "`opened` posture" if known else "`synergies`"
        raise TaskError(
            f"channel '{channel.name}' of '{channel.robot.entry.name}' has no {lacking} in the catalogue, which "
            "gripper_multi_finger needs for `mode: synergies`; add them to the robot's entry or use `mode: joints`"
        )
    names = tuple(known) if chosen is None else chosen
    for number, name in enumerate(names):
        if name not in known:
            raise TaskError(
                f"channel '{channel.name}' has no synergy '{name}'{suggest(name, list(known))} "
                f"(it has: {listing(known)})"
            )
        if name in names[:number]:
            raise TaskError(f"synergy '{name}' is chosen twice; name each once (the channel has: {listing(known)})")
    return channel.opened, {name: np.array(known[name], dtype=float) for name in names}
