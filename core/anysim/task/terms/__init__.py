"""The built-in library of terms. A name in YAML is a function here; its keyword-only arguments are its parameters.

Kinds, by the module they are in: observations `(scene) -> (n, k)`, rewards `(scene) -> (n,)`, predicates
`(scene) -> (n,) bool`, commands `(scene, draw) -> (n, 7)` goal poses, events `(scene, draw) -> None`. A term that
remembers something during an episode is a class, made with `(scene, *, parameters)`, whose instances are called.
"""

from collections.abc import Callable
from types import ModuleType
from typing import Any

from anysim.task.terms import commands, events, observations, predicates, rewards
from anysim.task.terms.combinations import PREDICATES


def _named(module: ModuleType) -> dict[str, Callable[..., Any]]:
    return {name: getattr(module, name) for name in module.__all__}


TERMS = {
    "observation": _named(observations),
    "reward": _named(rewards),
    "predicate": dict(sorted((_named(predicates) | PREDICATES).items())),
    "command": _named(commands),
    "event": _named(events),
}
"""A library of terms maps each kind to its functions by name, or to a module that lists them in `__all__`."""
