"""SkillPolicy: the task's expert, or an episode's commands, as a policy over all envs, each on its own timeline."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import AnysimError, SpecError, SpecIssue, TaskError
from anysim.plugin_parameters import options_model, parameters, reference_kind
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.phases import MovingSkill
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.term_registry import resolve
from anysim_schemas.collect import CollectSpec


def bind_skill(name: str, params: Mapping[str, Any], env: TaskEnv, path: str) -> Skill:
    """The skill with its parameters checked and names resolved; `path` is the key of the file that asks for it.

    Raises:
        SpecError: at `path.<parameter>`, a name that does not exist in this world.
    """
    skill_class: type[Skill] = registry.load("skills", name)
    values = options_model(skill_class).model_validate(dict(params))
    keywords: dict[str, Any] = {}
    for key, parameter in parameters(skill_class).items():
        value, handle = getattr(values, key), reference_kind(parameter.annotation)
        if handle is not None:
            try:
                value = resolve(handle, value, env.scene)
            except AnysimError as error:
                raise SpecError([SpecIssue("", f"{path}.{key}", str(error))]) from None
        keywords[key] = value
    try:
        return skill_class(env, **keywords)
    except BaseException as error:  # noqa: BLE001 - told with the key
        registry.blame(error, f"{env.located(path)}: the skill '{name}'", registry.origin(skill_class))


def bind_expert(env: TaskEnv) -> tuple[str, Skill]:
    """What solves the task, with its name: the commands of `collect`, or else the task's expert.

    Raises:
        TaskError: there is neither.
        SpecError: as of `bind_skill`, or a skill that cannot be one of several commands.
    """
    task, collect = env.spec.task, env.spec.collect
    if collect is not None:
        return "commands", _bind_commands(collect, env)
    if task is None or task.expert is None:
        raise TaskError(f"task '{env.name}' has no expert; add task.expert, or drive the env with a policy of your own")
    return task.expert.skill, bind_skill(task.expert.skill, task.expert.params, env, "task.expert")


def _bind_commands(collect: CollectSpec, env: TaskEnv) -> SkillSequence:
    members: dict[str, MovingSkill] = {}
    optional: list[str] = []
    limits: dict[str, int] = {}
    for number, command in enumerate(collect.commands):
        path = f"collect.commands.{number}"
        skill = bind_skill(command.do, command.params, env, path)
        if not isinstance(skill, MovingSkill):
            words = (
                f"the skill '{command.do}' drives the robot by itself and can only be a task's expert; one that is "
                "derived from anysim.skills.phases.MovingSkill can be a command"
            )
            raise SpecError([SpecIssue("", f"{path}.do", words)])
        name = f"{number + 1} {command.do}"
        members[name] = skill
        if not command.required:
            optional.append(name)
        if command.timeout is not None:
            limits[name] = max(1, round(command.timeout / env.engine.world.physics.control_dt))
    return SkillSequence(env, members, optional=optional, limits=limits)


class SkillPolicy:
    """Acts in the envs it is asked for; an env whose skill has given up stays still."""

    def __init__(self, env: TaskEnv) -> None:
        self.env = env
        self.name, self.skill = bind_expert(env)
        path = "task.expert" if env.spec.collect is None else "collect.commands"
        self._blame = registry.Blame(
            f"{env.located(path)}: the skill '{self.name}'", registry.origin(self.skill), prefix=True
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
