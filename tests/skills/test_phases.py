"""The state machine of phased skills: gates, typed failures, the ladder and its budgets, and sequences."""

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.planning.service import PlannerService
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import BUDGETS, GO_ON, RUNGS, STAY, Mover, Phase, PhasedSkill, Rung
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from tests.task.helpers import blocks

Answer = Callable[[int, int], int]
"""What an env (its number, its control steps in the phase) says."""


class Scripted(PhasedSkill):
    """Phases that answer as they are told."""

    def __init__(self, env: TaskEnv, answers: Sequence[Answer], rungs: Sequence[Rung] = (), late: int = 50) -> None:
        self._answers, self._rungs, self._late = answers, rungs, late
        self.log: list[str] = []
        super().__init__(env, [Hand(self.log)])

    def make_phases(self) -> list[Phase]:
        def phase(number: int, answer: Answer) -> Phase:
            def step(ids: Array, at: Array) -> Array:
                assert len(ids) == len(at)
                return np.array([answer(i, int(self.steps[i])) for i in ids.tolist()])

            return Phase(
                f"p{number}", lambda ids, at: self.log.append(f"enter {number} {ids.tolist()}"), step, self._late
            )

        return [phase(n, a) for n, a in enumerate(self._answers)]

    def make_recovery(self) -> list[Phase]:
        """Two phases, of which the second takes two control steps more."""
        if Rung.RECOVER not in self._rungs:
            return []

        def home(ids: Array, at: Array) -> Array:
            self.log.append(f"home {ids.tolist()}")
            return np.where(self.steps[ids] >= 2, GO_ON, STAY)

        return [Phase("let go", None, lambda ids, at: np.full(len(ids), GO_ON), 1), Phase("home", None, home, 5)]

    def anew(self, env_ids: Array) -> None:
        super().anew(env_ids)
        self.log.extend(f"anew {env}" for env in env_ids.tolist())

    def retry(self, rung: Rung, env: int) -> int | None:
        del env
        return 0 if rung in self._rungs else None


class Hand(Mover):
    """A mover that writes down what it is asked."""

    def __init__(self, log: list[str]) -> None:
        self._log = log

    def renew(self, ids: Array) -> None:
        self._log.append(f"renew {ids.tolist()}")

    def prepare(self, ids: Array) -> None:
        pass

    def act(self, ids: Array, action: Array) -> None:
        self._log.append(f"move {ids.tolist()}")

    def describe(self, env: int) -> dict[str, object]:
        return {}


class Asking(Hand):
    """A mover with a planner that is asked something in every control step."""

    def __init__(self, log: list[str], service: "Flushed") -> None:
        super().__init__(log)
        self._service = service

    @property
    def planners(self) -> tuple[PlannerService, ...]:
        return (cast(PlannerService, self._service),)


class Flushed:
    """A planner service of which only that counts."""

    def __init__(self, log: list[str]) -> None:
        self._log = log

    def flush(self) -> None:
        self._log.append("flush")


def after(steps: int, then: int = GO_ON) -> Answer:
    return lambda env, step: then if step >= steps else STAY


def failing(why: Outcome) -> Answer:
    return after(0, OUTCOMES.index(why))


def run(skill: PhasedSkill | SkillSequence, steps: int) -> None:
    ids = np.arange(skill.env.num_envs)
    skill.begin(ids)
    for _ in range(steps):
        skill.act(ids, np.zeros((len(ids), 0)))


def test_each_env_goes_through_the_phases_at_its_own_pace() -> None:
    with blocks(3) as env:
        env.reset(seed=0)
        skill = Scripted(env, [lambda i, step: GO_ON if step >= i else STAY, after(1)])
        skill.begin(np.arange(3))
        seen = []
        for _ in range(4):
            skill.act(np.arange(3), np.zeros((3, 0)))
            seen.append([skill.describe(i)["phase"] if skill.outcome[i] == STAY else "done" for i in range(3)])
        assert seen == [["p1", "p0", "p0"], ["done", "p1", "p0"], ["done", "done", "p1"], ["done", "done", "done"]]
        assert skill.log[0] == "renew [0, 1, 2]"
        assert skill.log[-1] == "move [0, 1, 2]", "what has succeeded is held"


@pytest.mark.parametrize("rung", [Rung.REPLAN, Rung.CANDIDATE, Rung.BACK_OFF])
def test_a_rung_is_used_as_often_as_its_budget_says(rung: Rung) -> None:
    with blocks(1) as env:
        env.reset(seed=0)
        skill = Scripted(env, [failing(Outcome.JAMMED)], [rung])
        run(skill, 20)
        budget = BUDGETS[RUNGS.index(rung)]
        assert OUTCOMES[skill.outcome[0]] is Outcome.JAMMED
        assert skill.attempts[0] == 1 + budget
        assert skill.describe(0)["ladder"] == [f"jammed -> {rung}"] * budget + ["jammed -> give up"]


def test_the_ladder_begins_where_the_failure_says_and_never_goes_down() -> None:
    with blocks(1) as env:
        env.reset(seed=0)
        skill = Scripted(env, [failing(Outcome.NO_IK)], RUNGS)
        run(skill, 20)
        tried = [rung for _, rung in skill.climbs[0]]
        assert tried == ["candidate"] * 4 + ["resample"] * 2 + ["back_off", "recover", "give up"]


def test_a_skill_that_recovers_goes_through_phases_of_its_own_and_starts_anew() -> None:
    with blocks(2) as env:
        env.reset(seed=0)
        jammed = OUTCOMES.index(Outcome.JAMMED)
        skill = Scripted(env, [after(0), lambda i, step: jammed if i == 0 else GO_ON], [Rung.RECOVER])
        skill.begin(np.arange(2))
        seen = []
        for _ in range(5):
            skill.act(np.arange(2), np.zeros((2, 0)))
            seen.append(skill.describe(0)["phase"])
        assert seen == ["home", "home", "p0", "p1", "p1"]
        assert skill.log.count("anew 0") == 1
        assert "anew 1" not in skill.log
        assert not any(said.startswith("home") and "1" in said for said in skill.log), "ordinary progress"
        assert skill.climbs == [(("jammed", "recover"), ("jammed", "give up")), ()]
        assert [OUTCOMES[o] for o in skill.outcome] == [Outcome.JAMMED, Outcome.OK]


def test_what_cannot_recover_from_a_failure_gives_up() -> None:
    with blocks(1) as env:
        env.reset(seed=0)
        skill = Scripted(env, [failing(Outcome.LOST)], [Rung.RECOVER])
        skill.recovers = lambda env, failure: failure is not Outcome.LOST  # type: ignore[method-assign]
        run(skill, 5)
        assert skill.climbs == [(("lost", "give up"),)]


def test_an_adverse_state_is_not_retried() -> None:
    with blocks(1) as env:
        env.reset(seed=0)
        skill = Scripted(env, [failing(Outcome.ADVERSE_STATE)], RUNGS)
        run(skill, 3)
        assert OUTCOMES[skill.outcome[0]] is Outcome.ADVERSE_STATE
        assert skill.attempts[0] == 1


def test_a_phase_that_takes_too_long_is_a_timeout() -> None:
    with blocks(1) as env:
        env.reset(seed=0)
        skill = Scripted(env, [after(1000)], late=7)
        run(skill, 7)
        assert skill.outcome[0] == STAY
        skill.act(np.array([0]), np.zeros((1, 0)))
        assert OUTCOMES[skill.outcome[0]] is Outcome.TIMEOUT


def test_one_env_that_fails_leaves_the_others_alone() -> None:
    with blocks(2) as env:
        env.reset(seed=0)
        skill = Scripted(env, [lambda i, step: OUTCOMES.index(Outcome.LOST) if i == 0 else after(3)(i, step)])
        run(skill, 5)
        assert [OUTCOMES[o] for o in skill.outcome] == [Outcome.LOST, Outcome.OK]


def test_a_sequence_goes_back_to_an_earlier_member_as_often_as_it_may() -> None:
    with blocks(2) as env:
        env.reset(seed=0)
        grasp = Scripted(env, [after(2)])
        carry = Scripted(env, [lambda i, step: OUTCOMES.index(Outcome.UNSTABLE_GRASP) if i == 0 else after(1)(i, step)])
        carry.first_rungs = {}  # type: ignore[misc]
        pick = SkillSequence(
            env, {"grasp": grasp, "carry": carry}, back={("carry", Outcome.UNSTABLE_GRASP): "grasp"}, max_attempts=2
        )
        run(pick, 3)
        assert [pick.describe(i)["phase"] for i in range(2)] == ["grasp: p0", "carry: p0"]
        assert pick.describe(0)["ladder"][-1] == "unstable_grasp -> back to grasp"  # type: ignore[index]
        run_on(pick, 10)
        assert [OUTCOMES[o] for o in pick.outcome] == [Outcome.UNSTABLE_GRASP, Outcome.OK]
        assert pick.attempts.tolist() == [2, 1]


def run_on(skill: SkillSequence, steps: int) -> None:
    ids = np.arange(skill.env.num_envs)
    for _ in range(steps):
        skill.act(ids, np.zeros((len(ids), 0)))


def test_planners_are_flushed_once_a_step_after_all_movers_have_asked() -> None:
    log: list[str] = []
    service = Flushed(log)
    with blocks(2) as env:
        env.reset(seed=0)
        skill = Scripted(env, [after(9)])
        skill.movers = (Asking(log, service), Asking(log, service))
        skill.begin(np.arange(2))
        log.clear()
        skill.act(np.arange(2), np.zeros((2, 0)))
    assert log == ["move [0, 1]", "move [0, 1]", "flush"]
