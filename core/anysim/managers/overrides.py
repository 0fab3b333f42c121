"""Counterfactuals: the values of a spec that may be set for one episode, and how a manager writes them.

A path is the dotted path of a value in the spec, as a user wrote it: `objects.cube.friction` (`world.` in front may be
left out). What is drawn through `anysim.randomization.draw.draw` needs no code of its own: where a path is overridden,
the draw gives that value instead, and no other draw moves. A manager lists such paths with `drawn`. What can change in
the middle of an episode it lists with `written`, and writes it in `Manager.override` the way its draws are written.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ValidationError

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.parameters import PARAMETERS
from anysim.errors import CapabilityError, TaskError, listing, suggest
from anysim.randomization.draw import is_random

WORLD = "world."


class Overridable(NamedTuple):
    """A value that may be overridden.

    Attributes:
        source: dotted path in the spec, with `world.` where it is there.
        holder: the part of the spec that the value belongs to, which also says what values there may be.
        key: its key in the holder.
        parameters: what an engine must be able to change for it.
        midway: whether it can change in the middle of an episode.
    """

    source: str
    holder: BaseModel
    key: str
    parameters: tuple[str, ...] = ()
    midway: bool = False

    @property
    def path(self) -> str:
        """As users write it."""
        return self.source.removeprefix(WORLD)


def drawn(source: str, holder: BaseModel, keys: Iterable[str]) -> list[Overridable]:
    """Keys of a part of the spec that are drawn at a reset alone, or constants that pass through `draw`."""
    return [Overridable(f"{source}.{key}", holder, key) for key in keys]


def random_fields(source: str, holder: BaseModel, keys: Iterable[str] | None = None) -> list[Overridable]:
    """Those keys of a part of the spec, or of all of them, that are drawn at a reset."""
    chosen = type(holder).model_fields if keys is None else keys
    return drawn(source, holder, [key for key in chosen if is_random(getattr(holder, key))])


def written(source: str, holder: BaseModel, parameters: Mapping[str, Sequence[str]]) -> list[Overridable]:
    """Keys of a part of the spec that are parameters of the engine, by the parameters that each writes."""
    return [Overridable(f"{source}.{key}", holder, key, tuple(names), True) for key, names in parameters.items()]


def built(engine: SimEngine, parameter: str, env_ids: Array, indices: Array) -> Array:
    """The values (E, K, ...) of a parameter that the World gives, for envs."""
    rows = engine.built_parameters(parameter)[indices]
    return np.broadcast_to(rows, (len(env_ids), *rows.shape))


def revert(engine: SimEngine, parameters: Iterable[str], env_ids: Array, indices: Mapping[str, Array]) -> None:
    """Give parameters their built values back; `indices` says where, by what a parameter belongs to."""
    for name in parameters:
        which = indices[PARAMETERS[name].target]
        if len(which):
            engine.set_parameters(name, built(engine, name, env_ids, which), env_ids, which)


class Overrides:
    """All that may be overridden in an env, and the checks of what a caller asks for."""

    def __init__(self, known: Iterable[Overridable], engine: SimEngine) -> None:
        self._engine = engine
        self.known = {entry.path: entry for entry in known}

    def checked(self, wanted: Any, count: int, midway: bool) -> list[dict[str, Any]]:
        """For each of `count` envs what is overridden, by path.

        Args:
            wanted: a mapping for all of them, or a sequence with one for each.
            midway: whether the episodes have begun.

        Raises:
            TaskError: an unknown path, or a value that the spec would not take; nothing was changed.
            CapabilityError: the engine cannot change it.
        """
        each = [wanted] * count if isinstance(wanted, Mapping) else list(wanted or [{}] * count)
        if len(each) != count or not all(isinstance(one, Mapping) for one in each):
            raise TaskError(
                f"overrides must be a mapping from paths to values, or a list of {count} of them, one for each env"
            )
        return [{self._path(str(p), midway): self._value(str(p), value) for p, value in one.items()} for one in each]

    def _path(self, path: str, midway: bool) -> str:
        path = path.removeprefix(WORLD)
        entry = self.known.get(path)
        if entry is None:
            raise TaskError(
                f"'{path}' cannot be overridden{suggest(path, list(self.known))} What can: "
                f"{listing(self.known, 40)}. What else a spec says is built into the world: make another env for it"
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
        entry = self.known[path.removeprefix(WORLD)]
        if isinstance(value, np.ndarray | np.generic):
            value = value.tolist()
        fields = {name: getattr(entry.holder, name) for name in entry.holder.model_fields_set} | {entry.key: value}
        try:
            taken = getattr(type(entry.holder).model_validate(fields), entry.key)
        except ValidationError as error:
            reasons = "; ".join(dict.fromkeys(e["msg"].removeprefix("Value error, ") for e in error.errors()))
            raise TaskError(f"'{entry.path}' cannot be {value!r}: {reasons}") from None
        if taken is None or is_random(taken):
            raise TaskError(f"'{entry.path}' can be overridden with one value, not with {value!r}")
        return taken
