"""ServoL: a tool that follows a live target along a line, with a bounded lead, and stops at a force."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_skills.arm import ARRIVED, TURNED, Arm

SLOWEST = 0.1
"""Of the speed, at which the last of the way is gone."""

EASING = 0.9
"""Of its lead, that a command keeps at least in a control step in which it is drawn back."""


class ServoLimits(NamedTuple):
    """What a tool that follows may do.

    Attributes:
        speed: [m/s] at most.
        gain: [1/s] speed for each metre that is left.
        lead: [m] the commanded tool is never further from the real one: stiffness times lead bounds the force.
        turn_lead: [rad] the same of its rotation.
        force: [N] at which it stops; infinite: it goes on.
    """

    speed: float = 0.15
    gain: float = 4.0
    lead: float = 0.02
    turn_lead: float = 0.2
    force: float = np.inf


class ServoStep(NamedTuple):
    """How it stands in a control step: (n,) bool each."""

    gated: Array
    """The force has been reached, now or before: the command goes no further, and back where it is too much."""
    arrived: Array


class ServoL:
    """Follows targets with the tool of one arm, in all envs.

    Attributes:
        gated: (N,) bool, whether the force has been reached since `begin`.
    """

    def __init__(self, arm: Arm, limits: ServoLimits) -> None:
        self.arm, self.limits = arm, limits
        self.gated = np.zeros(arm.env.num_envs, dtype=bool)

    def begin(self, ids: Array) -> None:
        """Open the gate in these envs."""
        self.gated[ids] = False

    def step(self, ids: Array, at: Array, target: Array, force: Array | None = None) -> ServoStep:
        """Go on towards tool poses (n, 7) in the world; `at` are the rows of these envs in the scene.

        Args:
            ids, at, target: where to.
            force: (n,) [N] as measured now, for the gate.
        """
        arm, limits = self.arm, self.limits
        tool = arm.tool.pose[at]
        # what is pushed back leaves its command behind, which is taken along
        arm.command[ids] = P.step_toward(tool, arm.command[ids], 0.999 * limits.lead, limits.turn_lead)
        within = P.step_toward(tool, target, 0.999 * limits.lead, limits.turn_lead)
        arm.go(ids, within, limits.speed, limits.lead)
        left = P.norm(target[:, :3] - tool[:, :3])
        arm.speed[ids] = limits.speed * np.clip(limits.gain * left / limits.speed, SLOWEST, 1.0)
        if force is not None:
            self.gated[ids] |= force >= limits.force
            self._ease(ids, tool, force)
        turned = P.angle_between(tool[:, 3:], target[:, 3:]) < TURNED
        return ServoStep(self.gated[ids], (left < ARRIVED) & turned)

    def _ease(self, ids: Array, tool: Array, force: Array) -> None:
        """Go no further where the gate has closed; draw the command back to the tool until the force is as stated."""
        gated = self.gated[ids]
        held, tool = ids[gated], tool[gated]
        share = np.clip(self.limits.force / np.maximum(force[gated], 1e-9), EASING, 1.0)[:, None]
        self.arm.command[held, :3] = tool[:, :3] + share * (self.arm.command[held, :3] - tool[:, :3])
        self.arm.target[held] = self.arm.command[held]
