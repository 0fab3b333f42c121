"""The task's expert as a policy, with noise on its actions where asked for."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import Skill
from anysim.skills.commands import DrawnSkill
from anysim.skills.phases import RUNGS, PhasedSkill
from anysim.skills.runner import SkillPolicy
from anysim.skills.sequence import SkillSequence
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv


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

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """(n, A)."""
        action = self._skill.act(env_ids)[env_ids]
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


def _try_once(skill: Skill) -> None:
    """Take a skill's ladder of retries away, and that of the skills it is made of."""
    if isinstance(skill, PhasedSkill):
        skill.budgets = (0,) * len(RUNGS)
    elif isinstance(skill, SkillSequence):
        skill.max_attempts = 1
    parts = (
        skill.members if isinstance(skill, SkillSequence) else skill.variants if isinstance(skill, DrawnSkill) else ()
    )
    for part in parts:
        _try_once(part)
