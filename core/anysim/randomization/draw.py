"""Draws of the values of a spec: one stream for each value, by its name.

A draw is a quantile in [0, 1) for each component, and the value's own map from quantiles to values. Fields that share a
name (`shared: heavy`) take their quantiles from that name's stream, so that all are high together, or low together.

Noise is drawn anew at each control step. It depends on the episode, the stream's name and the step alone, so a restored
env goes on with the same noise and nothing is kept; nor is it noted draw by draw, as the seed gives it again.
"""

from math import exp, expm1, sqrt
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.randomization.distributions import draw_one, extremes, nominal
from anysim.randomization.streams import OVERRIDDEN, Origin, Streams
from anysim_schemas.sensors import SensorNoiseSpec
from anysim_schemas.values import Choice, Distribution


def is_random(value: Any) -> bool:
    """Whether a value differs between episodes."""
    return isinstance(value, Distribution)


def draw(value: Any, name: str, streams: Streams, env: int, tick: int = 0, *, source: str = "") -> Any:
    """Draw a value of an env's episode from the stream `name`, and note it in `streams.draws`.

    `source` is the dotted path of the value in the spec, which tells where a draw comes from. A shared draw is one
    for the episode: it is the same at every tick. A value that is overridden for the episode is not drawn.
    """
    fixed = streams.overridden[env]
    if fixed and source in fixed:
        streams.note(env, name if tick == 0 else f"{name}@{tick}", fixed[source], Origin(OVERRIDDEN, source))
        return fixed[source]
    if not is_random(value):
        return value
    stream = name if value.shared is None else f"shared/{value.shared}"
    if value.ratio < 1.0 and streams.shared_generator(env, f"{name}/ratio", tick).random() >= value.ratio:
        stream, drawn = f"{name}/ratio", nominal(value)
    else:
        quantiles = streams.shared_generator(env, stream, tick if value.shared is None else 0).random
        narrowing = streams.narrowed.get(source)
        drawn = draw_one(value, quantiles if narrowing is None else narrowing.of(env, quantiles))
    streams.note(env, name if tick == 0 else f"{name}@{tick}", drawn, Origin(stream, source))
    return drawn


def draw_rows(value: Any, name: str, streams: Streams, env_ids: Array, tick: Any = 0, *, source: str = "") -> Array:
    """Draw a number or vector for each env: (E,) or (E, k) float64. `tick` is one step number, or one for each env."""
    if not is_random(value) and not any(source in streams.overridden[e] for e in env_ids):
        constant = np.asarray(value, dtype=float)
        return np.broadcast_to(constant, (len(env_ids), *constant.shape)).copy()
    ticks = np.broadcast_to(np.asarray(tick), len(env_ids))
    rows = [draw(value, name, streams, int(e), int(t), source=source) for e, t in zip(env_ids, ticks, strict=True)]
    return np.array(rows, dtype=float)


def noise_rows(value: Any, name: str, streams: Streams, env_ids: Array, ticks: Array, size: int) -> Array:
    """Independent draws (E, size) of a number for the step `ticks` (E,) of each env; constants are what they are."""
    if not is_random(value):
        return np.full((len(env_ids), size), float(value))
    rows = np.empty((len(env_ids), size))
    for row, (env, tick) in enumerate(zip(env_ids.tolist(), ticks.tolist(), strict=True)):
        if value.ratio < 1.0 and streams.shared_generator(env, f"{name}/ratio", tick).random() >= value.ratio:
            rows[row] = nominal(value)
            continue
        generator = streams.shared_generator(env, name, tick)
        if isinstance(value, Choice):
            rows[row] = [draw_one(value, generator.random) for _ in range(size)]
        else:
            rows[row] = draw_one(value, lambda shape, of=generator: of.random((size, *shape)))
    return rows


def note_noise(value: Any, name: str, streams: Streams, env_ids: Array, source: str) -> None:
    """Say in the draws of an episode that there is noise, and of what kind: it has no single value."""
    if is_random(value):
        text = f"at each step: {value.model_dump(mode='json', exclude_defaults=True)}"
        for env in env_ids.tolist():
            streams.note(env, name, text, Origin(name, source))


class FieldNoise:
    """The error of several numbers: a bias that walks, white noise, and what else is drawn at each reading.

    `bias` and `walk` (N, size) are its state; the walk is 0 at an episode's first reading.
    """

    def __init__(
        self, spec: SensorNoiseSpec, name: str, source: str, streams: Streams, size: int, period: float
    ) -> None:
        """`name` begins the names of its streams; `period` [s] is between two readings."""
        self._spec, self._name, self._source, self._streams = spec, name, source, streams
        self.bias, self.walk = np.zeros((streams.num_envs, size)), np.zeros((streams.num_envs, size))
        time = spec.walk_time
        self._keeps = 1.0 if time is None else exp(-period / time)
        variance = period if time is None else -0.5 * time * expm1(-2.0 * period / time)
        self._stride, self._white = spec.walk * sqrt(variance), spec.white / sqrt(period)

    def reset(self, env_ids: Array) -> None:
        """Draw the bias of new episodes."""
        name, source, bias = f"{self._name}/bias", f"{self._source}.bias", self._spec.bias
        self.walk[env_ids] = 0.0
        if bias is not None:
            once, size = np.zeros(len(env_ids), dtype=np.int64), self.bias.shape[1]
            self.bias[env_ids] = rows = noise_rows(bias, name, self._streams, env_ids, once, size)
            for env, row in zip(env_ids.tolist(), rows.tolist(), strict=True) if is_random(bias) else ():
                self._streams.note(env, name, tuple(row), Origin(name, source))
        note_noise(self._spec.noise, f"{self._name}/noise", self._streams, env_ids, f"{self._source}.noise")

    def added(self, rows: Array, env_ids: Array, ticks: Array) -> Array:
        """Rows (E, size) of the control steps (E,) with their error; the walk goes on by a reading."""
        if self._stride:
            step = self._stride * (ticks > 0)[:, None] * self._normal("walk", env_ids, ticks)
            self.walk[env_ids] = self._keeps * self.walk[env_ids] + step
            rows = rows + self.walk[env_ids]
        if self._spec.bias is not None:
            rows = rows + self.bias[env_ids]
        if self._white:
            rows = rows + self._white * self._normal("white", env_ids, ticks)
        if self._spec.noise is not None:
            name = f"{self._name}/noise"
            rows = rows + noise_rows(self._spec.noise, name, self._streams, env_ids, ticks, rows.shape[1])
        return rows

    def _normal(self, part: str, env_ids: Array, ticks: Array) -> Array:
        """Standard normal draws (E, size) of a stream of their own."""
        name, rows = f"{self._name}/{part}", np.empty((len(env_ids), self.bias.shape[1]))
        for row, (env, tick) in enumerate(zip(env_ids.tolist(), ticks.tolist(), strict=True)):
            rows[row] = self._streams.shared_generator(env, name, tick).standard_normal(rows.shape[1])
        return rows


class DelayLine:
    """Rows of the last steps of each env, to be read some whole steps late.

    The row of step t stands at t modulo the length, so writing the same step again changes nothing.
    """

    def __init__(self, num_envs: int, size: int, longest: int) -> None:
        self.delay = np.zeros(num_envs, dtype=np.int64)
        """(N,) whole steps."""
        self.rows = np.zeros((num_envs, longest + 1, size))

    def write(self, env_ids: Array, ticks: Array, rows: Array) -> None:
        """Keep the rows (E, size) of these steps."""
        self.rows[env_ids, ticks % self.rows.shape[1]] = rows

    def read(self, env_ids: Array, ticks: Array) -> Array:
        """The rows of `delay` steps before; the first one where there was nothing yet."""
        then = np.maximum(ticks - self.delay[env_ids], 0)
        return self.rows[env_ids, then % self.rows.shape[1]]

    def arrived(self, env_ids: Array, ticks: Array) -> Array:
        """(E,) bool: there is a row of `delay` steps before."""
        return ticks >= self.delay[env_ids]

    def reset(self, env_ids: Array, delay: Array) -> None:
        """Empty, with these delays (E,)."""
        self.delay[env_ids], self.rows[env_ids] = delay, 0.0


def longest_delay(value: Any) -> int:
    """The most steps that a value can ask for."""
    return int(extremes(value)[1])
