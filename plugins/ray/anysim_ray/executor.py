"""The executor `ray`: items of work done by workers on the nodes of a Ray cluster."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Annotated, TypeVar, TypeVarTuple

from pydantic import Field

from anysim_processes.executors import JobExecutor
from anysim_ray.cluster import connected
from anysim_ray.crew import Crew, Needs

T = TypeVar("T")
Item = TypeVarTuple("Item")


class RayExecutor(JobExecutor):
    """`--executor ray`, or `ray:address=10.0.0.1:6379,num_cpus=2`."""

    def __init__(
        self,
        *,
        address: str = "",
        num_cpus: Annotated[float, Field(gt=0)] = 1.0,
        num_gpus: Annotated[float, Field(ge=0)] = 0.0,
        tries: Annotated[int, Field(ge=1)] = 5,
    ) -> None:
        """Nothing is connected before there is work.

        Args:
            address: HOST:PORT of the cluster's head; else RAY_ADDRESS, else this machine's cluster, else a new one.
            num_cpus: of a node, for each worker.
            num_gpus: the same, as for an engine that draws with them.
            tries: how often an item is begun, each time because its worker was lost, before that ends the command.
        """
        self._address, self._needs = address, Needs(num_cpus, num_gpus, tries)

    def treat_all(
        self,
        work: Iterable[tuple[*Item]],
        open_: Callable[[], AbstractContextManager[Callable[[*Item], T]]],
        workers: int | None = None,
    ) -> Iterator[T]:
        with connected(self._address) as ray:
            yield from Crew(ray, self._needs, open_, workers).treat(work)
