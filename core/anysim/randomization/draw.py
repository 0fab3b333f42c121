"""Draws of the values of a spec: one stream for each value, by its name.

A draw is a quantile in [0, 1) for each component, and the value's own map from quantiles to values. Fields that share a
name (`shared: heavy`) take their quantiles from that name's stream, so that all are high together, or low together.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.randomization.distributions import draw_one, nominal
from anysim.randomization.streams import OVERRIDDEN, Origin, Streams
from anysim_schemas.values import Drawn


def is_random(value: Any) -> bool:
    """Whether a value differs between episodes."""
    return isinstance(value, Drawn)


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
