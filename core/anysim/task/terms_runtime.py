"""The task's terms, bound to a scene: commands, observations, rewards, success, failure, events."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial, reduce
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import AnysimError, SpecError, SpecIssue, TaskError
from anysim.managers.base import Overridable
from anysim.plugin_parameters import options_model
from anysim.randomization.draw import draw_rows, is_random
from anysim.randomization.streams import Streams
from anysim.task.bindings import Bindings, bind_term
from anysim.task.contract import Obs
from anysim.task.observation_noise import ObservedTerm
from anysim.task.scene import SceneView
from anysim.task.term_registry import find, goes_on
from anysim_schemas.task import EventTermSpec, TaskSpec

Term = Callable[..., Any]


class BoundTerm(NamedTuple):
    """A term at a key of the file. `blame` names it, and its distribution, where it raises."""

    call: Term
    blame: registry.Blame


def _values(terms: Sequence[BoundTerm]) -> list[Any]:
    """What the terms say now."""
    values: list[Any] = []
    with registry.Blames() as blames:  # one for all of them: entering one for each costs as much as the terms
        for call, blames.current in terms:
            values.append(call())
    return values


class Mdp:
    """Evaluates a TaskSpec on a SceneView. Its state: the goals, how long success has held, what terms remember."""

    def __init__(
        self,
        spec: TaskSpec,
        scene: SceneView,
        streams: Streams,
        located: Callable[[str], str] = str,
        bindings: Bindings | None = None,
    ) -> None:
        """`located` puts the place of its key before a dotted path."""
        self.spec, self.scene, self.streams = spec, scene, streams
        self.bindings = Bindings(None, scene.engine.num_envs, streams) if bindings is None else bindings
        scene.drawn = self.bindings.rows()
        n = scene.engine.num_envs
        widths = {name: goes_on("command", term) for name, term in spec.command.items()}
        for name, width in widths.items():
            scene.goals[name] = np.tile(np.array([0.0, 0, 0, 0, 0, 0, 1][: width or 7]), (n, 1))
        self.held = np.zeros(n, dtype=np.int64)
        """Consecutive control steps for which all success terms were true (N,)."""
        issues: list[SpecIssue] = []
        self._widths: dict[str, tuple[int, ...]] = {}
        """The components of each observation of a group, as they were at first."""

        def terms(kind: str, specs: Mapping[str, Any], section: str) -> dict[str, BoundTerm]:
            bound: dict[str, BoundTerm] = {}
            for name, term in specs.items():
                path = f"task.{section}.{name}"
                try:
                    call = bind_term(kind, term, scene, path, self.bindings)
                    who = f"{located(path)}: the term '{term.term}'"
                    bound[name] = BoundTerm(call, registry.Blame(who, registry.origin(call), prefix=True))
                except SpecError as error:
                    issues.extend(error.issues)
                except AnysimError as error:
                    issues.append(SpecIssue("", path, str(error)))
            return bound

        self._commands = terms("command", spec.command, "command")
        self._lasting = {name for name, width in widths.items() if width}
        rewards = terms("reward", spec.rewards, "rewards")
        success = terms("predicate", spec.success, "success").values()
        self._judged = [*success, *terms("predicate", spec.failure, "failure").values()]
        """Predicates of success, then those of failure."""
        self._conditions = len(success)
        """How many of them are of success."""
        self._worth = sum(term.reward for term in spec.success.values())
        """Of success, beside the rewards."""
        self._penalties = [term.reward for term in spec.failure.values()]
        self._ending = np.zeros(0)
        """What success and failure are worth (n,) in this step, as of the last `judge`."""
        events = terms("event", spec.events, "events")
        self._groups: dict[str, list[BoundTerm]] = {}
        for group, entries in spec.observations.items():
            bound = terms("observation", {str(i): t for i, t in enumerate(entries)}, f"observations.{group}")
            self._groups[group] = [term._replace(call=self._sensed(group, int(i), term)) for i, term in bound.items()]
        if issues:
            raise SpecError(issues)
        self._memories = tuple(scene.memories)
        self._rewards, self._weights = list(rewards.values()), [spec.rewards[name].weight for name in rewards]
        always = {name for name, event in spec.events.items() if goes_on("event", event) is not None}
        self._due = {
            when: {n: t for n, t in events.items() if spec.events[n].when == when or n in always}
            for when in ("reset", "step")
        }

    def _sensed(self, group: str, place: int, term: BoundTerm) -> Term:
        """The term with what its spec says of noise, bias and delay; the term itself where that is nothing."""
        entries = self.spec.observations[group]
        spec = entries[place]
        if not ObservedTerm.alters(spec):
            return term.call
        before = sum(entry.term == spec.term for entry in entries[:place])  # terms of one name are told apart by order
        name = f"task/observations.{group}/{spec.term}{f'~{before}' if before else ''}"
        return ObservedTerm(term.call, spec, name, f"task.observations.{group}.{place}", self.scene, self.streams)

    @property
    def _altered(self) -> list[ObservedTerm]:
        return [call for terms in self._groups.values() for call, _ in terms if isinstance(call, ObservedTerm)]

    def reset(self, env_ids: Array) -> None:
        """New bindings, reset events, then new goals; the scene must be looking at these rows."""
        self.held[env_ids] = 0
        for memory in self.scene.memories:
            memory.forget(env_ids)
        self.bindings.draw(env_ids)
        self._run_events("reset", 0)
        self._set_goals(self._commands, env_ids, 0)
        for term in self._altered:
            term.reset(env_ids)

    def _set_goals(self, names: Iterable[str], env_ids: Array, tick: Any) -> None:
        for name in names:
            term, goals = self._commands[name], self.scene.goals[name]
            with term.blame:
                goal = term.call(partial(self._draw, f"command/{name}", tick))
            _fit(term, goal, (len(env_ids), goals.shape[1]))
            goals[env_ids] = goal
        self.scene.moment += 1  # goals have moved

    def interval_events(self) -> None:
        """Events of the kind `when: step`, and goals that go on, for the rows at hand."""
        if self._lasting:
            self._set_goals(sorted(self._lasting), self.scene.env_ids, self.scene.elapsed[self.scene.rows])
        if self._due["step"]:
            self._run_events("step", self.scene.elapsed[self.scene.rows])
            self.scene.moment += 1  # whatever they moved is seen

    def _run_events(self, when: str, tick: Any) -> None:
        for name, term in self._due[when].items():
            with term.blame:
                term.call(partial(self._draw, f"event/{name}", tick))

    def _draw(self, stream: str, tick: Any, name: str, value: Any, where: Array | None = None) -> Array:
        """Draw for the rows at hand, or for those of them where `where` (n,) is true."""
        env_ids = self.scene.env_ids
        if where is not None:
            env_ids, tick = env_ids[where], np.broadcast_to(tick, len(env_ids))[where]
        section, _, term = stream.partition("/")
        source = f"task.{'events' if section == 'event' else section}.{term}.{name}"
        return draw_rows(value, f"task/{stream}/{name}", self.streams, env_ids, tick, source=source)

    def observe(self) -> Obs:
        """All groups for the rows at hand, float32 (n, D)."""
        return {group: self._observed(group, terms) for group, terms in self._groups.items()}

    def _observed(self, group: str, terms: Sequence[BoundTerm]) -> Array:
        values = _values(terms)
        try:
            rows = np.concatenate(values, axis=1, dtype=np.float32, casting="same_kind")
        except (TypeError, ValueError):
            self._fit_group(group, values)
            raise
        if rows.shape != (len(self.scene.env_ids), sum(self._widths.get(group, (-1,)))):
            self._fit_group(group, values)
        return rows

    def _fit_group(self, group: str, values: Sequence[Array]) -> None:
        """See that observations are rows of as many numbers as they were at first."""
        count = len(self.scene.env_ids)
        widths = self._widths.get(group) or tuple(np.shape(value)[-1] if np.ndim(value) == 2 else 1 for value in values)
        for term, value, width in zip(self._groups[group], values, widths, strict=True):
            _fit(term, value, (count, width))
        self._widths[group] = widths

    def reward(self, faulted: Array) -> Array:
        """The weighted sum of the reward terms for the rows at hand, float32 (n,); NaN for faulted envs.

        What the success and failure of the last `judge` are worth is in it.

        Raises:
            TaskError: a term is not finite for an env whose state is.
        """
        total = self._ending.copy() if len(self._ending) else np.zeros(len(faulted))
        for term, weight, value in zip(self._rewards, self._weights, _values(self._rewards), strict=True):
            _fit(term, value, total.shape)
            total += weight * value
        if not isfinite(np.vdot(total, total)):  # else all are finite
            wrong = np.flatnonzero(~(np.isfinite(total) | faulted))
            if len(wrong):
                raise TaskError(f"the reward of envs {wrong.tolist()} is not finite although their state is")
        if np.count_nonzero(faulted):
            total[faulted] = np.nan
        return total.astype(np.float32)

    def judge(self) -> tuple[Array, Array]:
        """(success, failure) (n,) bool for the rows at hand; counts how long success has held."""
        rows = self.scene.rows
        held = self.held[rows]
        values = _values(self._judged)
        for term, value in zip(self._judged, values, strict=True):
            _fit(term, value, held.shape, "truth values")
        success, failures = values[: self._conditions], values[self._conditions :]
        self.held[rows] = held = (held + 1) * _combined(np.logical_and, success, held.shape)
        succeeded = held >= self.spec.hold
        if self._worth or any(self._penalties):
            self._ending = self._worth * succeeded
            for worth, failure in zip(self._penalties, failures, strict=True):
                self._ending = self._ending + worth * failure
        return succeeded, _combined(np.logical_or, failures, held.shape)

    def overridable(self) -> list[Overridable]:
        """The parameters of commands and events that are drawn; those of events in steps may change midway."""
        entries: list[Overridable] = []
        for kind, section, terms in (("command", "command", self.spec.command), ("event", "events", self.spec.events)):
            for name, term in terms.items():
                midway = isinstance(term, EventTermSpec) and term.when == "step"
                params = self.bindings.variants(term.params, f"task.{section}.{name}").params[0]
                values = options_model(find(kind, term.term)).model_validate(params)
                entries += [
                    Overridable(f"task.{section}.{name}.{key}", values, key, midway=midway)
                    for key in type(values).model_fields
                    if is_random(getattr(values, key))
                ]
        return entries

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the goals and counters."""
        data = {"held": self.held[env_ids]} | {f"goal.{name}": g[env_ids] for name, g in self.scene.goals.items()}
        data |= self.bindings.snapshot(env_ids)
        for number, memory in enumerate(self._memories):
            data |= {f"memory.{number}": memory.values[env_ids], f"memory.{number}.seen": memory.seen[env_ids]}
        for term in self._altered:
            data |= term.snapshot(env_ids)
        return data

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        """Raise SnapshotError for values that no env can have."""
        refuse_range("held", data["held"], 0, self.spec.horizon)
        self.bindings.refuse_rows(data)
        for number in range(len(self._memories)):
            refuse_range(f"memory.{number}.seen", data[f"memory.{number}.seen"], -1, self.spec.horizon)
        for term in self._altered:
            term.refuse_rows(data)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        self.held[env_ids] = data["held"]
        self.bindings.restore(env_ids, data)
        for number, memory in enumerate(self._memories):
            memory.values[env_ids] = data[f"memory.{number}"]
            memory.seen[env_ids] = data[f"memory.{number}.seen"]
        for name, goal in self.scene.goals.items():
            goal[env_ids] = data[f"goal.{name}"]
        self.scene.moment += 1
        for term in self._altered:
            term.restore(env_ids, data)


def _combined(both: np.ufunc, values: Sequence[Array], shape: tuple[int, ...]) -> Array:
    """What predicates say together (n,) bool; false where there are none."""
    return reduce(both, values) if values else np.zeros(shape, dtype=bool)


def _fit(term: BoundTerm, value: Any, shape: tuple[int, ...], what: str = "numbers") -> None:
    """See that a term returned an array of a shape, of numbers or truth values.

    Raises:
        TaskError: it did not; names the key, the term and its distribution.
    """
    right = "biuf" if what == "numbers" else "b"
    if isinstance(value, np.ndarray) and value.shape == shape and value.dtype.kind in right:
        return
    if isinstance(value, np.ndarray | np.generic):
        found = f"an array of shape {value.shape} of {value.dtype}"
    else:
        found = "None" if value is None else f"a {type(value).__name__}"
    who, package = term.blame.who, term.blame.package
    raise TaskError(f"{who} of {package} returned {found}; expected an array of shape {shape} of {what}")
