"""Gains and limits of the drives of all envs, and the terms of the drive law for commands."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import Control, acting_gains
from anysim.engine.requirements import speed_bound
from anysim.model.world import World


class LawTerms(NamedTuple):
    """What the law clip(clip(pull - stiffness q, +-bound) + feed - damping qd, +-limit) of each drive has in it (N, A).

    Attributes:
        stiffness, damping: in the drive's mode.
        pull: stiffness q* + damping qd*.
        bound: what the velocity limit makes of pull - stiffness q; infinite without one.
    """

    stiffness: Array
    damping: Array
    pull: Array
    bound: Array


class DriveGains:
    """What may be changed per env: kp, kd and effort limits (N, A).

    Attributes:
        joint: (A,) the joint of each drive.
    """

    def __init__(self, world: World, num_envs: int) -> None:
        self.joint = np.array([a.joint for a in world.actuators], dtype=int)
        self.kp, self.kd, self.limit = (
            np.tile(np.array([getattr(a, name) for a in world.actuators], dtype=float), (num_envs, 1))
            for name in ("kp", "kd", "effort_limit")
        )
        self._speeds = np.full(len(self.joint), np.inf)
        if world.physics.velocity_limits:
            self._speeds = np.array([world.joints[j].velocity_limit for j in self.joint])

    def terms(self, control: Control) -> LawTerms:
        """The law's terms for these commands."""
        stiffness, damping = acting_gains(control.mode, self.kp, self.kd)
        pull = stiffness * control.position + damping * control.velocity
        return LawTerms(stiffness, damping, pull, speed_bound(damping, self._speeds))
