"""The controller `policy`: a learned policy drives a channel, and the channel's action tells it what to do."""

from collections.abc import Mapping
from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import Field

from anysim import registry
from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import ControlMode
from anysim.plugin_parameters import options_model, parameters
from anysim_policy.layout import Layout
from anysim_policy.spec import PolicySpec

_MODES = {"P": ControlMode.POSITION, "V": ControlMode.VELOCITY, "T": ControlMode.EFFORT}


class LearnedPolicy(Protocol):
    """What an entry point of the group `anysim.policies` makes of a channel and keyword-only parameters."""

    spec: PolicySpec
    layout: Layout

    def act(self, observation: Array) -> Array:
        """The output (E, A) for observations (E, D); a row does not depend on the others."""
        ...


class Policy(Controller):
    """Runs a policy at its own rate. Its output becomes position targets, velocities or efforts of the drives.

    The drives' gains are those of the catalogue; a policy that was trained with others needs
    `robots.NAME.dynamics` to change them.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        policy: Annotated[str, Field(description="an installed kind of policy, as in `anysim list policies`")] = "file",
        options: Annotated[dict[str, Any], Field(description="its parameters, as `{file: package:NAME/walk.yaml}`")],
    ) -> None:
        super().__init__(channel, num_envs)
        made = registry.load("policies", policy)
        given = options_model(made).model_validate(options)
        with registry.using("policies", policy, (ValueError,)):
            self._policy: LearnedPolicy = made(channel, **{key: getattr(given, key) for key in parameters(made)})
        spec, self._layout = self._policy.spec, self._policy.layout
        self.dim, self.labels = len(spec.commands), tuple(c.name for c in spec.commands)
        self.low = np.array([c.low for c in spec.commands], dtype=float)
        self.high = np.array([c.high for c in spec.commands], dtype=float)
        self.mode = _MODES[spec.control_type]
        joints = len(self._layout.joints)
        if isinstance(spec.action_scale, tuple) and len(spec.action_scale) != joints:
            raise TaskError(f"action_scale: expected one number or {joints}, got {len(spec.action_scale)}")
        self._scale = np.broadcast_to(np.array(spec.action_scale, dtype=float), (joints,))
        self._clip, self._frequency = spec.action_clip, spec.frequency
        self._step = self._period(spec.period)
        self.period = None if self._step == self.robot.control_dt else self._step
        self._command = np.zeros((num_envs, self.dim))
        self._last = np.zeros((num_envs, joints))
        self._ticks = np.zeros(num_envs, dtype=np.int64)

    def _period(self, period: float | None) -> float:
        """Seconds between evaluations: whole physics steps, and a whole number of times in a control step."""
        whole, dt = self.robot.control_dt, self.robot.dt
        if period is None:
            return whole
        often, steps = whole / period, period / dt
        if often < 1 - 1e-6 or abs(often - round(often)) > 1e-6 or abs(steps - round(steps)) > 1e-6:
            raise TaskError(
                f"the policy's period of {period:g} s does not fit: physics.control_dt ({whole:g} s) must be a whole "
                f"number of periods, and a period a whole number of physics.dt ({dt:g} s)"
            )
        return whole if round(often) == 1 else period

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._command[env_ids] = 0.0
        self._last[env_ids] = 0.0
        self._ticks[env_ids] = 0

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        self._command[slice(None) if env_ids is None else env_ids] = action
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        phase = self._ticks[rows] * self._step * self._frequency
        observed = self._layout.observe(env_ids, self._command[rows], self._last[rows], phase)
        given = np.minimum(np.maximum(self._policy.act(observed), -self._clip), self._clip)
        self._last[rows] = given
        self._ticks[rows] += 1
        values = np.empty_like(given)
        values[:, self._layout.columns] = self._scale * given + (
            self._layout.home if self.mode is ControlMode.POSITION else 0.0
        )
        if self.mode is ControlMode.POSITION:
            return Command(position=values)
        return Command(velocity=values) if self.mode is ControlMode.VELOCITY else Command(effort=values)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"command": self._command[env_ids], "last": self._last[env_ids], "ticks": self._ticks[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._command[env_ids], self._last[env_ids] = data["command"], data["last"]
        self._ticks[env_ids] = data["ticks"]
