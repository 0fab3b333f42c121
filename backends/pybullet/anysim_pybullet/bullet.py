"""The one place that imports PyBullet, without its banner, and that opens and closes clients."""

import importlib
from functools import cache
from typing import Any

from anysim.c_output import quiet
from anysim.errors import EngineError

MOST_CLIENTS = 1024
"""Clients that Bullet has room for in a process."""


@cache
def bullet() -> Any:
    """The module pybullet. Importing it prints its build time, which nobody asked for."""
    with quiet():
        return importlib.import_module("pybullet")


def connect() -> int:
    """Open a client without a window.

    Raises:
        EngineError: Bullet gives no more of them; it has room for 1024 in a process.
    """
    p = bullet()
    with quiet() as words:
        client = p.connect(p.DIRECT)
    if client < 0:
        raise EngineError(
            f"Bullet opens no further world in this process: {words.tail}. It holds at most {MOST_CLIENTS}; use fewer "
            f"envs, or more processes"
        )
    return client


def disconnect(client: int) -> None:
    """Close a client and free what it holds."""
    bullet().disconnect(physicsClientId=client)
