"""The distributions of a spec: nominal value, one draw, quantiles, and the values that are written in them.

A value is a constant, or a range, a choice, a normal or log-uniform distribution. Vectors are taken component by
component; names (of colours, materials, files) occur only as constants and in choices.
"""

from collections.abc import Callable, Sequence
from math import sqrt
from statistics import NormalDist
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim_schemas.values import Choice, Distribution, LogUniform, Normal, Range

_STANDARD = NormalDist()
_LOWEST = 2.0**-54
"""Half a step of the generator: a normal draw's quantile must not be 0."""

Quantiles = Callable[[Any], Array]
"""Quantiles in [0, 1) of a shape."""


def nominal(value: Any) -> Any:
    """The middle of a range (of the logarithms for log-uniform), the first of a choice, the (clipped) mean of a normal.

    A constant is itself; where a `ratio` gates a value it is what the other episodes have, if that is given.
    """
    if isinstance(value, Distribution) and value.otherwise is not None:
        return value.otherwise
    if isinstance(value, Choice):
        return value.choice[0]
    if isinstance(value, Range):
        if isinstance(value.range[0], int):
            return sum(value.range) // 2
        return _combine(lambda low, high: 0.5 * (low + high), *value.range)
    if isinstance(value, LogUniform):
        return _combine(lambda low, high: sqrt(low * high), *value.log_uniform)
    if isinstance(value, Normal):
        mean = value.normal.mean
        if value.normal.low is not None:
            mean = _combine(max, mean, value.normal.low)
        if value.normal.high is not None:
            mean = _combine(min, mean, value.normal.high)
        return mean
    return value


def draw_one(value: Any, quantiles: Quantiles) -> Any:
    """One draw of a value: a float, a tuple of floats or, for choices, one of its items."""
    if isinstance(value, Choice):
        return value.choice[weighted(value.weights or (1.0,) * len(value.choice), float(quantiles(())))]
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


def quantile(value: Any, share: float) -> Any:
    """What a share in [0, 1) of the draws of a value stays below, in each component."""
    return draw_one(value, lambda shape: np.full(shape, share))


def weighted(weights: Sequence[float], share: float) -> int:
    """The index that a share in [0, 1) chooses, each as often as its weight says."""
    edges = np.cumsum(weights) / np.sum(weights)
    return min(int(np.searchsorted(edges, share, side="right")), len(weights) - 1)


def written(value: Any) -> tuple[Any, ...]:
    """The values that stand in a distribution, all of which a draw can be: bounds, items, what other episodes have.

    None of a normal's: it is clipped by what uses it. A constant is the only one.
    """
    if isinstance(value, Choice):
        found = tuple(value.choice)
    elif isinstance(value, Range):
        found = tuple(value.range)
    elif isinstance(value, LogUniform):
        found = tuple(value.log_uniform)
    else:
        found = () if isinstance(value, Normal) else (value,)
    return found if not isinstance(value, Distribution) or value.otherwise is None else (*found, value.otherwise)


def extremes(value: Any) -> tuple[float, float]:
    """The smallest and the largest number that a scalar value can be; a normal's tails count up to its limits.

    Where a normal has no limit, its mean counts: draws beyond what is allowed are clipped by what uses them.
    """
    ends = written(value)
    if isinstance(value, Normal):
        p = value.normal
        ends = (*ends, p.mean if p.low is None else p.low, p.mean if p.high is None else p.high)
    return float(min(ends)), float(max(ends))


def _plain(drawn: Array) -> float | tuple[float, ...]:
    return float(drawn) if drawn.ndim == 0 else tuple(float(x) for x in drawn)


def _combine(function: Any, a: Any, b: Any) -> Any:
    if isinstance(a, tuple | list):
        return tuple(function(x, y) for x, y in zip(a, b, strict=True))
    return function(a, b)
