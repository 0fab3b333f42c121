"""Damping of free bodies, computed in each substep.

MuJoCo damps joint coordinates, and those of a free joint are the velocity of the body's frame and the rates about its
axes. That is the motion of the centre of mass only where it lies at the frame's origin.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array, xyzw_from_wxyz
from anysim.kinematics.dynamics import drag, gain
from anysim.math import pose as P
from anysim.model.world import World
from anysim_mujoco.layout import Layout


class Dampers:
    """The rates in force, and the wrenches that they make of an env's motion.

    Attributes:
        rates: (N, B, 2) linear and angular [1/s].
        active: whether anything is damped anywhere.
    """

    def __init__(self, batch: Any, world: World, layout: Layout) -> None:
        self._layout, self._dt = layout, world.physics.dt
        self._qpos, self._qvel, self._pushes = batch.bind("qpos"), batch.bind("qvel"), batch.bind("xfrc_applied")
        self.rates = np.tile(
            np.array([b.damping for b in world.bodies], dtype=float).reshape(-1, 2), (batch.nsim, 1, 1)
        )
        self.refresh()

    def refresh(self) -> None:
        """After a change of the rates."""
        self._bodies = np.flatnonzero((self.rates != 0).any(axis=(0, 2)))
        self.active = len(self._bodies) > 0
        self._gains = gain(self.rates[:, self._bodies], self._dt)

    def hold(self) -> Array:
        """The wrenches (N, K, 6) that somebody else has put on the damped bodies."""
        return self._pushes[:, self._layout.bodies[self._bodies]].copy()

    def put(self, wrenches: Array) -> None:
        """Put back what `hold` returned."""
        self._pushes[:, self._layout.bodies[self._bodies]] = wrenches

    def push(self, held: Array, mass: Array, com: Array, moments: Array, axes: Array) -> None:
        """Add drag to what was held. Inertials are (N, nbody, ...) as MuJoCo has them."""
        layout, at = self._layout, self._layout.bodies[self._bodies]
        rows = layout.free_row[self._bodies]
        q, v = layout.free_q[rows], layout.free_v[rows]
        turn = xyzw_from_wxyz(self._qpos[:, q[:, 3:]])
        # MuJoCo keeps the angular rate of a free body in its own axes
        own_rate = self._qvel[:, v[:, 3:]]
        velocity = self._qvel[:, v[:, :3]] + P.rotate(turn, P.cross(own_rate, com[:, at]))
        principal = P.multiply(turn, xyzw_from_wxyz(axes[:, at]))
        rate = P.rotate(turn, own_rate)
        self._pushes[:, at] = held + drag(self._gains, mass[:, at], moments[:, at], principal, velocity, rate)
