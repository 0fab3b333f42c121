"""The PD terms of learned locomotion: position targets around home, velocity targets, or efforts, per joint.

The formulas are those of the LeggedGym family: with a the scaled action, P: kp (a + home - q) - kd qd; V: kd (a - qd);
T: a; clipped to the effort limit. They are the engine's own drive modes, so they hold in every physics step.
"""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.model.world import ControlMode

ControlType = Literal["P", "V", "T"]
_MODES = {"P": ControlMode.POSITION, "V": ControlMode.VELOCITY, "T": ControlMode.EFFORT}


class Pd(Controller):
    """The action, scaled, moves position targets around home (P), or is a velocity (V) or an effort (T) itself.

    kp, kd and the effort limit are those of the channel's gains.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        control_type: Annotated[
            ControlType | dict[str, ControlType],
            Field(description="P, V or T; or one by joint name, `*` matches any part, a later one wins"),
        ] = "P",
        action_scale: Annotated[
            float | dict[str, float],
            Field(description="what an action of 1 means [rad, rad/s, N m]; or one by joint name, as above"),
        ] = 0.25,
        clip: Annotated[float, Field(gt=0, description="largest action")] = 1.0,
        offset: Annotated[
            dict[str, float],
            Field(description="position targets of an action of 0 by joint name, where they differ from home"),
        ] = {},  # noqa: B006  (never written to)
    ) -> None:
        super().__init__(channel, num_envs)
        robot = channel.robot
        self.joints = tuple(robot.world.actuators[a].name.removeprefix(f"{robot.name}.") for a in channel.actuators)
        self.dim = len(self.joints)
        self.low, self.high = np.full(self.dim, -clip), np.full(self.dim, clip)
        types = self._each("control_type", control_type)
        self.mode = tuple(_MODES[t] for t in types)
        self.scale = np.array(self._each("action_scale", action_scale), dtype=float)
        home = [robot.world.joints[robot.world.actuators[a].joint].initial for a in channel.actuators]
        given = self._matched("offset", offset)
        self.home = np.array([h if g is None else g for h, g in zip(home, given, strict=True)], dtype=float)
        self._position, self._velocity, self._effort = (np.array([t == k for t in types], dtype=float) for k in "PVT")
        self._only_positions = bool(self._position.all())

    def _matched(self, parameter: str, values: Mapping[str, Any]) -> list[Any]:
        """For each joint the last value whose pattern matches it."""
        for pattern in values:
            if not any(fnmatchcase(joint, pattern) for joint in self.joints):
                raise TaskError(
                    f"{parameter}: no joint of '{self.robot.name}.{self.channel.name}' matches '{pattern}'"
                    f"{suggest(pattern, list(self.joints))} (joints: {listing(self.joints, 20)})"
                )
        found: list[Any] = []
        for joint in self.joints:
            matching = [value for pattern, value in values.items() if fnmatchcase(joint, pattern)]
            found.append(matching[-1] if matching else None)
        return found

    def _each(self, parameter: str, value: Any) -> list[Any]:
        if not isinstance(value, Mapping):
            return [value] * self.dim
        found = self._matched(parameter, value)
        chosen = [v for v in found if v is not None]
        if len(chosen) < self.dim:
            lost = [joint for joint, v in zip(self.joints, found, strict=True) if v is None]
            raise TaskError(
                f"{parameter}: nothing for the joints {listing(lost, 20)}; add them, or first a pattern '*'"
            )
        return chosen

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        scaled = self.scale * action
        if self._only_positions:
            return Command(position=self.home + scaled)
        return Command(self.home + self._position * scaled, self._velocity * scaled, self._effort * scaled)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        if not self._only_positions:
            return super().action_for(targets, env_ids)
        return np.minimum(np.maximum((targets - self.home) / self.scale, self.low), self.high)
