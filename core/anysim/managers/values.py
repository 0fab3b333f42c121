"""Drawing the values of a spec: constants, ranges, choices, normals; one stream for each value, by its name."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.managers.streams import Streams
from anysim_schemas.values import Choice, Normal, Range


def is_random(value: Any) -> bool:
    """Whether a value differs between episodes."""
    return isinstance(value, Range | Choice | Normal)


def draw_one(value: Any, generator: np.random.Generator) -> Any:
    """One draw of a value: a float, a tuple of floats or, for choices, whatever is chosen."""
    if isinstance(value, Range):
        low, high = np.asarray(value.range[0], dtype=float), np.asarray(value.range[1], dtype=float)
        drawn = low + (high - low) * generator.random(low.shape)
        return float(drawn) if drawn.ndim == 0 else tuple(float(x) for x in drawn)
    if isinstance(value, Choice):
        weights = value.weights or (1.0,) * len(value.choice)
        edges = np.cumsum(weights) / np.sum(weights)
        index = int(np.searchsorted(edges, generator.random(), side="right"))
        return value.choice[min(index, len(value.choice) - 1)]
    if isinstance(value, Normal):
        p = value.normal
        mean = np.asarray(p.mean, dtype=float)
        drawn = mean + np.asarray(p.std, dtype=float) * generator.standard_normal(mean.shape)
        drawn = np.clip(drawn, -np.inf if p.low is None else p.low, np.inf if p.high is None else p.high)
        return float(drawn) if drawn.ndim == 0 else tuple(float(x) for x in drawn)
    return value


def draw(value: Any, name: str, streams: Streams, env: int, tick: int = 0) -> Any:
    """Draw a value of an env's episode from the stream `name`, and note it in `streams.draws`."""
    if not is_random(value):
        return value
    drawn = draw_one(value, streams.generator(env, name, tick))
    streams.draws[env][name if tick == 0 else f"{name}@{tick}"] = drawn
    return drawn


def draw_rows(value: Any, name: str, streams: Streams, env_ids: Array, tick: Any = 0) -> Array:
    """Draw a number or vector for each env: (E,) or (E, k) float64. `tick` is one step number, or one for each env."""
    if not is_random(value):
        constant = np.asarray(value, dtype=float)
        return np.broadcast_to(constant, (len(env_ids), *constant.shape)).copy()
    ticks = np.broadcast_to(np.asarray(tick), len(env_ids))
    rows = [draw(value, name, streams, int(e), int(t)) for e, t in zip(env_ids, ticks, strict=True)]
    return np.array(rows, dtype=float)
