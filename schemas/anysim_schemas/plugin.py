"""Slots in a spec whose content belongs to a plugin: engine options, term parameters, controller parameters.

The spec only marks the slot. Who loads a file passes a resolver that turns `(kind, name)` into the pydantic model the
plugin declares; the loader then validates the slot with it and reports its errors with the rest, by file and line.

There are two kinds of slots:
- a `dict[str, Any]` field annotated with `PluginSlot`: `engine.options`, `record.options`, `actions.*.params`,
  `source.params` of a procedural object;
- a spec with the class attribute `plugin_kind`, whose parameters stand beside its own fields: terms, skills, sensors.
  The name of the plugin is in the field `term`, or in the one that `plugin_name_field` names.

The kinds are engine, writer, controller, asset, observation, reward, predicate, command, event, skill and sensor.
A parameter of a term or skill may say `$name`: what that can be is checked where it is bound.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from pydantic import BaseModel


@dataclass(frozen=True)
class PluginSlot:
    """Marks a `dict[str, Any]` field as owned by the plugin `kind:<value of the sibling field name_field>`."""

    kind: str
    name_field: str


class UnknownPlugin(LookupError):
    """Raised by a resolver: the message says what was asked for, what exists and how to get it."""


OptionsResolver = Callable[[str, str], type[BaseModel] | None]
"""`resolver(kind, name)` returns the model of the options, None if it takes none, or raises UnknownPlugin."""

BOUND = re.compile(r"\$([a-zA-Z][a-zA-Z0-9_]*)")
"""A value that is bound for an episode, in a parameter of a command or term."""


def bound_names(value: object) -> Iterator[str]:
    """The names of the bound values in a parameter."""
    if isinstance(value, str):
        yield from BOUND.findall(value)
    elif isinstance(value, Mapping | list | tuple):
        held = cast("Mapping[str, object] | Sequence[object]", value)
        for item in held.values() if isinstance(held, Mapping) else held:
            yield from bound_names(item)
