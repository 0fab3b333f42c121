"""Counterfactuals: the same episode with one factor changed, and every other draw as it was."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import CapabilityError, TaskError, listing, suggest
from anysim.managers.base import WORLD, Manager
from anysim.math.arrays import shown
from anysim.randomization.draw import is_random
from anysim.randomization.streams import Streams
from anysim.task.terms_runtime import Mdp

Plan = Sequence[Mapping[str, Any]]
"""For each of some envs the overridden values, by path."""


class Counterfactuals:
    """What may be overridden in an env, and when it is written, marked and taken back."""

    def __init__(self, managers: Sequence[Manager], mdp: Mdp, engine: SimEngine, streams: Streams) -> None:
        owned = [(entry, manager) for manager in managers for entry in manager.overridable()]
        self._owners = {entry.path: manager for entry, manager in owned}
        self.paths = {entry.path: entry for entry in (*(entry for entry, _ in owned), *mdp.overridable())}
        """All that may be overridden, by path."""
        self._engine, self._streams = engine, streams

    def checked(self, wanted: Any, count: int, midway: bool) -> Plan:
        """For each of `count` envs what is overridden, by path.

        Args:
            wanted: a mapping for all of them, or a sequence with one for each.
            midway: whether the episodes have begun.

        Raises:
            TaskError: an unknown path, or a value that the spec would not take; nothing was changed.
            CapabilityError: the engine cannot change it.
        """
        wanted = {} if wanted is None or (isinstance(wanted, list | tuple) and not wanted) else wanted
        each = [wanted] * count if isinstance(wanted, Mapping) else wanted
        listed = isinstance(each, list | tuple) and len(each) == count
        if not listed or not all(isinstance(one, Mapping) for one in each):
            raise TaskError(
                f"overrides must be a mapping from paths to values, or a list of {count} of them, one for each env"
            )
        return [{self._path(str(p), midway): self._value(str(p), value) for p, value in one.items()} for one in each]

    def _path(self, path: str, midway: bool) -> str:
        path = path.removeprefix(WORLD)
        entry = self.paths.get(path)
        if entry is None:
            raise TaskError(
                f"'{path}' cannot be overridden{suggest(path, list(self.paths)) or '.'} What can: "
                f"{listing(self.paths, 40)}. What else a spec says is built into the world: make another env for it"
            )
        if midway and not entry.midway:
            raise TaskError(
                f"'{path}' is settled when an episode begins and cannot change in the middle of one; begin the same "
                f"episode again with it: env.reset(episode_seeds=..., overrides=...)"
            )
        lacking = [name for name in entry.parameters if name not in self._engine.parameters]
        if lacking:
            raise CapabilityError(f"'{path}' cannot be overridden: {self._engine.name} cannot change '{lacking[0]}'")
        return path

    def _value(self, path: str, value: Any) -> Any:
        entry = self.paths[path.removeprefix(WORLD)]
        if isinstance(value, np.ndarray | np.generic):
            value = value.tolist()
        fields = {name: getattr(entry.holder, name) for name in entry.holder.model_fields_set} | {entry.key: value}
        try:
            taken = getattr(type(entry.holder).model_validate(fields), entry.key)
        except ValidationError as error:
            reasons = "; ".join(dict.fromkeys(e["msg"].removeprefix("Value error, ") for e in error.errors()))
            raise TaskError(f"'{entry.path}' cannot be {shown(value)}: {reasons}") from None
        if taken is None or is_random(taken):
            raise TaskError(f"'{entry.path}' can be overridden with one value, not with {shown(value)}")
        return taken

    def refuse_restored(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Refuse overrides (of each env, by path in the spec) that come from a file and that no episode here can have.

        Raises:
            TaskError: an unknown path, or a value that the spec would not take.
        """
        for values in rows:
            for source, value in values.items():
                path = self._path(source, midway=False)
                if self.paths[path].source != source:
                    raise TaskError(f"'{source}' cannot be overridden; '{self.paths[path].source}' can")
                self._value(path, value)

    def over(self, env_ids: Array) -> None:
        """The episodes of these envs are over: what no reset writes anew is as the spec says again."""
        for env in env_ids:
            for source in self._streams.overridden[env]:
                path = source.removeprefix(WORLD)
                if self.paths[path].midway and path in self._owners:
                    self._owners[path].revert(path, np.array([env]))

    def begin(self, env_ids: Array, plan: Plan) -> None:
        """Episodes have begun: from here on draws give the overridden values."""
        for env, values in zip(env_ids, plan, strict=True):
            for path, value in values.items():
                self._streams.override(int(env), self.paths[path].source, value)

    def settle(self, env_ids: Array, plan: Plan) -> None:
        """The managers have reset: write what none of them draws."""
        for env, values in zip(env_ids, plan, strict=True):
            for path, value in values.items():
                source = self.paths[path].source
                drawn = any(origin.source == source for origin in self._streams.origins[env].values())
                if not drawn and self.paths[path].midway and path in self._owners:
                    self._owners[path].override(path, value, np.array([env]))

    def mark(self, env_ids: Array, plan: Plan) -> None:
        """All has been drawn that is drawn at a reset: mark every override among the draws."""
        for env, values in zip(env_ids, plan, strict=True):
            for path in values:
                self._streams.note_override(int(env), self.paths[path].source)

    def change(self, env_ids: Array, plan: Plan) -> None:
        """Write values in the middle of episodes."""
        for env, values in zip(env_ids, plan, strict=True):
            for path, value in values.items():
                self._streams.override(int(env), self.paths[path].source, value)
                if path in self._owners:
                    self._owners[path].override(path, value, np.array([env]))
                self._streams.note_override(int(env), self.paths[path].source)
