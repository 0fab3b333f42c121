"""The commands of an episode: in order, with values drawn for it, choices, repetitions, guards and segments."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import SpecError, SpecIssue
from anysim.registry import Blame, origin
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.skills.phases import GO_ON, STAY, MovingSkill
from anysim.skills.sequence import SkillSequence
from anysim.task.bindings import Bindings, bind_term
from anysim.task.env import TaskEnv
from anysim_schemas.collect import MOST_COMMANDS, ChooseSpec, CollectSpec, CommandSpec, RepeatSpec
from anysim_schemas.task import PredicateTermSpec

Holds = Callable[[Array], Array]
"""Whether something is so in envs (n,) that the scene looks at: (n,) bool."""
BindSkill = Callable[[str, Mapping[str, Any], TaskEnv, str], Skill]


class Guard(NamedTuple):
    """On the way into a command: where `passes` does not hold the env goes on with the command number `otherwise`."""

    passes: Holds
    otherwise: int


class Segment(NamedTuple):
    """What one verified command did: control steps `first_step` to `last_step` of an episode's recording."""

    segment: int
    command: int
    skill: str
    attempt: int
    first_step: int
    last_step: int


class DrawnSkill(MovingSkill):
    """A skill whose parameters are drawn: one for each value that they can have, and each env is in its own."""

    def __init__(self, env: TaskEnv, variants: Sequence[MovingSkill], which: Callable[[Array], Array]) -> None:
        """`which` says of envs (n,) the numbers (n,) of their variants."""
        super().__init__(env)
        self.variants, self._which = variants, which
        self.phases = variants[0].phases
        self.movers = tuple(dict.fromkeys(mover for one in variants for mover in one.movers))

    def start(self, env_ids: Array) -> None:
        for one, here in self._each(env_ids):
            one.start(env_ids[here])
        self._tell(env_ids)

    def decide(self, ids: Array, at: Array) -> None:
        for one, here in self._each(ids):
            one.decide(ids[here], at[here])
        self._tell(ids)

    def foresee(self, following: MovingSkill) -> None:
        for one in self.variants:
            one.foresee(following)

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        parts = [(here, one.wanted(ids[here], at[here], grasps[here])) for one, here in self._each(ids)]
        poses = np.zeros((*grasps.shape[:2], *parts[0][1].shape[2:]))
        for here, part in parts:
            poses[here] = part
        return poses

    def _each(self, ids: Array) -> list[tuple[MovingSkill, Array]]:
        number = self._which(ids)
        return [(self.variants[k], number == k) for k in np.unique(number)]

    def _tell(self, ids: Array) -> None:
        for one, here in self._each(ids):
            own = ids[here]
            self.phase[own], self.outcome[own], self.attempts[own] = one.phase[own], one.outcome[own], one.attempts[own]

    def _own(self, env: int) -> MovingSkill:
        return self.variants[int(self._which(np.array([env]))[0])]

    def history(self, env: int) -> tuple[tuple[str, str], ...]:
        return self._own(env).history(env)

    def moment(self, env: int) -> tuple[int, ...]:
        return self._own(env).moment(env)

    def about(self, env: int) -> dict[str, object]:
        return self._own(env).about(env)

    def describe(self, env: int) -> dict[str, object]:
        return self._own(env).describe(env)


class CommandSequence(SkillSequence):
    """The commands of `collect`, one after the other in each env."""

    def __init__(self, collect: CollectSpec, env: TaskEnv, bind: BindSkill, path: str = "collect.commands") -> None:
        """`bind` makes a skill by name; `path` is where the commands were written.

        Raises:
            SpecError: at the key, what is wrong with a command.
        """
        self._env, self._bind = env, bind
        self._specs: list[CommandSpec] = []
        self._guards: list[list[Guard]] = []
        self._verify: list[Holds | None] = []
        self._made: dict[str, MovingSkill] = {}
        skills: list[MovingSkill] = []
        self._lay(collect.commands, path, skills)
        self._look_ahead(skills)
        names = [f"{number} {spec.do}" for number, spec in enumerate(self._specs, 1)]
        dt = env.engine.world.physics.control_dt
        limits = {
            name: max(1, round(spec.timeout / dt))
            for name, spec in zip(names, self._specs, strict=True)
            if spec.timeout is not None
        }
        goes_on = collect.on_fail != "stop"
        optional = [name for name, spec in zip(names, self._specs, strict=True) if goes_on or not spec.required]
        super().__init__(env, dict(zip(names, skills, strict=True)), optional=optional, limits=limits)
        self._counts = [collect.on_fail == "continue" and spec.required for spec in self._specs]
        """Whether a command that fails makes the episode fail at its end."""
        self._failed = np.full(env.num_envs, GO_ON)
        self._first_step = np.zeros(env.num_envs, dtype=np.int64)
        self._segments: list[tuple[Segment, ...]] = [()] * env.num_envs

    # ------------------------------------------------------------------ from the file

    def _lay(self, entries: Any, path: str, skills: list[MovingSkill]) -> None:
        """Write commands out in a row, with guards where it forks."""
        if not isinstance(entries, tuple):
            self._lay_one(entries, path, skills)
            return
        for number, entry in enumerate(entries):
            self._lay_one(entry, f"{path}.{number}", skills)

    def _lay_one(self, entry: Any, path: str, skills: list[MovingSkill]) -> None:
        first = len(skills)
        if isinstance(entry, ChooseSpec):
            for number, branch in enumerate(entry.choose):
                begun = len(skills)
                self._lay(branch, f"{path}.choose.{number}", skills)
                self._guard(begun, partial(_drawn, self._env.bindings, path, number), len(skills))
        elif isinstance(entry, RepeatSpec):
            times: list[int] = []
            for _ in range(entry.repeat):
                times.append(len(skills))
                self._lay(entry.body, f"{path}.body", skills)
            if entry.until is not None:
                until = self._predicate(entry.until, f"{path}.until")
                for time in times:
                    self._guard(time, partial(_not, until), len(skills))
        else:
            if len(skills) == MOST_COMMANDS:
                words = f"an episode has at most {MOST_COMMANDS} commands, repetitions and branches counted"
                raise SpecError([SpecIssue("", path, words)])
            skills.append(self._skill(entry, path))
            self._specs.append(entry)
            self._guards.append([])
            self._verify.append(None if entry.success is None else self._predicate(entry.success, f"{path}.success"))
            if entry.if_ is not None:
                self._guard(first, self._predicate(entry.if_, f"{path}.if"), first + 1)

    def _guard(self, number: int, passes: Holds, otherwise: int) -> None:
        if number < otherwise:  # what stands further out is looked at first
            self._guards[number].insert(0, Guard(passes, otherwise))

    def _skill(self, spec: CommandSpec, path: str) -> MovingSkill:
        if path not in self._made:  # a repeated command is one skill that starts again
            variants = self._env.bindings.variants(spec.params, path)
            made = [_moving(self._bind(spec.do, params, self._env, path), spec.do, path) for params in variants.params]
            which = partial(self._env.bindings.which, variants.names)
            self._made[path] = made[0] if len(made) == 1 else DrawnSkill(self._env, made, which)
        return self._made[path]

    def _look_ahead(self, skills: Sequence[MovingSkill]) -> None:
        """Tell commands which one comes next, where that is always the same one."""
        following: dict[MovingSkill, set[MovingSkill | None]] = {}
        for (skill, after), guards in zip(pairwise(skills), self._guards[1:], strict=True):
            following.setdefault(skill, set()).add(None if guards else after)
        for skill, (after, *others) in following.items():
            if after is not None and not others:
                skill.foresee(after)

    def _predicate(self, spec: PredicateTermSpec, path: str) -> Holds:
        scene = self._env.scene
        call = bind_term("predicate", spec, scene, path, self._env.bindings)
        blame = Blame(f"{self._env.located(path)}: the term '{spec.term}'", origin(call), prefix=True)

        def holds(ids: Array) -> Array:
            with blame:
                return np.asarray(call())[np.searchsorted(scene.env_ids, ids)]

        return holds

    # ------------------------------------------------------------------ in the episode

    def start(self, env_ids: Array) -> None:
        if any(self._guards):
            self._env.scene.look(env_ids)
        for env in env_ids.tolist():
            self._segments[env] = ()
        self._failed[env_ids] = GO_ON
        super().start(env_ids)

    def _go(self, ids: Array, number: int) -> None:
        """Begin with the first command from here on whose guards let an env in."""
        here = np.full(len(ids), number)
        for k in range(number, len(self._guards)):
            for guard in self._guards[k]:
                at = np.flatnonzero(here == k)
                if len(at):
                    here[at[~guard.passes(ids[at])]] = guard.otherwise
        self._first_step[ids] = self._env.scene.elapsed[ids] + 1
        for k in np.unique(here).tolist():
            super()._go(ids[here == k], k)
        over = ids[here == len(self._guards)]
        self.outcome[over] = self._failed[over]

    def _end(self, number: int, ids: Array) -> None:
        member, verify = self.members[number], self._verify[number]
        if verify is not None and len(said := ids[member.outcome[ids] == GO_ON]):
            member.outcome[said[~verify(said)]] = _LOST
        for env in ids.tolist():
            if member.outcome[env] == GO_ON:
                self._keep(number, env)
            elif self._counts[number] and self._failed[env] == GO_ON:
                self._failed[env] = member.outcome[env]
        super()._end(number, ids)

    def _keep(self, number: int, env: int) -> None:
        last = int(self._env.scene.elapsed[env])
        if self._specs[number].save and last >= self._first_step[env]:
            before, attempt = self._segments[env], int(self.members[number].attempts[env])
            what = Segment(len(before), number + 1, self._specs[number].do, attempt, int(self._first_step[env]), last)
            self._segments[env] = (*before, what)

    def segments(self, env: int, success: bool) -> list[dict[str, object]]:
        """What was verified in an episode that has ended; the command under way too where the task was solved."""
        if success and self.outcome[env] == STAY:
            self._keep(int(self.phase[env]), env)
        return [segment._asdict() for segment in self._segments[env]]

    def describe(self, env: int) -> dict[str, object]:
        number = int(self.phase[env])
        return super().describe(env) | {"command": number + 1, "segment": len(self._segments[env])}


def _moving(skill: Skill, name: str, path: str) -> MovingSkill:
    if isinstance(skill, MovingSkill):
        return skill
    words = (
        f"the skill '{name}' drives the robot by itself and can only be a task's expert; one that is "
        "derived from anysim.skills.phases.MovingSkill can be a command"
    )
    raise SpecError([SpecIssue("", f"{path}.do", words)])


def _drawn(bindings: Bindings, path: str, number: int, ids: Array) -> Array:
    return bindings.index[path][ids] == number


def _not(holds: Holds, ids: Array) -> Array:
    return ~holds(ids)


_LOST = OUTCOMES.index(Outcome.LOST)
