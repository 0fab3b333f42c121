"""The built-in library of terms. A name in YAML is a function here; its keyword-only arguments are its parameters.

Kinds, by the module they are in: observations `(scene) -> (n, k)`, rewards `(scene) -> (n,)`, predicates
`(scene) -> (n,) bool`, commands `(scene, draw) -> (n, 7)` goal poses, events `(scene, draw) -> None`. A term that
remembers something during an episode is a class, made with `(scene, *, parameters)`, whose instances are called.
"""

import re
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

from anysim.task.terms import combinations, commands, events, observations, predicates, rewards


def _named(*modules: ModuleType) -> dict[str, Callable[..., Any]]:
    """The public functions and classes that these modules define, by name; `GoalPath` is `goal_path`."""
    found = {
        re.sub(r"(?<=.)(?=[A-Z])", "_", name).lower().removesuffix("_"): value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, type | FunctionType) and value.__module__ == module.__name__ and name[0] != "_"
    }
    return dict(sorted(found.items()))


TERMS = {
    "observation": _named(observations),
    "reward": _named(rewards),
    "predicate": _named(predicates, combinations),
    "command": _named(commands),
    "event": _named(events),
}
"""A library of terms maps each kind to its functions by name, or to a module that lists them in `__all__`."""
