"""Items of work shared by several processes, each of which opens what does them once, as an engine."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from itertools import chain, islice
from multiprocessing import get_context
from typing import Any, TypeVar, TypeVarTuple

from anysim.errors import AnysimError, RecordError

WATCH_S = 1.0
"""How often a worker looks whether its parent is there [s]."""
AHEAD = 4
"""Items of each process that wait for it, so that a million of them take no room."""
T = TypeVar("T")
Item = TypeVarTuple("Item")


def treat_all(
    work: Iterable[tuple[*Item]], open_: Callable[[], AbstractContextManager[Callable[[*Item], T]]], jobs: int = 1
) -> Iterator[T]:
    """Do something with items in up to `jobs` processes, each of which opens what does it once.

    What is complete stays, whatever is raised. With more than one process they come in any order, and a program that
    calls this guards its main module (`if __name__ == "__main__"`), which each process imports. `open_` is pickled.

    Raises:
        RecordError: a process died; or what an item raised, where it is an error of anysim.
    """
    items = iter(work)
    first = list(islice(items, jobs))
    items = chain(first, items)
    if len(first) < 2:
        with open_() as treat:
            for item in items:
                yield treat(*item)
        return
    with ProcessPoolExecutor(
        len(first), mp_context=get_context("spawn"), initializer=_begin, initargs=(open_, os.getpid())
    ) as pool:
        begun = set[Future[T]]()
        try:
            while True:
                begun |= {pool.submit(_treated, *item) for item in islice(items, AHEAD * jobs - len(begun))}
                if not begun:
                    return
                done, begun = wait(begun, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        except BrokenProcessPool:
            words = "a worker process died, as where memory runs out; what was complete is there"
            raise RecordError(f"{words}, and the same command again goes on from it") from None
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


_opened: list[tuple[AbstractContextManager[Callable[..., Any]], Callable[..., Any]]] = []
"""That of a worker, open until the process ends."""


def _begin(open_: Callable[[], AbstractContextManager[Callable[..., Any]]], parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it reaches the parent, which lets what is begun come to its end
    if os.getppid() != parent:
        os._exit(1)
    context = open_()
    _opened.append((context, context.__enter__()))

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)  # half a result is left aside, where the next process removes it

    threading.Thread(target=watch, name="anysim-jobs-parent", daemon=True).start()


def _treated(*item: Any) -> Any:
    try:
        return _opened[0][1](*item)
    except AnysimError as error:
        raise RecordError(str(error)) from None  # errors that hold more than words do not survive the way back
