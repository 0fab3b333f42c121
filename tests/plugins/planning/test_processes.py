"""The service `processes`: what dies or hangs there is replaced, and nothing is left behind."""

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from anysim.errors import AnysimError
from anysim.model.world import World
from anysim.planning.motion import Budget, PlanAnswer, PlanStatus, Scene, motion_planner
from anysim_planning import queued
from anysim_planning.planner_process import NICENESS
from anysim_planning.processes import ProcessService
from tests.plugins.planning.conftest import across, down, reach
from tests.plugins.planning.scripted import DIES, HANGS, RAISES, SCENE, SLEEPS, Scripted, Together, asked
from tests.plugins.sharded.shards_help import alive, children, descriptors, gone


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3]))  # processes import the scripted planner


def wait_for_another(plans: ProcessService, before: tuple[int, ...]) -> None:
    end = time.perf_counter() + 20.0
    while len(plans.pids) < len(before) or plans.pids == before:
        assert time.perf_counter() < end, "no process came in the place of the lost one"
        time.sleep(0.02)


def test_a_request_its_process_dies_of_fails_alone() -> None:
    with ProcessService(World(), Scripted) as plans:
        answers = [f.result() for f in [plans.submit(asked(s), SCENE) for s in (1, 2, DIES, 3, 4)]]
        assert [answer.status for answer in answers] == ["ok", "ok", "failed", "ok", "ok"]
        assert answers[2].message == "the planner's process was ended by signal 9 (SIGKILL)"
        assert plans.counts.lost_workers == 1


def test_in_a_batch_that_is_planned_together_the_one_that_kills_is_found() -> None:
    with ProcessService(World(), Together) as plans:
        answers = [f.result() for f in [plans.submit(asked(s), SCENE) for s in (1, DIES, 3, 4, 5, 6)]]
        assert [answer.status for answer in answers] == ["ok", "failed", "ok", "ok", "ok", "ok"]


def test_a_hung_process_is_killed_and_replaced_while_nobody_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queued, "GRACE", 0.05)
    with ProcessService(World(), Scripted) as plans:
        plans.submit(asked(1), SCENE).result()
        before = plans.pids
        hung = plans.submit(asked(HANGS, deadline=0.05), SCENE)
        plans.flush()
        wait_for_another(plans, before)
        assert hung.answer is not None
        assert hung.answer.status is PlanStatus.TIMEOUT
        assert gone(before)
        assert plans.submit(asked(2), SCENE).result().status is PlanStatus.OK


def test_a_process_that_dies_with_nothing_to_do_is_replaced() -> None:
    with ProcessService(World(), Scripted) as plans:
        plans.submit(asked(1), SCENE).result()
        before = plans.pids
        os.kill(before[0], signal.SIGKILL)
        wait_for_another(plans, before)
        os.kill(plans.pids[0], signal.SIGKILL)  # and once more, just before it has something to do
        assert plans.submit(asked(2), SCENE).result().status is PlanStatus.OK


def test_nothing_is_left_behind() -> None:
    with ProcessService(World(), Scripted) as plans:
        plans.submit(asked(1), SCENE).result()
    processes, files = children(), descriptors()
    for seed in (DIES, HANGS):
        with ProcessService(World(), Scripted, 2) as plans:
            plans.submit(asked(seed), SCENE)
            plans.flush()
            time.sleep(0.2)
            pids = plans.pids
        assert gone(pids, 2.0)
    assert children() == processes
    assert descriptors() == files


def test_closing_waits_for_no_process_that_is_still_loaded(world: World) -> None:
    processes, threads = children(), threading.active_count()
    plans = ProcessService(world, "rrt")
    while not plans.pids:
        time.sleep(0.001)
    begun = time.perf_counter()
    plans.close()
    assert time.perf_counter() - begun < queued.CLOSING
    assert threading.active_count() == threads
    assert children() == processes


def test_processes_yield_to_the_control_loop_and_have_no_pools() -> None:
    with ProcessService(World(), Scripted) as plans:
        plans.submit(asked(1), SCENE).result()
        (pid,) = plans.pids
        assert os.getpriority(os.PRIO_PROCESS, pid) == min(os.getpriority(os.PRIO_PROCESS, 0) + NICENESS, 19)
        environment = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        assert b"NUMBA_NUM_THREADS=1" in environment
        assert alive(pid)


def test_a_request_that_cannot_be_sent_fails_alone() -> None:
    with ProcessService(World(), Scripted) as plans:
        unsendable = replace(asked(2), allowed=((lambda: None, "a"),))  # pyright: ignore[reportArgumentType]
        answers = [f.result() for f in [plans.submit(r, SCENE) for r in (asked(1), unsendable, asked(3))]]
        assert [answer.status for answer in answers] == ["ok", "failed", "ok"]
        assert "cannot be asked" in answers[1].message


def test_a_process_ends_with_its_parent() -> None:
    program = (
        "import os, sys; from anysim.model.world import World; from anysim_planning.processes import ProcessService; "
        "plans = ProcessService(World(), 'rrt')\n"
        "while not plans.pids: pass\n"
        "sys.stdout.write(str(plans.pids[0])); sys.stdout.flush(); os._exit(0)"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert gone([int(ended.stdout)])


def test_a_maker_that_other_processes_cannot_import_is_refused() -> None:
    with pytest.raises(AnysimError, match="cannot be imported by other processes"):
        ProcessService(World(), lambda: Scripted())


@pytest.mark.parametrize("workers", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_the_answers_are_those_of_the_planner_alone_bit_for_bit(world: World, scene: Scene, workers: int) -> None:
    poses = down((0.5, -0.3, 0.3), (0.4, -0.4, 0.3), (2.0, 0.0, 0.3))
    requests = [across(world, seed=0), *(reach(world, poses, seed=s) for s in range(3))]
    planner = motion_planner(world)
    alone = [planner.plan(request, scene, Budget(request.deadline)) for request in requests]
    with ProcessService(world, "rrt", workers) as plans:
        futures = [plans.submit(request, scene) for request in reversed(requests)]
        assert all(_same(f.result(), a) for f, a in zip(futures, reversed(alone), strict=True))


def _same(a: PlanAnswer, b: PlanAnswer) -> bool:
    assert a.trajectory is not None
    assert b.trajectory is not None
    return a.chosen == b.chosen and all(map(np.array_equal, a.trajectory, b.trajectory))


@pytest.mark.slow
def test_a_thousand_submits_and_cancels_with_faults_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queued, "GRACE", 0.05)
    files = descriptors()
    kinds = st.sampled_from([*range(100)] * 2 + [RAISES, SLEEPS, SLEEPS, DIES, HANGS])
    call = st.tuples(kinds, st.integers(1, 3), st.booleans(), st.sampled_from([None, 0, 1, 3]))
    submitted = 0

    with ProcessService(World(), Scripted, 2) as plans:

        @settings(max_examples=20, database=None, derandomize=True)
        @given(st.lists(call, min_size=50, max_size=50))
        def run(calls: list[tuple[int, int, bool, int | None]]) -> None:
            nonlocal submitted
            futures, taken = [], []
            for step, (seed, joints, gives_up, latency) in enumerate(calls):
                deadline = 0.05 if seed == HANGS else 5.0
                future = plans.submit(asked(seed, joints, deadline), SCENE, now=step, latency=latency)
                futures.append(future)
                if seed % 7 == 0:
                    plans.flush()
                assert not gives_up or future.cancel() or future.done
                taken += plans.harvest(step)
            for future in futures:
                future.result()
            taken += plans.harvest(len(calls) + 3)
            submitted += len(calls)
            assert sorted(map(id, taken)) == sorted(map(id, futures))  # each once
            assert plans.counts.answered == plans.counts.submitted == submitted
            for future, (seed, _, gives_up, _) in zip(futures, calls, strict=True):
                answer = future.answer
                assert answer is not None
                if gives_up and answer.status is PlanStatus.CANCELLED:
                    continue
                wanted = {RAISES: "failed", DIES: "failed", HANGS: "timeout"}.get(seed, "ok")
                assert answer.status == wanted, answer.message
                assert answer.trajectory is None or answer.trajectory.joint_pos[0, 0] == seed

        run()
        assert submitted >= 1000
        assert plans.counts.lost_workers > 0
        pids = plans.pids
    assert gone(pids, 2.0)
    assert descriptors() <= files
