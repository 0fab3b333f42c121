"""Filming in several processes, each with an engine of its own."""

import os
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from anysim.errors import AnysimError, RecordError
from anysim_film.filmer import Filmed, Filmer
from anysim_film.stage import FilmOrder

WATCH_S = 1.0
"""How often a worker looks whether its parent is there [s]."""


def film_all(work: Sequence[tuple[Path, Path | None]], order: FilmOrder, jobs: int = 1) -> Iterator[Filmed]:
    """Film trajectories, each into its directory (`Filmer.film`), in up to `jobs` processes; yields each when done.

    What is complete stays, whatever is raised. With more than one process they come in any order, and a program that
    calls this guards its main module (`if __name__ == "__main__"`), which each process imports.
    """
    if jobs == 1 or len(work) < 2:
        with Filmer(order) as filmer:
            for trajectory, directory in work:
                yield filmer.film(trajectory, directory)
        return
    with ProcessPoolExecutor(
        min(jobs, len(work)), mp_context=get_context("spawn"), initializer=_begin, initargs=(order, os.getpid())
    ) as pool:
        futures = [pool.submit(_film, *item) for item in work]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


_filmer: Filmer | None = None
"""That of a worker."""


def _begin(order: FilmOrder, parent: int) -> None:
    global _filmer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it reaches the parent, which lets what is begun come to its end
    _filmer = Filmer(order)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)  # half a video is left aside, where the next process removes it

    threading.Thread(target=watch, name="anysim-film-parent", daemon=True).start()


def _film(trajectory: Path, directory: Path | None) -> Filmed:
    assert _filmer is not None
    try:
        return _filmer.film(trajectory, directory)
    except AnysimError as error:
        raise RecordError(str(error)) from None  # errors that hold more than words do not survive the way back
