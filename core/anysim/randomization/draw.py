"""Drawing the values of a spec: one stream for each value, by its name.

A draw is a quantile in [0, 1) for each component, and the value's own map from quantiles to values. Fields that share a
name (`shared: heavy`) take their quantiles from that name's stream, so that all are high together, or low together.
"""

from collections.abc import Callable
from statistics import NormalDist
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.randomization.distributions import nominal
from anysim.randomization.streams import OVERRIDDEN, Origin, Streams
from anysim_schemas.values import Choice, Drawn, LogUniform, Normal, Range

_STANDARD = NormalDist()
_LOWEST = 2.0**-54
"""Half a step of the generator: a normal draw's quantile must not be 0."""

Quantiles = Callable[[Any], Array]
"""Quantiles in [0, 1) of a shape."""


def is_random(value: Any) -> bool:
    """Whether a value differs between episodes."""
    return isinstance(value, Drawn)


def draw_one(value: Any, quantiles: Quantiles) -> Any:
    """One draw of a value: a float, a tuple of floats or, for choices, whatever is chosen."""
    if isinstance(value, Choice):
        weights = value.weights or (1.0,) * len(value.choice)
        edges = np.cumsum(weights) / np.sum(weights)
        index = int(np.searchsorted(edges, float(quantiles(())), side="right"))
        return value.choice[min(index, len(value.choice) - 1)]
    if isinstance(value, Range):
        if isinstance(value.range[0], int):  # a whole number, both bounds included
            first, last = value.range
            return min(first + int(float(quantiles(())) * (last + 1 - first)), last)
        low, high = (np.asarray(bound, dtype=float) for bound in value.range)
        return _plain(low + (high - low) * quantiles(low.shape))
    if isinstance(value, LogUniform):
        low, high = (np.log(np.asarray(bound, dtype=float)) for bound in value.log_uniform)
        return _plain(np.clip(np.exp(low + (high - low) * quantiles(low.shape)), *value.log_uniform))
    if isinstance(value, Normal):
        p = value.normal
        mean = np.asarray(p.mean, dtype=float)
        standard = np.vectorize(_STANDARD.inv_cdf, otypes=[float])(np.maximum(quantiles(mean.shape), _LOWEST))
        drawn = mean + np.asarray(p.std, dtype=float) * standard
        return _plain(np.clip(drawn, -np.inf if p.low is None else p.low, np.inf if p.high is None else p.high))
    return value


def _plain(drawn: Array) -> float | tuple[float, ...]:
    return float(drawn) if drawn.ndim == 0 else tuple(float(x) for x in drawn)


def draw(value: Any, name: str, streams: Streams, env: int, tick: int = 0, *, source: str = "") -> Any:
    """Draw a value of an env's episode from the stream `name`, and note it in `streams.draws`.

    `source` is the dotted path of the value in the spec, for whoever asks where a draw comes from. A shared draw is one
    for the episode: it is the same at every tick. A value that is overridden for the episode is not drawn.
    """
    fixed = streams.overridden[env]
    if fixed and source in fixed:
        streams.note(env, name if tick == 0 else f"{name}@{tick}", fixed[source], Origin(OVERRIDDEN, source))
        return fixed[source]
    if not is_random(value):
        return value
    stream = name if value.shared is None else f"shared/{value.shared}"
    if value.ratio < 1.0 and streams.quantiles(env, f"{name}/ratio", tick)() >= value.ratio:
        stream, drawn = f"{name}/ratio", nominal(value)
    else:
        drawn = draw_one(value, streams.quantiles(env, stream, tick if value.shared is None else 0))
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
