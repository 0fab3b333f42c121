"""The planner service `threads`: worker threads that have planners of their own."""

from anysim.model.world import World
from anysim_planning.answering import Job, PlannerHost, PlannerMaker, planner_maker
from anysim_planning.queued import QueuedService, Seat, overdue


class ThreadedService(QueuedService):
    """Worker threads around planners; a thread that hangs is replaced."""

    def __init__(self, world: World, planner: str | PlannerMaker = "rrt", workers: int = 1) -> None:
        """`planner`: a name, or what makes one; each thread makes its own.

        Raises:
            AnysimError: fewer workers than one.
            PluginError: there is no planner of that name.
        """
        self._make = planner_maker(world, planner)
        super().__init__(workers)

    def _work(self, seat: Seat) -> None:
        host = PlannerHost(self._make)
        while (jobs := self._next(seat)) is not None:
            for answer, processor in host.answers([Job(f.request, f.scene, f.budget) for f in jobs]):
                self._give(seat, answer, processor)

    def _replace_the_hung(self) -> None:
        for number, seat in enumerate(self._seats):
            if seat.hangs:
                for future in seat.jobs:
                    future.budget.cancel()
                    self._answer(future, overdue())
                seat.retired = True
                self.counts.lost_workers += 1
                self._seats[number] = self._started()
