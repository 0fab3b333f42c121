"""Workers of engines that are gone, kept for the next engine of the same kind: to start new ones takes a second or two.

Only where someone asks for it, such as a program that makes one engine after the other: idle workers take memory.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from anysim.engine.sharded.pool import Crew

_kept: dict[str, Crew] | None = None
"""Idle crews by kind; None where none are kept."""


@contextmanager
def keeping_workers() -> Iterator[None]:
    """Within it the workers of an engine that is destroyed wait for the next of its kind; at its end they end."""
    global _kept
    outer = _kept
    _kept = {}
    try:
        yield
    finally:
        idle, _kept = _kept, outer
        for crew in idle.values():
            crew.close()


def hire(path: str, options: Mapping[str, Any], count: int, threads: int, timeout_s: float) -> Crew:
    """Idle workers of this kind, or new ones."""
    kind = Crew.kind_of(path, options, count, threads, timeout_s)
    idle = None if _kept is None else _kept.pop(kind, None)
    return Crew(path, options, count, threads, timeout_s) if idle is None else idle


def dismiss(crew: Crew) -> None:
    """Keep a crew where crews are kept and nothing is wrong with it; else end it."""
    if _kept is not None and crew.kind not in _kept and crew.rest():
        _kept[crew.kind] = crew
    else:
        crew.close()
