"""Ends of engines without `destroy`: one that is dropped frees its world, a copy in a forked process says what it is.

A fork copies the memory of engines, but not the threads, sockets and devices that they use: a step would wait for ever
for threads that do not exist, or speak to the workers of the parent.
"""

import ctypes
import gc
import os
import sys
import threading
import weakref
from typing import Self

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import State
from anysim.model.world import World

FEW = 4
"""As many engines may hold a world; beyond that the garbage collector is called, when twice as many do."""

_enough = FEW
_living: "weakref.WeakSet[EngineLifetime]" = weakref.WeakSet()


class EngineLifetime:
    """Base of engines: what becomes of one that is dropped without `destroy`, or copied by a fork."""

    _world: World | None = None
    _state: State | None = None
    _forked_from = 0
    """In a forked copy: the process that the engine belongs to."""

    def __new__(cls, *_: object, **__: object) -> Self:
        global _enough
        if _holding() > _enough:  # engines are parts of cycles, and Python does not see how much they hold
            gc.collect()
            _enough = max(FEW, 2 * _holding())
        made = super().__new__(cls)
        _living.add(made)
        return made

    num_envs: int

    def destroy(self) -> None:
        """Free the world."""

    @property
    def lost(self) -> Array:
        """(N,) bool: envs whose worker process was lost since their last reset. Where there are none, none is."""
        return np.zeros(self.num_envs, dtype=bool)

    def abandon(self, owner: int) -> None:
        """In a forked copy: forget the world without freeing it, and refuse to be used from now on."""
        if self._world is None:
            return
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self))  # freeing what it holds could wait for threads, too
        if self._state is not None:
            self._state.retire()
        self._world, self._state, self._lock = None, None, threading.RLock()  # another thread may have held the lock
        self._destroyed, self._forked_from = True, owner

    @property
    def _ended(self) -> str:
        """Why a destroyed engine cannot be used, as `this NAME engine …`."""
        if not self._forked_from:
            return "was destroyed; make a new one"
        return (
            f"belongs to process {self._forked_from}, and this one is a fork of it, without the engine's threads and "
            "devices. Make envs after the fork, or start processes by `spawn` or `forkserver` (multiprocessing."
            "set_start_method)"
        )

    def __del__(self) -> None:
        if self._world is not None and not sys.is_finalizing():
            self.destroy()


def _holding() -> int:
    """How many engines hold a world: those that were destroyed do not, and cost nothing until they are collected."""
    return sum(vars(engine).get("_world") is not None for engine in list(_living))


def _after_fork() -> None:
    owner = os.getppid()
    for engine in list(_living):
        engine.abandon(owner)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
