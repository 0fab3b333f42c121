"""The service `threads` with planners that answer, raise, hang, die, and answer out of order."""

import time
from threading import Event
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from anysim.errors import AnysimError
from anysim.model.world import World
from anysim.planning.motion import Budget, MotionPlanner, PlanAnswer, PlanRequest, PlanStatus, Scene, Trajectory
from anysim_planning import threads as module
from anysim_planning.threads import ThreadedService

SCENE = Scene(3, np.zeros((0, 7)), np.zeros(0, bool))


class Scripted(MotionPlanner):
    """Does what the seed of a request says: 100 raises, 101 exits, 102 hangs, 103 sleeps; answers with the seed."""

    name, version, capabilities = "scripted", "1", frozenset({"joint_goal"})
    gate: ClassVar[Event] = Event()

    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        match request.seed:
            case 100:
                raise ValueError("broken")
            case 101:
                raise SystemExit(3)
            case 102:
                self.gate.wait(20)
            case 103:
                time.sleep(0.05)
        if budget.spent:
            return PlanAnswer(budget.spent)
        path = np.full((1, len(request.joints)), float(request.seed))
        return PlanAnswer(PlanStatus.OK, trajectory=Trajectory(np.zeros(1), path, path), world_version=scene.version)

    def is_free(self, request: PlanRequest, scene: Scene, joint_pos: np.ndarray) -> bool:
        return True


def asked(seed: int = 0, joints: int = 1, deadline: float = 5.0) -> PlanRequest:
    names = tuple(f"j{k}" for k in range(joints))
    return PlanRequest(names, np.zeros(joints), joint_goal=np.ones(joints), seed=seed, deadline=deadline)


def service(threads: int = 1) -> ThreadedService:
    return ThreadedService(World(), lambda: Scripted(World()), threads)


def seeds(futures: list) -> list[float]:
    return [future.answer.trajectory.joint_pos[0, 0] for future in futures]


@pytest.mark.parametrize("threads", [1, 2])
def test_answers_come_at_their_step_in_the_order_of_submission(threads: int) -> None:
    with service(threads) as plans:
        for seed in (103, 1, 2):
            plans.submit(asked(seed), SCENE, now=4, latency=2)
        plans.submit(asked(5, joints=3), SCENE, now=4, latency=1)
        assert plans.harvest(4) == []
        assert seeds(plans.harvest(5)) == [5]
        assert seeds(plans.harvest(6)) == [103, 1, 2]
        assert plans.harvest(7) == []
        assert plans.counts.submitted == plans.counts.answered == 4


def test_late_answers_are_waited_for_and_counted() -> None:
    with service() as plans:
        plans.submit(asked(103), SCENE, latency=0)
        assert seeds(plans.harvest(0)) == [103]
        assert plans.counts.late == 1
        assert plans.counts.waited > 0.01


def test_without_a_latency_an_answer_is_taken_when_it_is_ready() -> None:
    with service() as plans:
        future = plans.submit(asked(103), SCENE, latency=None)
        assert plans.harvest(10) == []
        future.result()
        assert plans.harvest(10) == [future]
        assert plans.counts.late == 0


@pytest.mark.parametrize(("seed", "error"), [(100, "ValueError: broken"), (101, "SystemExit: 3")])
def test_a_request_that_breaks_its_planner_fails_alone(seed: int, error: str) -> None:
    with service() as plans:
        futures = [plans.submit(asked(s), SCENE) for s in (1, seed, 2)]
        answers = [future.result() for future in futures]
        assert [a.status for a in answers] == ["ok", "failed", "ok"]
        assert error in answers[1].message
        assert plans.submit(asked(7), SCENE).result().status is PlanStatus.OK


def test_a_planner_that_hangs_is_given_up_and_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "GRACE", 0.05)
    Scripted.gate.clear()
    with service() as plans:
        hung = plans.submit(asked(102, deadline=0.05), SCENE)
        plans.flush()
        other = plans.submit(asked(4, joints=2), SCENE)
        assert other.result().status is PlanStatus.OK
        assert hung.result().status is PlanStatus.TIMEOUT
        assert plans.counts.lost_workers == 1
        Scripted.gate.set()


def test_a_planner_that_cannot_be_made_fails_requests_and_nothing_else() -> None:
    def broken() -> MotionPlanner:
        raise RuntimeError("no such file")

    with ThreadedService(World(), broken) as plans:
        assert "no such file" in plans.submit(asked(), SCENE).result().message


def test_closing_cancels_and_refuses_what_comes_later() -> None:
    plans = service()
    future = plans.submit(asked(), SCENE)
    plans.close()
    assert future.result().status is PlanStatus.CANCELLED
    with pytest.raises(AnysimError, match="is closed"):
        plans.submit(asked(), SCENE)


def test_a_malformed_request_is_refused_where_it_is_made() -> None:
    with service() as plans:
        with pytest.raises(AnysimError, match="joint_goal"):
            plans.submit(PlanRequest(("a",), np.zeros(1)), SCENE)
        assert plans.counts.submitted == 0


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 99), st.integers(1, 3), st.booleans()), min_size=50, max_size=50))
def test_submits_and_cancels_lose_nothing(calls: list[tuple[int, int, bool]]) -> None:
    with service(2) as plans:
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
