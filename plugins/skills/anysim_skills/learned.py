"""Learned policies behind skills: the fingers or the arm do what a policy says, and the skill says what it is told.

A policy is one of the registry's, such as `file` of anysim-policy: it brings its own joints, observations and scale of
its output. The numbers that its description calls `commands` are features that the skill gives by their names.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from anysim import registry
from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.plugin_parameters import options_model, parameters
from anysim.skills.phases import Mover
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView

PERIOD = 1e-6
"""[s] a policy's period and the control step are the same within this."""


class Layout(Protocol):
    """What a policy observes, and the joints that it drives."""

    joints: tuple[str, ...]
    columns: Array
    home: Array

    def observe(self, env_ids: Array | None, command: Array, last: Array, phase: Array) -> Array:
        """The observation (E, D) of what it is told (E, C), its last output (E, A) and a phase (E,) in turns."""
        ...


class LearnedPolicy(Protocol):
    """What an entry point of `anysim.policies` makes of a channel: a description, a layout, and a function."""

    spec: Any
    layout: Layout

    def act(self, observation: Array) -> Array:
        """The output (E, A) for observations (E, D)."""
        ...


class Learned(Mover):
    """A channel of a robot in all envs, driven by a policy whose output are position targets.

    Attributes:
        told: (N, F) the features that the skill gives, in the order of `features`.
    """

    def __init__(
        self,
        env: TaskEnv,
        robot: RobotView,
        channel: str,
        policy: str,
        options: Mapping[str, Any],
        features: Sequence[str],
    ) -> None:
        """Raises TaskError where the policy wants other features than there are, another period, or other drives."""
        self.env = env
        self._slice = env.actions.slice_of(robot.name, channel)
        self._view: ChannelView = self._slice.controller.channel
        made = registry.load("policies", policy)
        given = options_model(made).model_validate(dict(options))
        with registry.using("policies", policy, (ValueError,)):
            self._policy: LearnedPolicy = made(self._view, **{key: getattr(given, key) for key in parameters(made)})
        spec = self._policy.spec
        wanted = [command.name for command in spec.commands]
        for name in wanted:
            if name not in features:
                raise TaskError(
                    f"the policy wants to be told '{name}'{suggest(name, list(features))}, which this skill does not "
                    f"give (features: {listing(list(features), 20)})"
                )
        dt = env.engine.world.physics.control_dt
        if spec.control_type != "P" or abs((spec.period or dt) - dt) > PERIOD:
            raise TaskError(
                f"a skill runs a policy of position targets (control_type P) in each control step of {dt:g} s, this "
                f"one has control_type {spec.control_type} and a period of {spec.period or dt:g} s; give the channel "
                "the controller `policy` for others"
            )
        self._told = np.array([features.index(name) for name in wanted], dtype=int)
        self._low, self._high = (np.array([getattr(c, end) for c in spec.commands]) for end in ("low", "high"))
        self._scale, self._clip = np.array(spec.action_scale, dtype=float), float(spec.action_clip)
        self._frequency, self._dt = float(spec.frequency), dt
        n, joints = env.num_envs, len(self._policy.layout.joints)
        self.told = np.zeros((n, len(features)))
        self._last, self._ticks = np.zeros((n, joints)), np.zeros(n, dtype=np.int64)

    def renew(self, ids: Array) -> None:
        """These envs have just been reset."""
        self.told[ids], self._last[ids], self._ticks[ids] = 0.0, 0.0, 0

    def prepare(self, ids: Array) -> None:
        """Nothing is kept of where the joints are."""

    def act(self, ids: Array, action: Array) -> None:
        """Write the action of these envs: what the policy says."""
        layout = self._policy.layout
        self._view.robot.see(self.env.engine.get_state())
        told = np.minimum(np.maximum(self.told[ids][:, self._told], self._low), self._high)
        phase = self._ticks[ids] * self._dt * self._frequency
        said = self._policy.act(layout.observe(ids, told, self._last[ids], phase))
        said = np.minimum(np.maximum(said, -self._clip), self._clip)
        self._last[ids], self._ticks[ids] = said, self._ticks[ids] + 1
        targets = np.empty_like(said)
        targets[:, layout.columns] = layout.home + self._scale * said
        action[ids, self._slice.start : self._slice.stop] = self._slice.controller.action_for(targets, ids)
