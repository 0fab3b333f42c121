"""Gains and limits of the drives of all envs, and the terms of the drive law for commands."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import EFFORT, POSITION, Control
from anysim.math.compiled import compiled
from anysim.model.world import World


class DriveGains:
    """What may be changed per env.

    Attributes:
        joint: (A,) the joint of each drive.
        values: (3, N, A) of which kp, kd and limit are parts.
    """

    def __init__(self, world: World, num_envs: int) -> None:
        self.joint = np.array([a.joint for a in world.actuators], dtype=int)
        rows = np.array([(a.kp, a.kd, a.effort_limit) for a in world.actuators], dtype=float).reshape(-1, 3).T
        self.values = np.repeat(rows[:, None], num_envs, axis=1)
        self.kp, self.kd, self.limit = self.values
        self._speeds = np.full(len(self.joint), np.inf)
        if world.physics.velocity_limits:
            self._speeds = np.array([world.joints[j].velocity_limit for j in self.joint], dtype=float)

    def write(self, control: Control, law: Array, rows: Array) -> None:
        """Write the law's terms for these commands into (N, R, J), at the joints that have a drive.

        The law is clip(clip(pull - stiffness q, +-bound) + feed - damping qd, +-limit); `rows` (6,) say where its terms
        are: stiffness, damping, pull, feed, bound, limit.
        """
        _write(*control, self.joint, self.values, self._speeds, POSITION, EFFORT, rows, law)


@compiled
def _write(
    position: Array,
    velocity: Array,
    effort: Array,
    mode: Array,
    joint: Array,
    gains: Array,
    speeds: Array,
    with_position: int,
    with_effort: int,
    rows: Array,
    law: Array,
) -> None:
    for e in range(position.shape[0]):
        for a in range(position.shape[1]):
            stiffness = gains[0, e, a] if mode[e, a] == with_position else 0.0
            damping = gains[1, e, a] if mode[e, a] != with_effort else 0.0
            pull = stiffness * position[e, a] + damping * velocity[e, a]
            bound = damping * speeds[a] if damping > 0.0 else np.inf
            terms = stiffness, damping, pull, effort[e, a], bound, gains[2, e, a]
            for k in range(6):
                law[e, rows[k], joint[a]] = terms[k]
