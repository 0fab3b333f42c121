"""Judgement of a measure: the engine nearest to the answer, agreement, and distances."""

from anysim_parity.result import Measure


def errors(measure: Measure) -> dict[str, float]:
    """By engine the distance [the measure's unit] from the reference; empty where there is none."""
    if measure.reference is None:
        return {}
    return {engine: abs(value - measure.reference) for engine, value in measure.values.items()}


def nearest(measure: Measure) -> tuple[str, ...]:
    """The engines nearest to the analytic answer: one, or several that are as near; none without an answer."""
    off = errors(measure)
    if len(off) < 2:
        return ()
    best = min(off.values())
    # what is far below the tolerance is near enough: telling 1e-14 from 1e-8 would say nothing of physics
    room = max(1.05 * best, 0.0 if measure.tolerance is None else measure.tolerance / 10)
    return tuple(engine for engine, error in off.items() if error <= room)


def largest_gap(measure: Measure) -> float | None:
    """The largest difference: from the reference where there is one, else between two engines.

    None where there is nothing to compare: no value, or one engine and no reference.
    """
    values = list(measure.values.values())
    if measure.reference is not None:
        return max(errors(measure).values()) if values else None
    return max(values) - min(values) if len(values) > 1 else None


def agreement(measure: Measure) -> bool | None:
    """Whether the largest gap is within the tolerance; None where the number only informs, or nothing was compared."""
    gap = largest_gap(measure)
    return None if measure.tolerance is None or gap is None else gap <= measure.tolerance


def outside(measure: Measure) -> tuple[str, ...]:
    """The engines further than the tolerance from the reference, in order; empty where there is no such judgement."""
    if measure.tolerance is None:
        return ()
    return tuple(engine for engine, off in errors(measure).items() if off > measure.tolerance)
