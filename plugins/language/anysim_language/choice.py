"""Choices among phrasings: by a digest of the seed and of what is said, never by a generator or by `hash`."""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def number(seed: int, *what: object) -> int:
    """A whole number below 2**64 for a seed and what it is for: the same in every process and on every machine."""
    text = "\x1f".join(map(str, (seed, *what)))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")


def choose(options: Sequence[T], seed: int, *what: object) -> T:
    """One of the options."""
    return options[number(seed, *what) % len(options)]


def ordered(options: Sequence[T], seed: int, *what: object) -> list[T]:
    """All options, in an order that follows from the seed."""
    return [options[i] for i in sorted(range(len(options)), key=lambda i: (number(seed, *what, i), i))]
