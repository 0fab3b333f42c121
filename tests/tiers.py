"""Tiers of what is run with every engine or case: often with one or two of them, with all of them more rarely."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest

OTHERS = ("pybullet", "sapien")
ENGINES = ("mujoco", *OTHERS)


def by_turns(names: Iterable[str]) -> list[Any]:
    """Parameters (name, engine): slow on MuJoCo and, by turns, one other engine; full on the rest."""
    return [
        _tiered(name, engine, engine in ("mujoco", OTHERS[number % 2]))
        for number, name in enumerate(names)
        for engine in ENGINES
    ]


def in_turn(*columns: Iterable[Any]) -> list[Any]:
    """Parameters (name, engine), or more columns: slow on one engine, each in its turn; full on the rest."""
    return [
        _tiered(*row, engine, engine == ENGINES[number % 3])
        for number, row in enumerate(zip(*columns, strict=True))
        for engine in ENGINES
    ]


def one_by_turns(names: Iterable[str], alone: Collection[str] = ()) -> list[Any]:
    """Parameters (name, engine): slow on one engine of the two that `by_turns` has, full on the rest.

    Those that are tried alone, and every third of the others, are slow on MuJoCo.
    """
    return [
        _tiered(name, engine, engine == ("mujoco" if name in alone or number % 3 == 0 else OTHERS[number % 2]))
        for number, name in enumerate(names)
        for engine in ENGINES
    ]


def others_in_turn(*columns: Iterable[Any]) -> list[Any]:
    """Parameters (name, engine) without MuJoCo, which is tried elsewhere: slow on one engine, full on the other."""
    return [
        _tiered(*row, engine, engine == OTHERS[number % 2])
        for number, row in enumerate(zip(*columns, strict=True))
        for engine in OTHERS
    ]


def others(often: str) -> list[Any]:
    """The engines without MuJoCo: one is slow, the other full."""
    return [_tiered(engine, engine == often) for engine in OTHERS]


def often(chosen: Collection[str], names: Iterable[str]) -> list[Any]:
    """Parameters: those that are chosen for the fast tier, and the rest, slow."""
    return [name if name in chosen else pytest.param(name, marks=pytest.mark.slow) for name in names]


def slow_alone(parameters: Iterable[Any]) -> list[Any]:
    """Those parameters that are slow, without what only the full tier runs."""
    return [one for one in parameters if pytest.mark.slow in one.marks]


def _tiered(*values: Any) -> Any:
    """A parameter of all values but the last, which says whether it is often run."""
    return pytest.param(*values[:-1], marks=pytest.mark.slow if values[-1] else pytest.mark.full)
