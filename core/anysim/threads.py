"""Work on the rows of a batch, shared by the threads of this process.

It gains where the work lets other threads run meanwhile, as compiled kernels and solvers in C do.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

Part = TypeVar("Part")

NAME = "anysim shared"
"""How the names of these threads begin; they wait for work until the process ends."""


def usable_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, usable_cores() - 1), NAME)


if hasattr(os, "register_at_fork"):  # who was forked has none of its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


def shared(work: Callable[[Part], object], parts: Iterable[Part], threads: int | None = None) -> None:
    """Do `work(part)` for each part, in any order, and return when all are done.

    Args:
        work: what is done; it may share work itself.
        parts: of what there is to do.
        threads: at most so many, the caller's among them; as many as there are usable cores if not given.

    Raises:
        Exception: whatever the work raises first, when nobody works any more.
    """
    left = deque(parts)

    def go() -> None:
        while left:
            try:
                part = left.popleft()
            except IndexError:  # somebody else was faster
                return
            work(part)

    helpers = min(len(left), threads or usable_cores()) - 1
    others = [_pool().submit(go) for _ in range(helpers)]
    try:
        go()
    finally:
        begun = [one for one in others if not one.cancel()]  # who has not begun by now finds nothing left to do
        wait(begun)
    for one in begun:
        one.result()
