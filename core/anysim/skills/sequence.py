"""Sequences: skills one after the other in each env, and back to an earlier one where a later one fails."""

from collections.abc import Collection, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.phases import GO_ON, STAY, MovingSkill
from anysim.task.env import TaskEnv


class SkillSequence(MovingSkill):
    """Skills that make a command, or commands that make an episode: each env is in one of them.

    Where it has succeeded the env goes on to the next. A failure for which `back` has an entry sends the env back to an
    earlier member, at most `max_attempts` times in all; that of a member in `optional` is passed over; every other one
    ends the sequence. Phases are named `member: phase`.
    """

    def __init__(
        self,
        env: TaskEnv,
        members: Mapping[str, MovingSkill],
        *,
        back: Mapping[tuple[str, Outcome], str] | None = None,
        max_attempts: int = 3,
        optional: Collection[str] = (),
        limits: Mapping[str, int] | None = None,
    ) -> None:
        """`limits` are the control steps that a member may take; one that takes longer has failed with `timeout`."""
        super().__init__(env)
        self.phases = tuple(members)
        self.members = tuple(members.values())
        self.movers = tuple(dict.fromkeys(mover for member in self.members for mover in member.movers))
        self._back = {(self.phases.index(m), why): self.phases.index(to) for (m, why), to in (back or {}).items()}
        self.max_attempts = max_attempts
        self._optional = {self.phases.index(name) for name in optional}
        self._limits = {self.phases.index(name): steps for name, steps in (limits or {}).items()}
        self._steps = np.zeros(env.num_envs, dtype=np.int64)
        self._past: list[tuple[tuple[str, str], ...]] = [()] * env.num_envs

    def start(self, env_ids: Array) -> None:
        Skill.begin(self, env_ids)
        for i in env_ids.tolist():
            self._past[i] = ()
        self._go(env_ids, 0)

    def foresee(self, following: MovingSkill) -> None:
        self.members[-1].foresee(following)

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        return self.members[0].wanted(ids, at, grasps)

    def decide(self, ids: Array, at: Array) -> None:
        for number, member in enumerate(self.members):
            here = (self.phase[ids] == number) & (self.outcome[ids] == STAY)
            if not here.any():
                continue
            own = ids[here]
            member.decide(own, at[here])
            self._steps[own] += 1
            limit = self._limits.get(number)
            if limit is not None:
                late = own[(member.outcome[own] == STAY) & (self._steps[own] > limit)]
                member.outcome[late] = _TIMEOUT
            over = own[member.outcome[own] != STAY]
            if len(over):
                self._end(number, over)

    def _end(self, number: int, ids: Array) -> None:
        """Go on to the next member, back to an earlier one, or end."""
        member = self.members[number]
        done = member.outcome[ids] == GO_ON
        for env in ids[~done].tolist():
            why = OUTCOMES[member.outcome[env]]
            to = self._back.get((number, why))
            if to is not None and self.attempts[env] < self.max_attempts:
                self.attempts[env] += 1
                self._past[env] += (*member.history(env), (str(why), f"back to {self.phases[to]}"))
                self._go(np.array([env]), to)
            elif number in self._optional:
                self._past[env] += (*member.history(env), (str(why), f"without {self.phases[number]}"))
                self._go(np.array([env]), number + 1)
            else:
                self.outcome[env] = OUTCOMES.index(why)
        self._go(ids[done], number + 1)

    def _go(self, ids: Array, number: int) -> None:
        """Begin with a member; after the last one the sequence has succeeded."""
        if number == len(self.members):
            self.outcome[ids] = GO_ON
        elif len(ids):
            self.phase[ids], self._steps[ids] = number, 0
            self.members[number].start(ids)

    def history(self, env: int) -> tuple[tuple[str, str], ...]:
        return (*self._past[env], *self.members[self.phase[env]].history(env))

    def moment(self, env: int) -> tuple[int, ...]:
        return *super().moment(env), *self.members[self.phase[env]].moment(env)

    def about(self, env: int) -> dict[str, object]:
        return {key: value for member in self.members for key, value in member.about(env).items()}

    def describe(self, env: int) -> dict[str, object]:
        said = super().describe(env)
        now = self.members[self.phase[env]].describe(env)
        return said | {"phase": f"{said['phase']}: {now['phase']}"}


_TIMEOUT = OUTCOMES.index(Outcome.TIMEOUT)
