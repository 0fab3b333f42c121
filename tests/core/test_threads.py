"""Work that the threads of a process share."""

import threading
import time
from functools import cache

import pytest

from anysim import threads
from anysim.threads import shared
from tests.forked import run


@pytest.fixture(autouse=True)
def several_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "usable_cores", lambda: 4)
    monkeypatch.setattr(threads, "_pool", cache(threads._pool.__wrapped__))


@pytest.mark.parametrize("most", [None, 1, 2, 9])
def test_all_parts_are_done_once(most: int | None) -> None:
    done: list[int] = []
    shared(done.append, range(100), most)
    assert sorted(done) == list(range(100))


def test_several_threads_work_on_them_but_no_more_than_are_allowed() -> None:
    for most, expected in ((None, 4), (2, 2), (1, 1)):
        who: set[int] = set()
        gate = threading.Barrier(expected)

        def work(_part: int, gate: threading.Barrier = gate, who: set[int] = who) -> None:
            who.add(threading.get_ident())
            gate.wait(10.0)

        shared(work, range(expected), most)
        assert len(who) == expected


def test_what_it_raises_is_raised_when_nobody_works_any_more() -> None:
    working = threading.Semaphore(0)

    def work(part: int) -> None:
        if part == 0:
            raise ArithmeticError("the first part")
        time.sleep(0.05)
        working.release()

    with pytest.raises(ArithmeticError, match="the first part"):
        shared(work, range(4))
    done = sum(working.acquire(blocking=False) for _ in range(3))
    time.sleep(0.1)
    assert not working.acquire(blocking=False), f"a part went on after {done} others"


def test_work_may_share_work_itself() -> None:
    done: list[tuple[int, int]] = []
    shared(lambda one: shared(lambda two: done.append((one, two)), range(5)), range(8))
    assert sorted(done) == [(one, two) for one in range(8) for two in range(5)]


FORK = """
import os, time
from anysim.threads import shared
shared(lambda _: time.sleep(0.001), range(8), 2)
child = os.fork()
if not child:
    done = []
    shared(done.append, range(8), 2)
    os._exit(len(done))
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 8
"""


def test_a_forked_process_has_threads_of_its_own() -> None:
    done = run("-c", FORK, timeout=60)
    assert done.returncode == 0, done.stderr
