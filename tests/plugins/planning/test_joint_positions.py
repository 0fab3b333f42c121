"""Joint positions without a path, asked of a service: answers do not depend on what is asked beside them."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from anysim.errors import AnysimError
from anysim.planning.motion import (
    Budget,
    PlanAnswer,
    PlanRequest,
    PlanStatus,
    RequestKind,
    Scenes,
    ToolGoal,
    motion_planner,
)
from anysim.planning.service import planner_service
from anysim.testing.planners import rooms
from anysim_planning.queued import BATCH, MOTIONS
from anysim_planning.threads import ThreadedService
from tests.plugins.planning.scripted import SCENE, Scripted, asked

WORLD = rooms.one_arm()
HERE = Scenes(WORLD, 1).scene(0)
ASIDE = HERE._replace(version=1, body_pose=HERE.body_pose - 0.05 * np.eye(7)[1])
"""All that moves stands 5 cm to the right."""
GOAL = (ToolGoal("arm", "tool", rooms.FAR[None]),)


def wanted(number: int) -> PlanRequest:
    """Five poses behind the wall, tolerances and widths by turns."""
    good = rooms.tool_pose(WORLD, HERE, rooms.RIGHT + 0.02 * (number % 4))
    poses = np.stack([rooms.FAR, good, good + np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0])][: 2 + number % 2])
    request = replace(rooms.reach(WORLD, poses, path=False, seed=number), start=rooms.LEFT + 0.03 * number)
    if number % 3:
        return request
    return replace(request, goals=(replace(request.goals[0], rotation_weight=(1.0, 1.0, 0.0)),))


ASKED = [(wanted(number), ASIDE if number in (2, 5) else HERE) for number in range(8)] + [
    (rooms.reach(WORLD, rooms.FAR[None], path=False), HERE)
]
ALONE = [motion_planner(WORLD, "rrt").plan(request, scene, Budget(rooms.LONG)) for request, scene in ASKED]


def same(a: PlanAnswer, b: PlanAnswer) -> bool:
    if (a.status, a.chosen, a.goal_status, dict(a.margins)) != (b.status, b.chosen, b.goal_status, dict(b.margins)):
        return False
    return a.joint_pos is b.joint_pos is None or np.array_equal(a.joint_pos, b.joint_pos)  # pyright: ignore


@pytest.fixture(scope="module", params=[1, 2])
def threads(request: pytest.FixtureRequest) -> Iterator[ThreadedService]:
    with ThreadedService(WORLD, "rrt", request.param) as service:
        yield service


def test_the_requests_have_answers_of_both_kinds() -> None:
    assert {answer.status for answer in ALONE} == {PlanStatus.OK, PlanStatus.NO_IK}
    assert {answer.chosen for answer in ALONE} >= {(1,), ()}


@settings(max_examples=15)
@given(order=st.lists(st.integers(0, len(ASKED) - 1), min_size=1, max_size=20), flushed=st.integers(0, 20))
def test_any_order_and_any_batch_give_the_answers_of_each_alone(
    threads: ThreadedService, order: list[int], flushed: int
) -> None:
    futures = []
    for place, number in enumerate(order):
        futures.append(threads.submit(*ASKED[number]))
        if place == flushed:
            threads.flush()
    threads.harvest(0)
    for number, future in zip(order, futures, strict=True):
        assert same(future.result(), ALONE[number])


def test_processes_answer_as_threads_and_a_motion_among_them_is_planned() -> None:
    motion = rooms.across(WORLD)
    with planner_service(WORLD, "rrt", 1, "processes") as service:
        futures = [service.submit(*one) for one in [ASKED[0], (motion, HERE), *ASKED[1:]]]
        answers = [future.result() for future in futures]
    assert answers[1].trajectory is not None
    assert all(same(one, alone) for one, alone in zip([answers[0], *answers[2:]], ALONE, strict=True))


def test_a_worker_takes_more_of_them_at_once_than_of_motions(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: dict[bool, int] = {}
    take = ThreadedService._next

    def counted(self: ThreadedService, seat: object, limit: float | None = None) -> object:
        jobs = take(self, seat, limit)  # pyright: ignore
        if jobs:
            sizes[jobs[0].request.path] = max(sizes.get(jobs[0].request.path, 0), len(jobs))
        return jobs

    monkeypatch.setattr(ThreadedService, "_next", counted)
    with ThreadedService(WORLD, Scripted) as service:
        for path in (True, False):
            request = replace(asked(), path=path, joint_goal=None, goals=GOAL)
            futures = [service.submit(request, SCENE) for _ in range(600)]
            service.flush()
            for future in futures:
                future.result()
    assert sizes == {True: MOTIONS, False: BATCH}


def test_an_env_may_ask_for_both_kinds_at_once() -> None:
    with ThreadedService(WORLD, "rrt") as service:
        first = service.submit(*ASKED[0], env=0)
        motion = service.submit(rooms.across(WORLD), HERE, env=0)
        second = service.submit(*ASKED[1], env=0)
        assert first.result().status is PlanStatus.CANCELLED
        assert motion.result().status is PlanStatus.OK
        assert same(second.result(), ALONE[1])


def test_what_no_planner_can_answer_is_refused_and_what_one_does_not_declare_fails() -> None:
    assert ASKED[0][0].kind is RequestKind.IK
    for wrong in (replace(rooms.across(WORLD), path=False), replace(ASKED[0][0], straight=0.01)):
        with pytest.raises(AnysimError, match="ik asks for the joints at poses of tools"):
            wrong.check()
    with ThreadedService(WORLD, Scripted) as service:
        answers = [service.submit(*ASKED[0]).result() for _ in range(2)]
    assert {answer.status for answer in answers} == {PlanStatus.FAILED}
    assert "'scripted' does not declare 'ik'" in answers[0].message
