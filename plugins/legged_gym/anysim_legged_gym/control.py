"""Actions to commands of drives: clipping, delay, and targets of the three kinds of control."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import TaskError
from anysim_legged_gym.layout import Layout
from anysim_legged_gym.spec import ControlSpec


class Drives:
    """What turns actions (N, D) into targets; the engine computes the torque law in each physics step.

    Attributes:
        actions: (N, D) as they act now: clipped, and late.
        delay: (N,) by how many actions they are late.
    """

    def __init__(self, engine: SimEngine, layout: Layout, spec: ControlSpec, default: Array, latest: int) -> None:
        self._engine, self._layout, self._spec, self._default = engine, layout, spec, default
        n, d = engine.num_envs, len(layout.dof_names)
        self.actions = np.zeros((n, d))
        self.delay = np.zeros(n, dtype=int)
        self._queue = np.zeros((n, latest + 1, d))
        self._rows = np.arange(n)

    def command(self, actions: object) -> None:
        """Take actions (N, D) and give the engine the targets of those that are due.

        Raises:
            TaskError: they have another shape, or are not finite.
        """
        given = np.asarray(actions, dtype=float)
        if given.shape != self.actions.shape or not np.isfinite(given).all():
            wanted, found = self.actions.shape, given.shape
            raise TaskError(f"actions are finite numbers of the shape {wanted} (envs, joints), got {found}")
        given = np.clip(given, -self._spec.clip_actions, self._spec.clip_actions)
        if self._queue.shape[1] > 1:
            self._queue[:, 1:] = self._queue[:, :-1].copy()
            self._queue[:, 0] = given
            given = self._queue[self._rows, self.delay]
        self.actions = given
        self._send(given * self._spec.action_scale)

    def _send(self, scaled: Array) -> None:
        order = self._layout.by_drive
        match self._spec.control_type:
            case "P":
                self._engine.set_control(position=(scaled + self._default)[:, order])
            case "V":
                self._engine.set_control(velocity=scaled[:, order])
            case "T":
                self._engine.set_control(effort=scaled[:, order])

    def reset(self, ids: Array) -> None:
        """Forget the actions of envs; until their first one they hold the default position."""
        self._queue[ids], self.actions[ids] = 0.0, 0.0
