"""Shake of a camera that a hand holds: sums of sines whose phases and pitches are drawn in each episode."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim_cameras.easing import minimum_jerk

_PITCHES = np.array([0.37, 0.61, 1.0, 1.63, 2.41])
"""Of the sines, over the middle one's: without a common period."""
_SHARES = 1.0 / _PITCHES / np.sqrt((0.5 / _PITCHES**2).sum())
"""Amplitudes of a sum with a root mean square of 1: slow sway is wide, quick tremor narrow."""
_BEGINS = 1.0
"""[s] in which it comes up, so that nothing jumps."""


class ShakeStep(NamedTuple):
    """What is added to positions [m, rad] and to velocities [m/s, rad/s] of joints (E, k)."""

    position: Array
    velocity: Array


class Shake:
    """The shake of the joints of a channel in all envs; each joint has its own."""

    def __init__(self, channel: ChannelView, num_envs: int, amount: float, pitch: float) -> None:
        """`amount` [m, rad] is the root mean square, `pitch` [Hz] that of the middle sine; an amount of 0 is none."""
        self._channel, self._amount, self._pitch = channel, amount, pitch
        shape = (num_envs, len(channel), len(_PITCHES)) if amount else (num_envs, 0, 0)
        self._phases, self._rates = np.zeros(shape), np.zeros(shape)
        self._ticks = np.zeros(num_envs)

    def reset(self, env_ids: Array) -> None:
        """Draw the shake of new episodes."""
        self._ticks[env_ids] = 0.0
        streams, channel = self._channel.robot.streams, self._channel
        if not self._amount:
            return
        if streams is None:
            raise TaskError(
                f"the shake of '{channel.robot.name}.{channel.name}' is drawn anew in each episode of an env"
            )
        for env in env_ids.tolist():
            drawn = streams.generator(env, f"robot/{channel.robot.name}/{channel.name}/shake")
            self._phases[env] = drawn.uniform(0.0, 2 * np.pi, self._phases.shape[1:])
            slower = drawn.uniform(0.85, 1.15, self._rates.shape[1:])
            self._rates[env] = 2 * np.pi * self._pitch * _PITCHES * slower

    def step(self, rows: slice | Array) -> ShakeStep:
        """The next tick's."""
        if not self._amount:
            none = np.zeros((len(self._ticks[rows]), len(self._channel)))
            return ShakeStep(none, none)
        self._ticks[rows] += 1.0
        seconds = self._ticks[rows] * self._channel.robot.dt
        up, rising = minimum_jerk(np.minimum(seconds / _BEGINS, 1.0))
        angle = self._phases[rows] + self._rates[rows] * seconds[:, None, None]
        wide = self._amount * _SHARES
        place, speed = (wide * np.sin(angle)).sum(axis=2), (wide * self._rates[rows] * np.cos(angle)).sum(axis=2)
        up, rising = up[:, None], rising[:, None] / _BEGINS
        return ShakeStep(up * place, up * speed + rising * place)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of its state."""
        kept = {"phases": self._phases, "rates": self._rates, "ticks": self._ticks}
        return {f"shake.{name}": rows[env_ids] for name, rows in kept.items()}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        for name, rows in (("phases", self._phases), ("rates", self._rates), ("ticks", self._ticks)):
            rows[env_ids] = data[f"shake.{name}"]
