"""Banks for a hand with several fingers: they are for one whose fingers have the same joints and postures."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import listing
from anysim.skills.bank import Bank
from anysim_skills.grasping.hand import Hand

_NEAR = 1e-6  # [rad]


class OfHand(NamedTuple):
    """For the hand of a robot of this name in the catalogue."""

    robot: str
    hand: Hand

    def holds(self, bank: Bank) -> bool:
        made = bank.provenance.get("hand")
        if bank.gripper != self.robot or not isinstance(made, Mapping):
            return False
        mine, theirs = self.hand.postures(), made.get("synergies", {})
        pairs = [(self.hand.opened, made.get("opened", ())), *((mine.get(k), theirs.get(k)) for k in set(bank.kind))]
        return list(made.get("joints", ())) == list(self.hand.names) and all(_alike(one, two) for one, two in pairs)

    def otherwise(self, banks: Sequence[Bank]) -> tuple[str, str]:
        has = listing(sorted({bank.gripper for bank in banks}))
        return f"is for another hand ({has}) than that of '{self.robot}' as it is here", f" --gripper {self.robot}"


def _alike(one: Array | None, other: Sequence[float] | None) -> bool:
    return (
        one is not None and other is not None and len(one) == len(other) and bool(np.allclose(one, other, atol=_NEAR))
    )


def synergies(hand: Hand, banks: Sequence[Sequence[str]], count: int) -> Array:
    """(E, G) the hand's index of the posture of each candidate, of kinds of E entities; filled up with zeros."""
    found = np.zeros((len(banks), count), dtype=np.int64)
    for row, kinds in enumerate(banks):
        found[row, : len(kinds)] = [hand.named(kind) for kind in kinds]
    return found
