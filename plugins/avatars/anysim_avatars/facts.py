"""Facts about an avatar, for language, questions and tasks."""

from collections.abc import Mapping, Sequence

import numpy as np

from anysim.conventions import Array
from anysim_avatars.actions import Column, Kind


def facts_of(
    row: Array, clip: str, now: Mapping[str, Array], height: float, bodies: Sequence[str]
) -> dict[str, object]:
    """Plain data: what it does by the row of its queue, where it is, what it looks at and is after."""
    kind = Kind(int(np.clip(row[Column.KIND], 0, len(Kind) - 1)))
    facts: dict[str, object] = {
        "kind": "person",
        "doing": {Kind.GO: "walk", Kind.TURN: "turn"}.get(kind, clip),
        "height": round(height, 3),
        "at": [round(float(x), 3) for x in now["pos"]],
        "speed": round(float(np.hypot(*now["vel"])), 3),
    }

    def thing(body: int, place: slice) -> object:
        index = int(np.clip(row[body], -1, len(bodies) - 1))
        return bodies[index] if index >= 0 else row[place].tolist()

    if row[Column.GAZING]:
        facts["looks_at"] = thing(Column.GAZE_BODY, slice(Column.GAZE, Column.GAZE + 3))
    if row[Column.REACHING]:
        facts["reaches_for"] = thing(Column.REACH_BODY, slice(Column.REACH, Column.REACH + 3))
    if kind is Kind.GO:
        facts["goes_to"] = thing(Column.BODY, slice(Column.X, Column.Y + 1))
    return facts
