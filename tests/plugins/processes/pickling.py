"""An executor that does in this process what workers elsewhere do: all that travels is pickled both ways."""

import pickle  # noqa: TID251  as workers get and give what they do
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from itertools import chain, islice
from typing import Any

from anysim_processes.executors import JobExecutor


class Pickling(JobExecutor):
    """The second item comes first, as where it was done sooner. `items` counts those of all."""

    items = 0

    def treat_all(
        self,
        work: Iterable[tuple[Any, ...]],
        open_: Callable[[], AbstractContextManager[Callable[..., Any]]],
        workers: int | None = None,
    ) -> Iterator[Any]:
        items = iter(work)
        first = list(islice(items, 2))
        with pickle.loads(pickle.dumps(open_))() as treat:
            for item in chain(first[::-1], items):
                Pickling.items += 1
                yield pickle.loads(pickle.dumps(treat(*pickle.loads(pickle.dumps(item)))))
