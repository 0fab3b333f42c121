"""SkillPolicy: the task's expert, or an episode's commands, as a policy over all envs, each on its own timeline."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import AnysimError, SpecError, SpecIssue, TaskError
from anysim.planning.service import PlannerService
from anysim.plugin_parameters import checked, given, options_model, parameters, reference_kind
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.commands import CommandSequence
from anysim.skills.phases import MovingSkill
from anysim.task.env import TaskEnv
from anysim.task.term_registry import resolve


def bind_skill(name: str, params: Mapping[str, Any], env: TaskEnv, path: str) -> Skill:
    """The skill with its parameters checked and names resolved; `path` is the key of the file that asks for it.

    A relative `Path` is one from the folder of that file, which it must not leave. A SpecError that a skill raises is
    told at `path.<its key>`.

    Raises:
        SpecError: at `path.<parameter>`, a name that does not exist in this world, or a path that leaves its folder.
    """
    skill_class: type[Skill] = registry.load("skills", name)
    values = checked(options_model(skill_class), params, path)
    keywords: dict[str, Any] = {}
    for key, parameter in parameters(skill_class).items():
        value, view = getattr(values, key), given(parameter.annotation)
        if reference_kind(view) is not None:
            try:
                value = resolve(view, value, env.scene)
            except AnysimError as error:
                raise SpecError([SpecIssue("", f"{path}.{key}", str(error))]) from None
        keywords[key] = _from_file(env, f"{path}.{key}", value) if isinstance(value, Path) else value
    try:
        return skill_class(env, **keywords)
    except SpecError as error:
        keys = [(f"{path}.{issue.path}", issue.message) for issue in error.issues]
        raise SpecError([SpecIssue(_place(env, key), key, words) for key, words in keys]) from None
    except BaseException as error:  # noqa: BLE001 - told with the key
        registry.blame(error, f"{env.located(path)}: the skill '{name}'", registry.origin(skill_class), prefix=True)


def _from_file(env: TaskEnv, key: str, path: Path) -> Path:
    """A path as seen from the file that `key` was written in; from here where that was none."""
    file = Path(_place(env, key).rsplit(":", 2)[0])
    folder = (file.parent if file.is_file() else Path.cwd()).resolve()
    if path.is_absolute() or (folder / path).resolve().is_relative_to(folder):
        return folder / path
    raise SpecError([SpecIssue(_place(env, key), key, f"'{path}' leaves {folder}; give an absolute path")])


def _place(env: TaskEnv, key: str) -> str:
    return env.located(key).removesuffix(key).removesuffix(": ")


def bind_expert(env: TaskEnv) -> tuple[str, Skill]:
    """What solves the task, with its name: the commands of `collect`, or else the task's expert.

    Raises:
        TaskError: there is neither.
        SpecError: as of `bind_skill`, or a skill that cannot be one of several commands.
    """
    task, collect = env.spec.task, env.spec.collect
    if collect is not None:
        return "commands", CommandSequence(collect, env, bind_skill)
    if task is None or task.expert is None:
        raise TaskError(f"task '{env.name}' has no expert; add task.expert, or drive the env with a policy of your own")
    return task.expert.skill, bind_skill(task.expert.skill, task.expert.params, env, "task.expert")


SETTLE = 100
"""Control steps in which a scene may come to rest after a skill has succeeded."""
_OK = OUTCOMES.index(Outcome.OK)


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
        self._done = np.zeros(env.num_envs, dtype=np.int64)
        """Control steps since the skill has succeeded, by env."""
        self._settle = SETTLE + (0 if env.spec.task is None else env.spec.task.hold)
        self._still = np.clip(np.zeros(env.action_dim), *env.action_bounds)

    def begin(self, env_ids: Array) -> None:
        """These envs have just been reset."""
        self._done[env_ids] = 0
        with self._blame:
            self.skill.begin(env_ids)

    def act(self, env_ids: Array) -> Array:
        """The action (N, A); only the rows `env_ids` mean anything."""
        action = np.tile(self._still, (self.env.num_envs, 1))
        with self._blame:
            self.skill.act(env_ids, action)
        self._done[env_ids] += self.skill.outcome[env_ids] == _OK
        return action

    def _unsolved(self, env_ids: Array) -> Array:
        """(n,) bool: the skill succeeded in these envs, and the task's success does not come to hold."""
        late = self._done[env_ids] > self._settle
        return late & ~self.env.info["is_success"][env_ids] if late.any() else late

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: the skill ended in these envs with a failure.

        Or it succeeded more than SETTLE control steps ago, and the task's success does not hold: that is told as
        `adverse_state`.
        """
        outcome = self.skill.outcome[env_ids]
        return (outcome != OUTCOMES.index(Outcome.RUNNING)) & (outcome != _OK) | self._unsolved(env_ids)

    def solved(self, env_ids: Array) -> Array:
        """(n,) bool: the commands of `collect` are all done in these envs, and the task's success holds."""
        if not isinstance(self.skill, CommandSequence):
            return np.zeros(len(env_ids), dtype=bool)
        return (self.skill.outcome[env_ids] == _OK) & self.env.info["is_success"][env_ids]

    def ended(self, env: int, success: bool) -> dict[str, object]:
        """What is to be said of an env whose episode has ended."""
        said = self.describe(env)
        if not success and self._unsolved(np.array([env])).any():
            said = said | {"outcome": str(Outcome.ADVERSE_STATE)}
        return (
            said | {"segments": self.skill.segments(env, success)} if isinstance(self.skill, CommandSequence) else said
        )

    @property
    def planners(self) -> tuple[PlannerService, ...]:
        """The services that plan the skill's moves, each once; what they have counted is of all envs."""
        movers = self.skill.movers if isinstance(self.skill, MovingSkill) else ()
        return tuple(dict.fromkeys(service for mover in movers for service in mover.planners))

    def describe(self, env: int) -> dict[str, object]:
        """What an env is doing, for records and tables."""
        try:
            moment = self.skill.moment(env)
            if not moment or moment != self._told[env][0]:  # it is asked in every step, and mostly says the same
                self._told[env] = moment, {"skill": self.name, **self.skill.describe(env)}
            return self._told[env][1]
        except BaseException as error:  # noqa: BLE001 - told with the key
            registry.blame(error, self._blame.who, self._blame.package)
