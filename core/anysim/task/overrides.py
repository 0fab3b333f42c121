"""Counterfactuals: the same episode with one factor changed, and every other draw as it was."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.managers.overrides import WORLD, Overridable, Overrides
from anysim.randomization.streams import Streams
from anysim.task.terms_runtime import Mdp

Plan = Sequence[Mapping[str, Any]]
"""For each of some envs the overridden values, by path."""


class Counterfactuals:
    """What may be overridden in an env, and when it is written, marked and taken back."""

    def __init__(self, managers: Sequence[Manager], mdp: Mdp, engine: SimEngine, streams: Streams) -> None:
        owned = [(entry, manager) for manager in managers for entry in manager.overridable()]
        self._owners = {entry.path: manager for entry, manager in owned}
        self._known = Overrides([*(entry for entry, _ in owned), *mdp.overridable()], engine)
        self._streams = streams

    @property
    def paths(self) -> dict[str, Overridable]:
        """All that may be overridden, by path."""
        return self._known.known

    def checked(self, overrides: Any, count: int, midway: bool) -> Plan:
        """See `Overrides.checked`."""
        return self._known.checked(overrides, count, midway)

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
