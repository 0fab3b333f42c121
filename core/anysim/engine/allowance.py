"""What an engine declares of the numbers that it cannot take over exactly."""

from typing import NamedTuple


class Allowance(NamedTuple):
    """By how much a quantity of the audit may differ from the World's, relative to it, and why."""

    relative: float
    reason: str
