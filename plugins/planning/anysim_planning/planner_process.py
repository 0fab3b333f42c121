"""Program of a process that plans: hold a planner of one World, and answer requests in order, each when it is ready."""

import contextlib
import faulthandler
import os
import signal
import socket
from functools import partial
from importlib import import_module
from multiprocessing.connection import Connection
from operator import attrgetter

from anysim.planning.motion import Budget, MotionPlanner, PlanStatus
from anysim_planning.answering import Job, PlannerHost, planner_maker
from anysim_planning.queued import BATCH
from anysim_processes.own_process import end_with_parent
from anysim_processes.shared_memory import Layout, SharedArrays

NICENESS = 15
"""The control loop goes first where both want a core. A planner takes one for a tick of the clock at least, of 4 ms on
many machines: with 10 more than one control step in a hundred is longer by that, with 15 fewer."""
NOTES: Layout = {"given_up": ((BATCH,), "|b1"), "end": ((BATCH,), "<f8")}
"""What a process and its parent share, by place in the batch: the wish to stop, and when the time will be over."""


def main(connection: int, parent_watch: int) -> None:
    """Serve until the parent says stop, or ends. Ctrl-C reaches the parent, which decides what becomes of this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(parent_watch)
    faulthandler.enable()  # a crash in a planner's library says where
    os.nice(NICENESS)
    with socket.socket(fileno=connection) as channel, Connection(os.dup(connection)) as pipe:
        with contextlib.suppress(EOFError, OSError):
            _, world, planner = pipe.recv()
            _, descriptors, *_ = socket.recv_fds(channel, 1, 1)
            make = partial(_imported, planner) if ":" in planner else planner_maker(world, planner)
            _serve(pipe, PlannerHost(make), SharedArrays(NOTES, descriptors[0]))


def _imported(path: str) -> MotionPlanner:
    module, _, name = path.partition(":")
    return attrgetter(name)(import_module(module))()


def _serve(pipe: Connection, host: PlannerHost, notes: SharedArrays) -> None:
    with contextlib.suppress(Exception):  # told with the first request, which tries again
        host.prepare()
    while True:
        number, kind, asked = pipe.recv()
        if kind == "stop":
            return
        jobs = [
            Job(request, scene, _Budget(request.deadline, notes, place)) for place, (request, scene) in enumerate(asked)
        ]
        for answer in host.answers(jobs):
            pipe.send((number, "done", answer))


class _Budget(Budget):
    """The time of a request; its end, and the wish to stop it, are shared with the parent."""

    def __init__(self, deadline: float, notes: SharedArrays, place: int) -> None:
        super().__init__(deadline)
        self._given_up, self._ends, self._place = notes["given_up"], notes["end"], place

    def begin(self) -> None:
        super().begin()
        self._ends[self._place] = self.end

    @property
    def spent(self) -> PlanStatus | None:
        return PlanStatus.CANCELLED if self._given_up[self._place] else super().spent
