"""Planner services with planners that answer, raise, hang, exit, and answer out of order."""

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from anysim.errors import AnysimError
from anysim.model.world import World
from anysim.planning.motion import PlanRequest, PlanStatus
from anysim_planning import queued
from anysim_planning.processes import ProcessService
from anysim_planning.threads import ThreadedService
from tests.plugins.planning.scripted import (
    ASKS,
    EXITS,
    HANGS,
    LOADS,
    RAISES,
    SCENE,
    SLEEPS,
    Scripted,
    Together,
    asked,
    broken,
)

Kind = type[ThreadedService] | type[ProcessService]
KINDS = [ThreadedService, ProcessService]


@pytest.fixture(params=KINDS, ids=lambda kind: kind.__name__)
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Kind:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3]))  # processes import the scripted planner
    return request.param


def seeds(futures: list) -> list[float]:
    return [future.answer.trajectory.joint_pos[0, 0] for future in futures]


@pytest.mark.parametrize("workers", [1, 2])
def test_answers_come_at_their_step_in_the_order_of_submission(kind: Kind, workers: int) -> None:
    with kind(World(), Scripted, workers) as plans:
        for seed in (SLEEPS, 1, 2):
            plans.submit(asked(seed), SCENE, now=4, latency=2)
        plans.submit(asked(5, joints=3), SCENE, now=4, latency=1)
        assert plans.harvest(4) == []
        assert seeds(plans.harvest(5)) == [5]
        assert seeds(plans.harvest(6)) == [SLEEPS, 1, 2]
        assert plans.harvest(7) == []
        assert plans.counts.submitted == plans.counts.answered == 4
        assert 0.0 < plans.counts.processor < 5.0


def test_late_answers_are_waited_for_and_counted(kind: Kind) -> None:
    with kind(World(), Scripted) as plans:
        plans.submit(asked(SLEEPS), SCENE, latency=0)
        assert seeds(plans.harvest(0)) == [SLEEPS]
        assert plans.counts.late == 1
        assert plans.counts.waited > 0.01


def test_without_a_latency_an_answer_is_taken_when_it_is_ready(kind: Kind) -> None:
    with kind(World(), Scripted) as plans:
        future = plans.submit(asked(SLEEPS), SCENE, latency=None)
        assert plans.harvest(10) == []
        future.result()
        assert plans.harvest(10) == [future]
        assert plans.counts.late == 0


@pytest.mark.parametrize(("seed", "error"), [(RAISES, "ValueError: broken"), (EXITS, "SystemExit: 3")])
def test_a_request_that_breaks_its_planner_fails_alone(kind: Kind, seed: int, error: str) -> None:
    with kind(World(), Scripted) as plans:
        futures = [plans.submit(asked(s), SCENE) for s in (1, seed, 2)]
        answers = [future.result() for future in futures]
        assert [a.status for a in answers] == ["ok", "failed", "ok"]
        assert error in answers[1].message
        assert plans.submit(asked(7), SCENE).result().status is PlanStatus.OK


@pytest.mark.parametrize("workers", [1, 2])
def test_a_newer_request_of_an_env_supersedes_what_has_not_begun(kind: Kind, workers: int) -> None:
    with kind(World(), Scripted, workers) as plans:
        older = [plans.submit(asked(seed), SCENE, env=env) for seed, env in ((1, 0), (2, 1))]
        other_joints = plans.submit(asked(3, joints=3), SCENE, env=0)
        newer = plans.submit(asked(4), SCENE, env=0)
        assert older[0].done  # at once: not only when a worker comes to it
        assert older[0].result().status is PlanStatus.CANCELLED
        assert "env 0 asked anew" in older[0].result().message
        assert plans.harvest(0) == [*older, other_joints, newer]
        assert seeds([older[1], other_joints, newer]) == [2, 3, 4]
        assert (plans.counts.answered, plans.counts.cancelled) == (4, 1)


@settings(max_examples=25)
@given(
    asks=st.lists(st.tuples(st.integers(1, 9), st.integers(1, 3), st.none() | st.integers(0, 2), st.booleans())),
    workers=st.integers(1, 2),
)
def test_what_is_superseded_depends_on_the_submissions_alone(
    asks: list[tuple[int, int, int | None, bool]], workers: int
) -> None:
    with ThreadedService(World(), Scripted, workers) as plans:
        futures, expected, open_rows = [], [], {}
        for row, (seed, joints, env, flushed) in enumerate(asks):
            if env is not None and (env, joints) in open_rows:
                expected[open_rows[env, joints]] = PlanStatus.CANCELLED
            futures.append(plans.submit(asked(seed, joints), SCENE, env=env))
            expected.append(PlanStatus.OK)
            open_rows[env, joints] = row
            if flushed:
                plans.flush()
                open_rows.clear()
        assert [future.result().status for future in futures] == expected


def test_a_planner_that_hangs_is_given_up_and_replaced(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queued, "GRACE", 0.05)
    with kind(World(), Scripted) as plans:
        hung = plans.submit(asked(HANGS, deadline=0.05), SCENE)
        plans.flush()
        other = plans.submit(asked(4, joints=2), SCENE)
        assert other.result().status is PlanStatus.OK
        assert hung.result().status is PlanStatus.TIMEOUT
        assert plans.counts.lost_workers == 1


def test_a_planner_that_cannot_be_made_fails_requests_and_nothing_else(kind: Kind) -> None:
    with kind(World(), broken) as plans:
        assert "no such file" in plans.submit(asked(), SCENE).result().message


def test_warming_up_is_before_the_clock(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queued, "GRACE", 0.05)
    with kind(World(), Scripted) as plans:
        assert plans.submit(asked(LOADS, deadline=0.05), SCENE).result().status is PlanStatus.OK
        assert plans.counts.lost_workers == 0


def test_a_planner_of_whole_batches_is_asked_for_each_alone_where_one_breaks_it(kind: Kind) -> None:
    with kind(World(), Together) as plans:
        futures = [plans.submit(asked(s), SCENE) for s in (1, RAISES, 2, 3)]
        assert [future.result().status for future in futures] == ["ok", "failed", "ok", "ok"]


def test_a_cancelled_request_stops_its_planner(kind: Kind) -> None:
    with kind(World(), Scripted) as plans:
        future = plans.submit(asked(ASKS, deadline=60.0), SCENE)
        plans.flush()
        time.sleep(0.1)
        assert future.cancel()
        assert future.result().status is PlanStatus.CANCELLED
        assert plans.submit(asked(1), SCENE).result().status is PlanStatus.OK
        assert plans.counts.lost_workers == 0


def test_closing_cancels_and_refuses_what_comes_later(kind: Kind) -> None:
    plans = kind(World(), Scripted)
    future = plans.submit(asked(), SCENE)
    plans.close()
    assert future.result().status is PlanStatus.CANCELLED
    with pytest.raises(AnysimError, match="is closed"):
        plans.submit(asked(), SCENE)


def test_a_malformed_request_is_refused_where_it_is_made(kind: Kind) -> None:
    with kind(World(), Scripted) as plans:
        with pytest.raises(AnysimError, match="joint_goal"):
            plans.submit(PlanRequest(("a",), np.zeros(1)), SCENE)
        assert plans.counts.submitted == 0


@settings(max_examples=20)
@given(st.lists(st.tuples(st.integers(0, 99), st.integers(1, 3), st.booleans()), min_size=50, max_size=50))
def test_submits_and_cancels_lose_nothing(calls: list[tuple[int, int, bool]]) -> None:
    with ThreadedService(World(), Scripted, 2) as plans:
        futures = []
        for step, (seed, joints, gives_up) in enumerate(calls):
            future = plans.submit(asked(seed, joints), SCENE, now=step, latency=3)
            futures.append(future)
            if seed % 7 == 0:
                plans.flush()
            assert not gives_up or future.cancel() or future.done
            plans.harvest(step)
        plans.harvest(len(calls) + 3)
        assert plans.counts.answered == plans.counts.submitted == len(calls)
        for future, (seed, _, gives_up) in zip(futures, calls, strict=True):
            if future.answer.status is PlanStatus.OK:
                assert seeds([future]) == [seed]
            else:
                assert gives_up
                assert future.answer.status is PlanStatus.CANCELLED
