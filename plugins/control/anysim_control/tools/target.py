"""Targets of tools: absolute poses or positions, steps, or speeds, as an action asks for them."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_control.tools.frames import ToolFrames

ToolNames = Annotated[
    str | tuple[str, ...] | None,
    Field(
        description="the tools that the action is for; the first that the channel moves (of each group) if not given"
    ),
]
FrameName = Annotated[
    Literal["base", "world"], Field(description="the axes and origin of the action: those of the robot's base or world")
]
CommandName = Annotated[
    Literal["pose", "position", "delta", "twist"],
    Field(
        description="per tool: pose [x, y, z, qx, qy, qz, qw]; position [x, y, z], the orientation left free; delta, a "
        "step of the target, and twist, its speed: translation and rotation in [-1, 1] of the largest"
    ),
]
StepLength = Annotated[float, Field(gt=0, description="delta: the largest step of a target in a control step [m]")]
StepAngle = Annotated[float, Field(gt=0, description="delta: the largest turn of a target in a control step [rad]")]
Speed = Annotated[float, Field(gt=0, description="twist: the largest speed of a target [m/s]")]
TurnRate = Annotated[float, Field(gt=0, description="twist: the largest rate of turn of a target [rad/s]")]

LEASH, LEASH_ANGLE = 0.1, 0.5
"""[m], [rad] how far steps and speeds take a target from where the reference of its tool is: beyond the reach of an arm
a target would wind up, and come back late."""

_LABELS = {
    "pose": ("x", "y", "z", "qx", "qy", "qz", "qw"), "position": ("x", "y", "z"),
    "delta": ("dx", "dy", "dz", "rx", "ry", "rz"), "twist": ("vx", "vy", "vz", "wx", "wy", "wz"),
}  # fmt: skip


class ToolTargets:
    """Turns actions into targets of the tools of `frames`, base frame. Rows are independent of each other.

    A quaternion need not have length one; one that is zero asks for the orientation asked for before.

    Attributes:
        dim, low, high, labels: of the action, see `Controller`. Positions in the base's frame are bounded by the reach
            of the robot, in the world's not at all, for where a base stands may be drawn.
        oriented: whether the orientation of the tools matters.
        stepping: whether actions move targets from where they are.
    """

    def __init__(
        self,
        frames: ToolFrames,
        num_envs: int,
        *,
        command: str,
        frame: str,
        step_length: float,
        step_angle: float,
        speed: float,
        turn_rate: float,
    ) -> None:
        self._frames, self._command, self._world = frames, command, frame == "world"
        self.oriented, self.stepping = command != "position", command in ("delta", "twist")
        labels = _LABELS[command]
        several = len(frames) > 1
        self.labels = tuple(f"{name}.{label}" if several else label for name in frames.names for label in labels)
        self.dim = len(self.labels)
        high = np.ones(len(labels))
        if command in ("pose", "position"):
            high[:3] = np.inf if self._world else frames.reach
        self.high = np.tile(high, len(frames))
        self.low = -self.high
        dt = frames.robot.control_dt
        length, angle = (speed * dt, turn_rate * dt) if command == "twist" else (step_length, step_angle)
        self._scale = np.array([length] * 3 + [angle] * 3)
        self._target = np.tile(P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), (num_envs, len(frames), 1))
        """(N, T, 7) in the action's frame."""

    def reset(self, env_ids: Array, poses: Array, base: Array) -> None:
        """The tools are asked to stay at `poses` (E, T, 7), base frame; the base is at (E, 7)."""
        self._target[env_ids] = self._outward(poses, base)

    def apply(self, action: Array, env_ids: Array | None, poses: Array | None, base: Array) -> Array:
        """Targets (E, T, 7), base frame, of actions (E, dim).

        `poses` (E, T, 7) are those of the reference now, base frame; `stepping` targets do not leave them far behind.
        """
        rows = slice(None) if env_ids is None else env_ids
        asked = action.reshape(len(action), len(self._frames), -1)
        before = self._target[rows]
        if self._command == "pose":
            length = P.norm(asked[..., 3:])[..., None]
            turn = np.where(length > 1e-9, asked[..., 3:] / np.where(length > 1e-9, length, 1.0), before[..., 3:])
            target = np.concatenate([asked[..., :3], turn], axis=-1)
        elif self._command == "position":
            target = np.concatenate([asked, before[..., 3:]], axis=-1)
        else:
            target = _moved(before, asked * self._scale)
            if poses is not None:
                target = _leashed(target, self._outward(poses, base))
        self._target[rows] = target
        return self._inward(target, base)

    def action_for(self, poses: Array, env_ids: Array, base: Array) -> Array:
        """The action (E, dim), within its bounds, that brings the targets nearest to `poses` (E, T, 7), base frame."""
        wanted = self._outward(poses, base)
        if self._command == "pose":
            action = wanted
        elif self._command == "position":
            action = wanted[..., :3]
        else:
            now = self._target[env_ids]
            turn = P.rotation_vector(P.multiply(wanted[..., 3:], P.conjugate(now[..., 3:])))
            action = np.concatenate([wanted[..., :3] - now[..., :3], turn], axis=-1) / self._scale
        return np.clip(action.reshape(len(action), -1), self.low, self.high)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the targets."""
        return {"target": self._target[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        self._target[env_ids] = data["target"]

    def _outward(self, poses: Array, base: Array) -> Array:
        return P.compose(_beside(base, poses), poses) if self._world else poses

    def _inward(self, poses: Array, base: Array) -> Array:
        return P.compose(P.inverse(_beside(base, poses)), poses) if self._world else poses


def _beside(base: Array, poses: Array) -> Array:
    """Base poses (E, 7), one for each tool."""
    return np.broadcast_to(base[:, None], poses.shape)


def _moved(pose: Array, change: Array) -> Array:
    """Poses (..., 7) moved by (..., 6): translation and rotation vector in the axes that the poses are in."""
    turned = P.normalize(P.multiply(_turn(change[..., 3:]), pose[..., 3:]))
    return np.concatenate([pose[..., :3] + change[..., :3], turned], axis=-1)


def _turn(vector: Array) -> Array:
    angle = P.norm(vector)
    return P.from_axis_angle(vector / np.where(angle > 0.0, angle, 1.0)[..., None], angle)


def _share(length: Array, most: float) -> Array:
    return np.where(length > most, most / np.where(length > most, length, 1.0), 1.0)


def _leashed(target: Array, now: Array) -> Array:
    """Targets (..., 7) at most LEASH and LEASH_ANGLE from poses (..., 7)."""
    away = target[..., :3] - now[..., :3]
    position = now[..., :3] + away * _share(P.norm(away), LEASH)[..., None]
    turn = P.rotation_vector(P.multiply(target[..., 3:], P.conjugate(now[..., 3:])))
    share = _share(P.norm(turn), LEASH_ANGLE)[..., None]
    held = P.normalize(P.multiply(_turn(turn * share), now[..., 3:]))
    return np.concatenate([position, np.where(share < 1.0, held, target[..., 3:])], axis=-1)
