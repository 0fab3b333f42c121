"""The task's expert as a policy, with noise on its actions where asked for."""

from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.commands import CommandSequence, DrawnSkill
from anysim.skills.phases import RUNGS, PhasedSkill
from anysim.skills.runner import SkillPolicy
from anysim.skills.sequence import SkillSequence
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_evaluation.policy import Effort


class ExpertPolicy:
    """The commands of `collect`, or else the task's expert. It reads the state of the world, not observations.

    The noise is normal, drawn in each step from the episode's own stream; its unit is half the range of each action,
    or the action's own unit where it has no bounds.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        sigma: Annotated[float, Field(ge=0.0, description="of the noise on actions, in half ranges")] = 0.0,
        retries: Annotated[bool, Field(description="whether a failure is followed by another try")] = True,
    ) -> None:
        self._env, self._sigma, self._skill = env, sigma, SkillPolicy(env)
        if not retries:
            _try_once(self._skill.skill)
        self._trying = [one for one in _whole(self._skill.skill) if not isinstance(one, DrawnSkill)]
        self._attempts = self._now()
        self._retries = np.zeros(env.num_envs, dtype=int)
        low, high = env.action_bounds
        half = (high - low) / 2
        self._scale = np.where(np.isfinite(half), half, 1.0)

    @property
    def skill(self) -> Skill:
        """What acts."""
        return self._skill.skill

    def reset(self, env_ids: Array) -> None:
        """Begin the skill in these envs."""
        self._skill.begin(env_ids)
        self._attempts, self._retries[env_ids] = self._now(), 0

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """(n, A)."""
        action = self._skill.act(env_ids)[env_ids]
        before, self._attempts = self._attempts, self._now()
        self._retries += np.maximum(self._attempts - before, 0).sum(axis=0)  # a skill that begins anew is at 1 again
        if self._sigma > 0.0:
            for row, i in enumerate(env_ids.tolist()):
                generator = self._env.streams.generator(i, "policy/noise", int(self._env.scene.elapsed[i]))
                action[row] += self._sigma * self._scale * generator.standard_normal(self._env.action_dim)
        return action

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: the skill ended in these envs with a failure."""
        return self._skill.gave_up(env_ids)

    def solved(self, env_ids: Array) -> Array:
        """(n,) bool: the commands are all done, and the task's success holds."""
        return self._skill.solved(env_ids)

    def failure(self, env: int) -> str:
        """The skill's outcome, as `no_ik`; empty while it runs."""
        outcome = str(self._skill.ended(env, False).get("outcome", ""))
        return "" if outcome in ("running", "ok") else outcome

    def effort(self, env: int, success: bool) -> Effort:
        """The retries of all its skills, and the commands before the one under way; what a fork leaves out is done."""
        skill, retries = self._skill.skill, int(self._retries[env])
        if not isinstance(skill, CommandSequence):
            return Effort(retries, None, None)
        all_done = success or skill.outcome[env] == OUTCOMES.index(Outcome.OK)
        return Effort(retries, len(skill.members) if all_done else int(skill.phase[env]), len(skill.members))

    def _now(self) -> Array:
        """(skills, N) how often each has tried again."""
        return np.array([one.attempts for one in self._trying])


def _whole(skill: Skill) -> Iterator[Skill]:
    """A skill, and those that it is made of."""
    yield skill
    parts = (
        skill.members if isinstance(skill, SkillSequence) else skill.variants if isinstance(skill, DrawnSkill) else ()
    )
    for part in parts:
        yield from _whole(part)


def _try_once(skill: Skill) -> None:
    """Take a skill's ladder of retries away, and that of the skills it is made of."""
    for one in _whole(skill):
        if isinstance(one, PhasedSkill):
            one.budgets = (0,) * len(RUNGS)
        elif isinstance(one, SkillSequence):
            one.max_attempts = 1
