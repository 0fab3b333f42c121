"""Living banks: how often each candidate of a bank has led to success, on one engine, kept in a file between runs.

The belief in a candidate is the mean of Beta(1 + successes, 1 + failures), and never less than a floor, so that one
that failed by bad luck is tried again. For exact reproduction the counts are left out, or pinned to their version.
"""

import fcntl
import hashlib
import json
from pathlib import Path

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.skills.bank import Bank

FLOOR = 0.05
"""The least belief."""
_FORMAT = "anysim-bank-counts-1"


class LivingBank:
    """Counts of one bank on one engine. Those of a run are kept apart until `save` adds them to the file's.

    A bank is of one asset, affordance and gripper; so is its file, which lies beside others in `folder`.
    """

    def __init__(self, bank: Bank, engine: str, folder: Path, *, pinned: str = "") -> None:
        """`pinned` is the version that the counts must have: the run then believes what another one did.

        Raises:
            AssetError: the file is damaged, or its counts are not those that are pinned.
        """
        self.path = folder / f"{bank.version}.{engine}.json"
        self._bank, self._engine = bank.version, engine
        self._size, self._fixed = len(bank), bool(pinned)
        self._known = self._read()
        self._new = np.zeros_like(self._known)
        if pinned and pinned != self.version:
            raise AssetError(
                f"the counts in {self.path} are of version {self.version}, pinned is {pinned}: outcomes were added "
                "since; restore the file, or drop the pin"
            )

    @property
    def version(self) -> str:
        """A digest of the counts that beliefs come from: with the bank's own it says what order candidates have."""
        text = json.dumps([self._bank, self._engine, self._known.tolist()])
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def belief(self) -> Array:
        """(G,) in [FLOOR, 1). It stays the same during a run: what envs do does not depend on one another."""
        won, lost = self._known.T
        return np.maximum((1.0 + won) / (2.0 + won + lost), FLOOR)

    def note(self, candidate: int, success: bool) -> None:
        """An outcome of a candidate, by its number in the bank."""
        self._new[candidate, 0 if success else 1] += 1

    def save(self) -> None:
        """Add this run's outcomes to the file, to which other runs may have added. Pinned counts are left alone."""
        if self._fixed or not self._new.any():
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            counts = self._read() + self._new
            data = {"format": _FORMAT, "bank": self._bank, "engine": self._engine, "counts": counts.tolist()}
            aside = self.path.with_suffix(".part")
            aside.write_text(json.dumps(data))
            aside.replace(self.path)
        self._known, self._new = counts, np.zeros_like(counts)

    def _read(self) -> Array:
        if not self.path.exists():
            return np.zeros((self._size, 2), dtype=np.int64)
        try:
            data = json.loads(self.path.read_text())
            counts = np.array(data["counts"], dtype=np.int64)
            if data["format"] == _FORMAT and counts.shape == (self._size, 2) and (counts >= 0).all():
                return counts
            raise ValueError(f"expected {self._size} pairs of counts, got shape {counts.shape}")
        except (ValueError, KeyError, TypeError) as error:
            raise AssetError(f"{self.path} holds no counts ({error}); delete it to begin anew") from None
