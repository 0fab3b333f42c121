"""Layer `asset`: what each engine says it has built, against the World."""

from collections.abc import Mapping, Sequence

import numpy as np

from anysim.compile.edit import unseen
from anysim.model.world import World
from anysim.testing.audit import ABSOLUTE, FRAME_TOLERANCE, RELATIVE, AuditLine, audit
from anysim_parity.engines import Engines, in_world, on_each
from anysim_parity.result import Layer, Measure

FRAME = "frame"
"""Frames are compared by the layer `kinematics`, more closely."""

_QUESTION = "Did each engine build the masses, limits, shapes and joints that the world says?"
_OF_ORDER_ONE = {"axis": FRAME_TOLERANCE, "moves": 0.5}
"""Compared absolutely: components of unit vectors, and indices of bodies."""


def asset_layer(world: World, engines: Engines) -> Layer:
    """Audit every engine: for each quantity the largest relative difference from the World."""
    world = unseen(world)
    audits = on_each(engines, in_world(world, audit))
    lines = {name: [line for line in found if line.quantity != FRAME] for name, found in audits.found.items()}
    quantities = list(dict.fromkeys(line.quantity for found in lines.values() for line in found))
    counted = {name: float(sum(line.ok is not None for line in found)) for name, found in lines.items()}
    measures = [Measure("numbers read back", "", counted), *(_measure(quantity, lines) for quantity in quantities)]
    return Layer("asset", _QUESTION, tuple(measures), refused=audits.refused)


def _measure(quantity: str, lines: Mapping[str, Sequence[AuditLine]]) -> Measure:
    tolerance = _OF_ORDER_ONE.get(quantity, RELATIVE)
    values: dict[str, float] = {}
    reasons: list[str] = []
    for name, found in lines.items():
        own = [line for line in found if line.quantity == quantity]
        reported = [line for line in own if line.ok is not None]
        if not reported:
            reasons.append(f"{name} does not report it")
            continue
        values[name] = max(_error(line) for line in reported)
        if values[name] > tolerance:
            worst = max(reported, key=_error)
            who = f"{name} declares of {quantity}" if worst.ok else name  # the audit knows what an engine may be off by
            note = f", {worst.note}" if worst.note else ""
            reasons.append(f"{who}: {worst.subject} has {_text(worst.found)} for {_text(worst.expected)}{note}")
    unit = "" if quantity in _OF_ORDER_ONE else "relative"
    return Measure(quantity, unit, values, 0.0, tolerance, "; ".join(reasons))


def _error(line: AuditLine) -> float:
    """What exceeds the audit's absolute tolerance, relative to the value; of what is of order one the difference."""
    if len(line.found) != len(line.expected):
        return float("inf")
    found, expected = np.array(line.found), np.array(line.expected)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(found - expected)
        if line.quantity not in _OF_ORDER_ONE:
            beyond = np.maximum(error - ABSOLUTE, 0.0)
            error = np.where(beyond == 0.0, 0.0, beyond / np.abs(expected))
    error = np.where(np.isnan(error), np.inf, error)  # infinite on one side, or not a number
    return float(np.where(found == expected, 0.0, error).max(initial=0.0))


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{v:.6g}" for v in values)
