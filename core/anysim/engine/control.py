"""Commands of all envs: targets persist until they are written again, wrenches last for one call."""

from collections.abc import Mapping
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine.arguments import rows as checked_rows
from anysim.errors import EngineError
from anysim.math.arrays import numbers
from anysim.model.world import ControlMode, World

MODES = tuple(ControlMode)
POSITION, VELOCITY, EFFORT = map(MODES.index, ControlMode)
"""Numbers of the modes."""


def acting_gains(mode: Array, kp: Array, kd: Array) -> tuple[Array, Array]:
    """The gains (N, A) that act in these modes: both in position control, kd in velocity control, none for efforts."""
    return kp * (mode == POSITION), kd * (mode != EFFORT)


class Control(NamedTuple):
    """Drive targets of all envs (N, A): position, velocity, feed-forward effort, and the mode, an index into MODES."""

    position: Array
    velocity: Array
    effort: Array
    mode: Array


NUDGE = 1e-3
"""[rad, m] between the two position targets of a benchmark's loops."""


def alternating(control: Control) -> tuple[Control, Control]:
    """The commands that a benchmark writes in turn: these, and the same with all positions moved by `NUDGE`.

    Both loops write them, anysim's and the engine's own (`raw_loop`): what passes over commands that did not change
    would gain nothing in use.
    """
    return control, control._replace(position=control.position + NUDGE)


class CommandBuffer:
    """The commands of all envs. `control_changed` says that the engine has not seen the latest ones."""

    def __init__(self, world: World, num_envs: int) -> None:
        joints = world.joints
        self._initial = np.array([joints[a.joint].initial for a in world.actuators], dtype=np.float64)
        self._mode = np.array([MODES.index(a.mode) for a in world.actuators], dtype=np.int8)
        n, a = num_envs, len(world.actuators)
        self._bodies = len(world.bodies)
        self.control = Control(np.zeros((n, a)), np.zeros((n, a)), np.zeros((n, a)), np.zeros((n, a), dtype=np.int8))
        self.wrench: Array | None = None
        self.once: Array | None = None
        """What acts beside `wrench` in the next step call alone."""
        self.reset(np.arange(n))

    def reset(self, ids: Array) -> None:
        """Hold the initial joint positions, in the World's modes."""
        self.control.position[ids] = self._initial
        self.control.velocity[ids] = 0.0
        self.control.effort[ids] = 0.0
        self.control.mode[ids] = self._mode
        self.spend_wrench(ids)
        self.control_changed = True

    def write(
        self,
        position: ArrayLike | None,
        velocity: ArrayLike | None,
        effort: ArrayLike | None,
        ids: Array | None,
        which: Array | None,
    ) -> None:
        """Write targets; None leaves a kind of target as it is."""
        for name, buffer, values in (
            ("position", self.control.position, position),
            ("velocity", self.control.velocity, velocity),
            ("effort", self.control.effort, effort),
        ):
            if values is None:
                continue
            if ids is None and which is None:
                values = numbers(name, values, EngineError)
                # a finite sum of squares has finite terms, and is found three times as fast; else each term is checked
                if values.shape != buffer.shape or not isfinite(np.vdot(values, values)):
                    values = checked_rows(name, values, buffer.shape)
                buffer[...] = values
            else:
                at = np.ix_(
                    np.arange(len(buffer)) if ids is None else ids,
                    np.arange(buffer.shape[1]) if which is None else which,
                )
                buffer[at] = checked_rows(name, values, (len(at[0]), at[1].shape[1]))
        self.control_changed = True

    def set_mode(self, mode: ControlMode, ids: Array, which: Array) -> None:
        """Switch drives; targets stay."""
        self.control.mode[np.ix_(ids, which)] = MODES.index(mode)
        self.control_changed = True

    def add_wrench(self, wrench: Array, ids: Array, bodies: Array, *, once: bool = False) -> None:
        """Add to the wrenches of the next step call."""
        held = self.once if once else self.wrench
        if held is None:
            held = np.zeros((len(self.control.position), self._bodies, 6))
        held[ids[:, None], bodies] += wrench
        self.wrench, self.once = (self.wrench, held) if once else (held, self.once)

    @property
    def acting(self) -> Array | None:
        """The wrenches of the next step call; None where there are none."""
        return self.wrench if self.once is None else self.once if self.wrench is None else self.wrench + self.once

    def spend_wrench(self, ids: Array | None) -> Array | None:
        """Forget the wrenches of envs (None: of all); returns what still waits for the others."""
        self.once = None
        if self.wrench is not None:
            if ids is not None:
                self.wrench[ids] = 0.0
            if ids is None or not self.wrench.any():
                self.wrench = None
        return self.wrench

    def rows(self, ids: Array) -> dict[str, Array]:
        """Copies of the commands of envs, for a snapshot, with the wrenches that wait for their step."""
        rows = {name: getattr(self.control, name)[ids] for name in Control._fields}
        return rows if self.wrench is None else rows | {"wrench": self.wrench[ids]}

    def restore(self, ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `rows` returned."""
        for name in Control._fields:
            getattr(self.control, name)[ids] = data[name]
        self.spend_wrench(ids)
        if "wrench" in data:
            self.add_wrench(data["wrench"], ids, np.arange(self._bodies))
        self.control_changed = True
