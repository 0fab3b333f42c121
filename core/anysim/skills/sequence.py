"""Sequences: skills one after the other in each env, and back to an earlier one where a later one fails."""

from collections.abc import Mapping, Sequence

import numpy as np

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.phases import GO_ON, STAY, PhasedSkill
from anysim.task.env import TaskEnv


class SkillSequence(Skill):
    """Skills that make a command: each env is in one of them, and goes on to the next where that has succeeded.

    A failure for which `back` has an entry sends the env back to an earlier member, at most `max_attempts` times in
    all; every other one ends the sequence. Phases are named `member: phase`.
    """

    def __init__(
        self,
        env: TaskEnv,
        members: Mapping[str, PhasedSkill],
        *,
        back: Mapping[tuple[str, Outcome], str] | None = None,
        max_attempts: int = 3,
    ) -> None:
        super().__init__(env)
        self.members: Sequence[PhasedSkill] = tuple(members.values())
        self._names = tuple(members)
        self._back = {(self._names.index(m), why): self._names.index(to) for (m, why), to in (back or {}).items()}
        self._max_attempts = max_attempts
        self._movers = tuple(dict.fromkeys(mover for member in self.members for mover in member.movers))
        self._climbs: list[tuple[tuple[str, str], ...]] = [()] * env.num_envs

    def begin(self, env_ids: Array) -> None:
        super().begin(env_ids)
        for mover in self._movers:
            mover.renew(env_ids)
        for i in env_ids.tolist():
            self._climbs[i] = ()
        self.members[0].start(env_ids)

    def act(self, env_ids: Array, action: Array) -> None:
        ids = env_ids[self.outcome[env_ids] <= GO_ON]  # what has succeeded is held until the episode ends
        if len(ids) == 0:
            return
        self.env.scene.look(ids)
        for mover in self._movers:
            mover.prepare(ids)
        at = np.arange(len(ids))
        for number, member in enumerate(self.members):
            here = (self.phase[ids] == number) & (self.outcome[ids] == STAY)
            if not here.any():
                continue
            member.decide(ids[here], at[here])
            over = ids[here & (member.outcome[ids] != STAY)]
            if len(over):
                self._end(number, over)
        for mover in self._movers:
            mover.act(ids, action)

    def _end(self, number: int, ids: Array) -> None:
        """Go on to the next member, back to an earlier one, or end."""
        member = self.members[number]
        won = ids[member.outcome[ids] == GO_ON]
        if number + 1 < len(self.members):
            self._go(won, number + 1)
        else:
            self.outcome[won] = GO_ON
        for env in ids[member.outcome[ids] != GO_ON].tolist():
            why = OUTCOMES[member.outcome[env]]
            to = self._back.get((number, why))
            if to is None or self.attempts[env] >= self._max_attempts:
                self.outcome[env] = OUTCOMES.index(why)
                continue
            self.attempts[env] += 1
            self._climbs[env] += (*member.climbs[env], (str(why), f"back to {self._names[to]}"))
            self._go(np.array([env]), to)

    def _go(self, ids: Array, number: int) -> None:
        self.phase[ids] = number
        if len(ids):
            self.members[number].start(ids)

    def describe(self, env: int) -> dict[str, object]:
        number = int(self.phase[env])
        member = self.members[number]
        now = member.describe(env)
        said: dict[str, object] = {
            "phase": f"{self._names[number]}: {now['phase']}",
            "outcome": str(OUTCOMES[self.outcome[env]]),
            "attempt": int(self.attempts[env]),
        }
        climbed = [f"{why} -> {rung}" for why, rung in (*self._climbs[env], *member.climbs[env])]
        return said | ({"ladder": climbed} if climbed else {})
