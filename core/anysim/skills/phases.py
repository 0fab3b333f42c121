"""Phases: a skill as a table of phases with gates, typed failures, and one fixed ladder of retries.

In each control step every env is in one phase. A phase sets what the robot is to do next and says of each env whether
it stays, goes on, or has failed and how. A failure climbs the ladder: its first rung follows from its type, each rung
has a budget for the whole skill, and what no rung is left for ends the skill with the type of the failure.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import reduce
from operator import or_
from typing import ClassVar, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.planning.service import PlannerService
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv

STAY, GO_ON = OUTCOMES.index(Outcome.RUNNING), OUTCOMES.index(Outcome.OK)
"""A phase's answers, besides the index of a failure in OUTCOMES."""


class Rung(StrEnum):
    """The rungs of the ladder, from the cheapest."""

    REPLAN = "replan"  # the same goal, another seed of the planner
    CANDIDATE = "candidate"  # the next one of the goal set
    RESAMPLE = "resample"  # another goal set
    BACK_OFF = "back_off"  # away from the scene, look again, start anew
    RECOVER = "recover"  # through phases of its own, such as to the home posture, then start anew


RUNGS = tuple(Rung)
BUDGETS = (2, 4, 2, 1, 1)
"""How often a skill may use each rung in one env."""
FIRST_RUNGS: Mapping[Outcome, Rung] = {
    Outcome.NO_IK: Rung.CANDIDATE,  # another seed of the planner reaches no pose outside of the workspace
    Outcome.COLLISION: Rung.CANDIDATE,
    Outcome.NO_PATH: Rung.REPLAN,
    Outcome.MISSED_CONTACT: Rung.RESAMPLE,
    Outcome.UNSTABLE_GRASP: Rung.RESAMPLE,
    Outcome.JAMMED: Rung.REPLAN,
    Outcome.TIMEOUT: Rung.REPLAN,
    Outcome.CONTROLLER: Rung.BACK_OFF,
    Outcome.LOST: Rung.BACK_OFF,
    Outcome.WRONG_OBJECT: Rung.BACK_OFF,
}
"""Where the ladder begins; what is not listed is not retried."""


class Mover(ABC):
    """What skills move, such as an arm with its gripper: they say where to, and it moves once for all of them."""

    def renew(self, ids: Array) -> None:
        """These envs have just been reset."""

    def prepare(self, ids: Array) -> None:
        """Look at these envs, which the scene looks at, before the skills do."""

    @abstractmethod
    def act(self, ids: Array, action: Array) -> None:
        """Write the rows of the action of these envs, which the scene looks at."""

    @property
    def planners(self) -> tuple[PlannerService, ...]:
        """The services that plan its moves; skills flush them at the end of each control step."""
        return ()

    def describe(self, env: int) -> dict[str, object]:
        """What records say of how it moves, the same as long as an episode lasts."""
        del env
        return {}


class Phase(NamedTuple):
    """One phase. Its functions take the envs (n,) and their rows (n,) among those that the scene looks at.

    Attributes:
        name: for records and tables.
        enter: called once an env comes here, if there is anything to do then.
        step: called in every control step, the first one too; (n,) STAY, GO_ON, or the index of a failure in OUTCOMES.
        steps: more control steps than this are a timeout.
    """

    name: str
    enter: Callable[[Array, Array], None] | None
    step: Callable[[Array, Array], Array]
    steps: int


class MovingSkill(Skill):
    """A skill that says where its movers are to go, so that several can share them in one control step.

    Attributes:
        movers: what it moves.
    """

    movers: tuple[Mover, ...]

    @abstractmethod
    def start(self, env_ids: Array) -> None:
        """Begin where another skill has ended: what moves goes on from where it is told to be."""

    @abstractmethod
    def decide(self, ids: Array, at: Array) -> None:
        """Say what is to move where in these envs; `at` are their rows among those that the scene looks at."""

    def foresee(self, following: "MovingSkill") -> None:
        """The command that comes next, once: what cannot go on with that need not be begun."""
        del following

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, m, 7) that it needs with grasps (n, g, 7), of envs (n,), their rows in the scene.

        (n, g, c, m, 7) where one of c ways is enough; a way with NaN is none.
        """
        del ids, at
        return np.zeros((*grasps.shape[:2], 0, 7))

    def history(self, env: int) -> tuple[tuple[str, str], ...]:
        """The failures of an env since it was started, each with what was tried next."""
        del env
        return ()

    def about(self, env: int) -> dict[str, object]:
        """What records say besides, such as which bank it goes by; the same as long as `moment` is."""
        del env
        return {}

    def begin(self, env_ids: Array) -> None:
        self.start(env_ids)
        for mover in self.movers:
            mover.renew(env_ids)

    def act(self, env_ids: Array, action: Array) -> None:
        ids = env_ids[self.outcome[env_ids] <= GO_ON]  # what has succeeded is held until the episode ends
        if len(ids) == 0:
            return
        self.env.scene.look(ids)
        for mover in self.movers:
            mover.prepare(ids)
        self.decide(ids, np.arange(len(ids)))
        for mover in self.movers:
            mover.act(ids, action)
        for service in dict.fromkeys(service for mover in self.movers for service in mover.planners):
            service.flush()  # the questions of all movers and envs in this control step together

    def moment(self, env: int) -> tuple[int, ...]:
        return int(self.phase[env]), int(self.outcome[env]), int(self.attempts[env])

    def describe(self, env: int) -> dict[str, object]:
        climbed = [f"{outcome} -> {rung}" for outcome, rung in self.history(env)]
        said = super().describe(env) | ({"ladder": climbed} if climbed else {}) | self.about(env)
        return reduce(or_, (mover.describe(env) for mover in self.movers), said)


class PhasedSkill(MovingSkill):
    """A skill that is a table of phases.

    Attributes:
        table: the phases, and after them those that only the rung RECOVER enters.
        last: the number of the last one that ordinary progress comes to.
        budgets: how often it may use each rung of the ladder in one env.
        steps: (N,) control steps in the present phase.
        used: (N, rungs) how often each rung of the ladder was used since `begin`.
        climbs: for each env the failures so far, each with the rung that was tried next.
    """

    first_rungs: ClassVar[Mapping[Outcome, Rung]] = FIRST_RUNGS
    first: ClassVar[int] = 0
    """The phase that it begins with; those before are on the way back from a failure."""

    def __init__(self, env: TaskEnv, movers: Sequence[Mover] = ()) -> None:
        super().__init__(env)
        self.movers = tuple(movers)
        ordinary = tuple(self.make_phases())
        self.last = len(ordinary) - 1
        self.table: Sequence[Phase] = (*ordinary, *self.make_recovery())
        self.phases = tuple(phase.name for phase in self.table)
        self.budgets: Sequence[int] = BUDGETS
        self.steps = np.zeros(env.num_envs, dtype=np.int64)
        self.used = np.zeros((env.num_envs, len(RUNGS)), dtype=np.int64)
        self.climbs: list[tuple[tuple[str, str], ...]] = [()] * env.num_envs

    @abstractmethod
    def make_phases(self) -> Sequence[Phase]:
        """The table, first phase first. Called by the constructor: a subclass sets what it needs before."""

    def make_recovery(self) -> Sequence[Phase]:
        """The phases of the rung RECOVER; none where the skill has no such rung. Called after `make_phases`.

        They go on as far as they get: one that fails climbs the ladder, where this rung is used up.
        """
        return ()

    def recovers(self, env: int, failure: Outcome) -> bool:
        """Whether the phases of RECOVER can be of use to an env after a failure."""
        del env, failure
        return True

    def forget(self, env_ids: Array) -> None:
        """Nothing has been given up in these envs, where it begins, or starts anew."""

    def anew(self, env_ids: Array) -> None:
        """These envs have recovered, and start anew."""
        self.forget(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Prepare another try of an env on a rung below RECOVER, whose phases do that.

        Returns:
            the phase to go on with; None where the skill has no such rung.
        """
        del env
        return 0 if rung in (Rung.REPLAN, Rung.BACK_OFF) else None

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        """(n,) after the last phase: GO_ON, or the index of a failure; the skill's check on the live state."""
        del at
        return np.full(len(env_ids), GO_ON)

    def start(self, env_ids: Array) -> None:
        Skill.begin(self, env_ids)
        self.used[env_ids] = 0
        for i in env_ids.tolist():
            self.climbs[i] = ()
        self.forget(env_ids)
        self._go(env_ids, self.first)

    def decide(self, ids: Array, at: Array) -> None:
        for number, phase in enumerate(self.table):
            here = (self.phase[ids] == number) & (self.outcome[ids] == STAY)
            if not here.any():
                continue
            own, rows = ids[here], at[here]
            if phase.enter is not None and (fresh := self.steps[own] == 0).any():
                phase.enter(own[fresh], rows[fresh])
            said = phase.step(own, rows)
            self.steps[own] += 1
            said = np.where((said == STAY) & (self.steps[own] > phase.steps), _TIMEOUT, said)
            on = said == GO_ON
            if on.any():
                self._leave(number, own[on], rows[on])
            failed = (said != STAY) & ~on
            for env, code in zip(own[failed].tolist(), said[failed].tolist(), strict=True):
                self._climb(env, OUTCOMES[code])

    def history(self, env: int) -> tuple[tuple[str, str], ...]:
        return self.climbs[env]

    def _leave(self, number: int, ids: Array, at: Array) -> None:
        if number != self.last:
            if number + 1 < len(self.table):
                self._go(ids, number + 1)
            else:
                self.anew(ids)
                self._go(ids, self.first)
            return
        said = self.succeeded(ids, at)
        done = said == GO_ON
        self.outcome[ids[done]] = GO_ON
        for env, code in zip(ids[~done].tolist(), said[~done].tolist(), strict=True):
            self._climb(env, OUTCOMES[code])

    def _go(self, ids: Array, phase: int) -> None:
        self.phase[ids], self.steps[ids] = phase, 0

    def _recovery(self, env: int, failure: Outcome) -> int | None:
        first = self.last + 1
        return first if first < len(self.table) and self.recovers(env, failure) else None

    def _climb(self, env: int, failure: Outcome) -> None:
        """Try the first rung that is left for a failure, or end the skill with it."""
        first = self.first_rungs.get(failure)
        for rung in RUNGS[RUNGS.index(first) :] if first is not None else ():
            number = RUNGS.index(rung)
            if self.used[env, number] >= self.budgets[number]:
                continue
            phase = self._recovery(env, failure) if rung is Rung.RECOVER else self.retry(rung, env)
            if phase is None:
                continue
            self.used[env, number] += 1
            self.attempts[env] += 1
            self.climbs[env] += ((str(failure), str(rung)),)
            self._go(np.array([env]), phase)
            return
        self.outcome[env] = OUTCOMES.index(failure)
        self.climbs[env] += ((str(failure), "give up"),)


_TIMEOUT = OUTCOMES.index(Outcome.TIMEOUT)
