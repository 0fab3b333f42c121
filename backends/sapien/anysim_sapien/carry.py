"""Live editing rebuilds the scenes. These rows carry what a rebuild would round or lose."""

from typing import NamedTuple

from anysim.conventions import Array


class Carried(NamedTuple):
    """Copies in the order of the old World: poses (N, B, 7), twists (N, B, 6), efforts (N, J), forces (N, S, 3)."""

    pose: Array
    twist: Array
    effort: Array
    contact: Array
