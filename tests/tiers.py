"""Tiers of what is run on every engine: often on MuJoCo and one of the others, on all of them before a release."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest

OTHERS = ("pybullet", "sapien")


def by_turns(names: Iterable[str], long: Collection[str] = ()) -> list[Any]:
    """Parameters (name, engine): slow on MuJoCo and, by turns, one other engine; full on the rest.

    Those that take long are slow on MuJoCo alone.
    """
    found: list[Any] = []
    for number, name in enumerate(names):
        often = ("mujoco",) if name in long else ("mujoco", OTHERS[number % 2])
        for engine in ("mujoco", *OTHERS):
            found.append(pytest.param(name, engine, marks=pytest.mark.slow if engine in often else pytest.mark.full))
    return found
