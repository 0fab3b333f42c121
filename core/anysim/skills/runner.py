"""SkillPolicy: the task's expert as a policy over all envs, each on its own timeline."""

from typing import Any

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import AnysimError, SpecError, SpecIssue, TaskError
from anysim.plugin_parameters import options_model, parameters, reference_kind
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv
from anysim.task.term_registry import resolve
from anysim_schemas.task import ExpertSpec


def bind_skill(spec: ExpertSpec, env: TaskEnv) -> Skill:
    """The skill with its parameters checked and names resolved.

    Raises:
        SpecError: at `task.expert.<parameter>`, a name that does not exist in this world.
    """
    skill_class: type[Skill] = registry.load("skills", spec.skill)
    values = options_model(skill_class).model_validate(spec.params)
    keywords: dict[str, Any] = {}
    for name, parameter in parameters(skill_class).items():
        value, handle = getattr(values, name), reference_kind(parameter.annotation)
        if handle is not None:
            try:
                value = resolve(handle, value, env.scene)
            except AnysimError as error:
                raise SpecError([SpecIssue("", f"task.expert.{name}", str(error))]) from None
        keywords[name] = value
    try:
        return skill_class(env, **keywords)
    except BaseException as error:  # noqa: BLE001 - told with the key
        registry.blame(error, f"{env.located('task.expert')}: the skill '{spec.skill}'", registry.origin(skill_class))


class SkillPolicy:
    """Acts in the envs it is asked for; an env whose skill has given up stays still."""

    def __init__(self, env: TaskEnv) -> None:
        task = env.spec.task
        if task is None or task.expert is None:
            raise TaskError(
                f"task '{env.name}' has no expert; add task.expert, or drive the env with a policy of your own"
            )
        self.env = env
        self.name = task.expert.skill
        self.skill = bind_skill(task.expert, env)
        self._blame = registry.Blame(
            f"{env.located('task.expert')}: the skill '{self.name}'", registry.origin(self.skill), prefix=True
        )
        self._told: list[tuple[tuple[int, ...], dict[str, object]]] = [((), {})] * env.num_envs
        self._still = np.clip(np.zeros(env.action_dim), *env.action_bounds)

    def begin(self, env_ids: Array) -> None:
        """These envs have just been reset."""
        with self._blame:
            self.skill.begin(env_ids)

    def act(self, env_ids: Array) -> Array:
        """The action (N, A); only the rows `env_ids` mean anything."""
        action = np.tile(self._still, (self.env.num_envs, 1))
        with self._blame:
            self.skill.act(env_ids, action)
        return action

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: the skill ended in these envs with a failure."""
        outcome = self.skill.outcome[env_ids]
        return (outcome != OUTCOMES.index(Outcome.RUNNING)) & (outcome != OUTCOMES.index(Outcome.OK))

    def describe(self, env: int) -> dict[str, object]:
        """What an env is doing, for records and tables."""
        try:
            moment = self.skill.moment(env)
            if not moment or moment != self._told[env][0]:  # it is asked in every step, and mostly says the same
                self._told[env] = moment, {"skill": self.name, **self.skill.describe(env)}
            return self._told[env][1]
        except BaseException as error:  # noqa: BLE001 - told with the key
            registry.blame(error, self._blame.who, self._blame.package)
