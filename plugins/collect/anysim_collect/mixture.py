"""Mixtures: several tasks with weights, and what ends a collection before all its episodes are begun."""

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from anysim.errors import TaskError

UNBOUNDED = 1_000_000
"""Episodes of a collection that ends by hours or bytes alone."""

_UNITS = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}
_BYTES = re.compile(r"(\d+(?:\.\d+)?) ?([kMGT]?)B?")


class Balance(StrEnum):
    """What the tasks of a mixture get by their weights: episodes, kept segments, or CPU seconds."""

    EPISODES = "episodes"
    SEGMENTS = "segments"
    SECONDS = "seconds"


class Part(NamedTuple):
    """One task of a mixture; of all episodes `share` in [0, 1] are its own."""

    task: str
    share: float


def mixture(words: Sequence[str]) -> list[Part]:
    """The tasks of `pick_cube=3 push_cube`: a weight is 1 where it is not given.

    Raises:
        TaskError: a weight that is no positive number, or a task that is named twice.
    """
    weights: dict[str, float] = {}
    for word in words:
        task, _, weight = word.rpartition("=") if "=" in word else (word, "", "1")
        try:
            value = float(weight)
        except ValueError:
            value = 0.0
        if not task or not 0.0 < value < float("inf"):
            raise TaskError(f"'{word}': expected TASK or TASK=WEIGHT with a number above 0, as in pick_cube=3")
        if task in weights:
            raise TaskError(f"the task '{task}' is named twice; give it one weight")
        weights[task] = value
    total = sum(weights.values())
    return [Part(task, weight / total) for task, weight in weights.items()]


def shared_out(parts: Sequence[Part], episodes: int) -> list[int]:
    """Whole episodes by share, `episodes` in all: those with the largest remainders get one more."""
    exact = [part.share * episodes for part in parts]
    counts = [int(number) for number in exact]
    order = sorted(range(len(parts)), key=lambda k: (counts[k] - exact[k], k))
    for k in order[: episodes - sum(counts)]:
        counts[k] += 1
    return counts


def parse_bytes(text: str) -> int:
    """`500MB`, `2 GB` or `1000000`: decimal units.

    Raises:
        TaskError: it is something else.
    """
    found = _BYTES.fullmatch(text.strip())
    if found is None or float(found[1]) <= 0.0:
        raise TaskError(f"--bytes {text}: expected a size such as 500MB, 2GB or 1000000")
    return int(float(found[1]) * _UNITS[found[2]])


def size_of(directory: Path) -> int:
    """Bytes of the files of a trajectory."""
    return sum(path.stat().st_size for path in directory.iterdir() if path.is_file())


@dataclass
class Limits:
    """When a collection has enough; `None` is no limit.

    Attributes:
        hours: [h] of wall time from now.
        max_bytes: of trajectories that are kept.
        kept: bytes so far; the recorder of a kept trajectory adds to it.
    """

    hours: float | None = None
    max_bytes: int | None = None
    kept: int = 0

    def __post_init__(self) -> None:
        self._began = time.monotonic()

    def reached(self) -> str:
        """Which limit has been reached, in words; empty for none."""
        if self.hours is not None and time.monotonic() - self._began > 3600.0 * self.hours:
            return f"{self.hours:g} hours"
        return f"{self.max_bytes:,} bytes" if self.max_bytes is not None and self.kept >= self.max_bytes else ""
