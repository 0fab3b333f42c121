"""The nominal value of a field that is drawn in each episode: what the World is compiled with."""

from math import sqrt
from typing import Any

from anysim_schemas.values import Choice, Drawn, LogUniform, Normal, Range


def nominal(value: Any) -> Any:
    """The middle of a range (of the logarithms for log-uniform), the first of a choice, the (clipped) mean of a normal.

    A constant is itself; where a `ratio` gates a value it is what the other episodes have, if that is given.
    Vectors are taken component by component; names (of colours) only occur as constants and choices.
    """
    if isinstance(value, Drawn) and value.otherwise is not None:
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


def extremes(value: Any) -> tuple[float, float]:
    """The smallest and the largest number that a scalar value can be; a normal's tails count up to its limits.

    Where a normal has no limit, its mean counts: draws beyond what is allowed are clipped by who uses them.
    """
    if isinstance(value, Choice):
        ends = [min(value.choice), max(value.choice)]
    elif isinstance(value, Range):
        ends = [*value.range]
    elif isinstance(value, LogUniform):
        ends = [*value.log_uniform]
    elif isinstance(value, Normal):
        p = value.normal
        ends = [p.mean if p.low is None else p.low, p.mean if p.high is None else p.high]
    else:
        ends = [value]
    if isinstance(value, Drawn) and value.otherwise is not None:
        ends.append(value.otherwise)
    return float(min(ends)), float(max(ends))


def _combine(function: Any, a: Any, b: Any) -> Any:
    if isinstance(a, tuple | list):
        return tuple(function(x, y) for x, y in zip(a, b, strict=True))
    return function(a, b)
