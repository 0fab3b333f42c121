"""Observation of a policy, measured from its robot and put in its order."""

import numpy as np

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.math import pose as P
from anysim_policy.spec import PolicySpec

_DOWN = np.array([0.0, 0.0, -1.0])


class Layout:
    """The observation (E, D) of a policy.

    Attributes:
        joints: names of the policy's joints, in its order.
        columns: (A,) where they stand among the drives of the channel.
        home: (A,) joint positions of an output of 0 [rad, m].
        size: components D of the observation.
    """

    def __init__(self, spec: PolicySpec, channel: ChannelView) -> None:
        robot = channel.robot
        world = robot.world
        own = [world.actuators[a].name.removeprefix(f"{robot.name}.") for a in channel.actuators]
        self.joints = spec.joints or tuple(own)
        for name in (*self.joints, *spec.offset):
            if name not in own:
                raise TaskError(
                    f"the policy's joint '{name}' is not in '{robot.name}.{channel.name}'{suggest(name, own)} "
                    f"(joints: {listing(own, 20)})"
                )
        left = [name for name in own if name not in self.joints]
        if left or len(set(self.joints)) != len(self.joints):
            raise TaskError(
                f"the policy's joints must be those of the channel, each once; left out: {listing(left, 20)}"
            )
        self.columns = np.array([own.index(name) for name in self.joints])
        initial = {
            n: world.joints[world.actuators[a].joint].initial for n, a in zip(own, channel.actuators, strict=True)
        }
        self.home = np.array([spec.offset.get(name, initial[name]) for name in self.joints], dtype=float)
        self._channel, self._terms, self._clip = channel, [t.term for t in spec.observations], spec.observation_clip
        k = len(self.joints)
        sizes = {
            "base_lin_vel": 3, "base_ang_vel": 3, "projected_gravity": 3, "command": len(spec.commands), "joint_pos": k,
            "joint_vel": k, "last_action": k, "clock": 2,
        }  # fmt: skip
        scales: list[Array] = []
        for place, term in enumerate(spec.observations):
            size = sizes[term.term]
            if isinstance(term.scale, tuple) and len(term.scale) != size:
                raise TaskError(
                    f"observations.{place}.scale: expected 1 number or {size} for '{term.term}', got {len(term.scale)}"
                )
            scales.append(np.broadcast_to(np.array(term.scale, dtype=float), (size,)))
        self._scale = np.concatenate(scales)
        self.size = len(self._scale)

    def observe(self, env_ids: Array | None, command: Array, last: Array, phase: Array) -> Array:
        """The observation (E, D) float32; `command` (E, C), `last` (E, A) output, `phase` (E,) in turns."""
        parts = [self._term(term, env_ids, command, last, phase) for term in self._terms]
        rows = np.concatenate(parts, axis=1) * self._scale
        return np.minimum(np.maximum(rows, -self._clip), self._clip).astype(np.float32)

    def _term(self, term: str, env_ids: Array | None, command: Array, last: Array, phase: Array) -> Array:
        robot, channel = self._channel.robot, self._channel
        if term == "command":
            return command
        if term == "last_action":
            return last
        if term == "clock":
            return np.stack([np.sin(2.0 * np.pi * phase), np.cos(2.0 * np.pi * phase)], axis=1)
        if term == "joint_pos":
            return channel.joint_pos(env_ids)[:, self.columns] - self.home
        if term == "joint_vel":
            return channel.joint_vel(env_ids)[:, self.columns]
        turn = robot.base_pose(env_ids)[:, 3:]
        if term == "projected_gravity":
            return P.rotate_inverse(turn, np.broadcast_to(_DOWN, (len(turn), 3)))
        twist = robot.base_twist(env_ids)
        return P.rotate_inverse(turn, twist[:, :3] if term == "base_lin_vel" else twist[:, 3:])
