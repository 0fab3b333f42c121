"""The drives: u = kp (q* - q) + kd (qd* - qd) + ff, clipped, as MuJoCo's affine actuator.

The feedback -kp q - kd qd is the actuator's bias, so that the integrator takes its damping implicitly; the rest is its
control input. Which terms a mode has is decided here; the bias becomes a per-env array once an env first differs.

Where velocity limits are enforced, kp (q* - q) + kd qd* is clipped to kd times the limit, which depends on the state:
the control input is then made anew before each substep.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import MODES, Control, acting_gains
from anysim.engine.requirements import speed_bound
from anysim.model.world import World
from anysim_mujoco.layout import Layout


class Drives:
    """Gains and modes (N, A) of all envs, and the control input they give."""

    def __init__(self, batch: Any, world: World, layout: Layout) -> None:
        n, actuators = batch.nsim, world.actuators
        speeds = np.array([world.joints[a.joint].velocity_limit for a in actuators], dtype=float)
        self.limited = world.physics.velocity_limits and bool(np.isfinite(speeds).any())
        """Whether `limit` must be called before each substep."""
        self._speeds = speeds
        self._qpos = batch.bind("qpos")
        self._driven = np.zeros((batch.model.nq, len(actuators)))
        for i, actuator in enumerate(actuators):
            for joint, ratio in ((actuator.joint, 1.0), *actuator.shares):
                self._driven[layout.joint_q[joint], i] += ratio
        self._control: Control | None = None
        self._batch = batch
        self._input = batch.bind("ctrl")
        self._mode = np.tile(np.array([MODES.index(a.mode) for a in actuators], dtype=np.int8), (n, 1))
        self._modes = self._mode.tobytes()  # comparing bytes costs a tenth of comparing arrays
        self.kp = np.tile(np.array([a.kp for a in actuators], dtype=float), (n, 1))
        self.kd = np.tile(np.array([a.kd for a in actuators], dtype=float), (n, 1))
        self._stiffness, self._damping = acting_gains(self._mode, self.kp, self.kd)

    def apply(self, control: Control) -> None:
        """Write the control input of all envs."""
        modes = control.mode.tobytes()
        if modes != self._modes:
            self._mode[...], self._modes = control.mode, modes
            self.refresh()
        if self.limited:
            self._control = Control(*(array.copy() for array in control))
            return
        np.multiply(control.position, self._stiffness, out=self._input)
        self._input += control.effort
        if np.count_nonzero(control.velocity):
            self._input += control.velocity * self._damping

    def input_for(self, control: Control) -> Array:
        """A copy of the control input (N, A) of the next substep; these are the commands from now on."""
        self.apply(control)
        if self.limited:
            self.limit()
        return self._input.copy()

    def limit(self) -> None:
        """Write the control input of all envs for the next substep, the velocity that it asks for limited."""
        if self._control is None:
            return
        held = self._stiffness * (self._qpos @ self._driven)
        bound = speed_bound(self._damping, self._speeds)
        push = self._stiffness * self._control.position - held + self._damping * self._control.velocity
        self._input[...] = np.clip(push, -bound, bound) + held + self._control.effort

    def refresh(self) -> None:
        """Write the feedback of all envs, after a change of modes or gains."""
        self._stiffness, self._damping = acting_gains(self._mode, self.kp, self.kd)
        bias = self._batch.expand("actuator_biasprm")
        bias[:, :, 1] = -self._stiffness
        bias[:, :, 2] = -self._damping
