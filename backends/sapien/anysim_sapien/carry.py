"""Live editing rebuilds the scenes. These rows carry what a rebuild would round or lose."""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array


class Carried(NamedTuple):
    """Copies in the order of the old World: poses (N, B, 7), twists (N, B, 6), efforts (N, J), forces (N, S, 3)."""

    pose: Array
    twist: Array
    effort: Array
    contact: Array


def shared(old: Any, new: Any) -> tuple[Array, Array]:
    """Places (before, after) of things that have the same name in both lists."""
    places = {thing.name: i for i, thing in enumerate(old)}
    pairs = [(places[thing.name], i) for i, thing in enumerate(new) if thing.name in places]
    table = np.array(pairs, dtype=int).reshape(-1, 2)
    return table[:, 0], table[:, 1]
