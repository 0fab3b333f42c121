"""Summaries of several replays, field by field."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from anysim.record.replay import Drift


class FieldSummary(NamedTuple):
    """One state array over several replays: the largest difference of each, and which replay has the largest of all.

    `identical` counts the replays without any; `first_step` is the earliest control step that differs in a bit.
    """

    name: str
    identical: int
    first_step: int | None
    median: float
    worst: float
    worst_replay: str


def summarise(drifts: Mapping[str, Drift]) -> list[FieldSummary]:
    """Field by field over replays by name."""
    names = dict.fromkeys(name for drift in drifts.values() for name in drift.fields)
    rows: list[FieldSummary] = []
    for name in names:
        fields = {replay: drift.fields[name] for replay, drift in drifts.items() if name in drift.fields}
        worst = max(fields, key=lambda replay: fields[replay].max_abs)
        steps = [field.first_step for field in fields.values() if field.first_step is not None]
        rows.append(
            FieldSummary(
                name,
                sum(field.identical for field in fields.values()),
                min(steps, default=None),
                float(np.median([field.max_abs for field in fields.values()])),
                fields[worst].max_abs,
                worst,
            )
        )
    return rows
