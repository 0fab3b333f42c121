"""The reference of the built-in terms, from their signatures, into docs/terms.md.

    python scripts/term_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import inspect
import re
import sys
from collections.abc import Callable, Collection
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from generated import main
from pydantic.fields import FieldInfo

from anysim.plugin_parameters import given, parameters, reference_kind
from anysim.task.references import Conditions
from anysim.task.terms import TERMS
from anysim_tasks.terms import TERMS as OF_TASKS

TITLES = {
    "observation": "Observations: `(n, k)`",
    "reward": "Rewards: `(n,)`",
    "predicate": "Predicates of success and failure: `(n,)` bool",
    "command": "Commands: goal poses `(n, 7)`",
    "event": "Events",
}


def typed(annotation: Any) -> tuple[str, str]:
    """What a parameter is written as in YAML, and what its annotation says about it."""
    said, metadata = "", getattr(annotation, "__metadata__", ())
    for extra in metadata:
        if isinstance(extra, FieldInfo):
            bounds = [f"{SIGNS[type(b).__name__]} {next(iter(vars_of(b).values()))}" for b in extra.metadata]
            said = ", ".join([*bounds, *([extra.description] if extra.description else [])])
    optional = given(annotation)
    if optional is not annotation:
        return typed(optional)
    bare = get_args(annotation)[0] if metadata else annotation
    if (kind := reference_kind(bare)) == Conditions.reference_kind:
        return "predicates by name", said
    if kind:
        return f"name of {'an' if kind[0] in 'aeiou' else 'a'} {kind}", said
    return spelled(bare), said


SIGNS = {"Gt": ">", "Ge": "≥", "Lt": "<", "Le": "≤", "MinLen": "at least", "MaxLen": "at most"}


def vars_of(bound: Any) -> dict[str, Any]:
    """The fields of one of pydantic's bounds."""
    return {name: getattr(bound, name) for name in bound.__slots__}


def spelled(annotation: Any) -> str:
    """A type in the words of a YAML file."""
    text = annotation.__name__ if isinstance(annotation, type) and get_origin(annotation) is None else str(annotation)
    if get_origin(annotation) is not None and str(annotation).startswith("typing.Literal"):
        return " or ".join(f"`{value}`" for value in get_args(annotation))
    if "Range" in text or "Choice" in text:
        return "3 values, each may be drawn" if "tuple" in text else "a value, may be drawn"
    if get_origin(annotation) in (Union, UnionType) and NoneType not in get_args(annotation):
        return " or ".join(", ".join(filter(None, typed(part))) for part in get_args(annotation))
    if text.startswith("collections.abc.Sequence[tuple["):
        return "points"
    if text.removesuffix(" | None") == "tuple[str, ...]":
        return "words"
    if text.startswith("tuple["):
        return f"{len(get_args(annotation))} numbers"
    words = {"float": "number", "int": "whole number", "str": "word", "bool": "true or false"}
    text = text.removesuffix(" | None")
    return words.get(text, re.sub(r"[\w.]+\.(\w+)", r"\1", text))


def described(key: str, parameter: inspect.Parameter) -> str:
    """One parameter: its name, type, unit and default."""
    kind, said = typed(parameter.annotation)
    words = [kind, *([said] if said else [])]
    if kind == "name of a robot":
        words.append("may be left out where there is one")
    if parameter.default is not inspect.Parameter.empty:
        words.append("may be left out" if parameter.default is None else f"default {parameter.default!r}")
    return f"`{key}`: {', '.join(words)}"


def row(name: str, function: Callable[..., Any], only_named: Collection[str] = ()) -> str:
    """One term or skill as a row of a table, some of whose parameters are described elsewhere."""
    given = [described(key, parameter) for key, parameter in parameters(function).items()]
    what = " ".join((function.__doc__ or "").split("\n\n")[0].split())
    named = ", ".join(words.partition(":")[0] for words in given if words in only_named)
    lines = [*([named] if named else []), *(words for words in given if words not in only_named)]
    cells = (cell.replace("|", "\\|") for cell in (f"`{name}`", what, "<br>".join(lines)))
    return f"| {' | '.join(cells)} |"


def reference() -> str:
    """A table for each kind of term."""
    lines: list[str] = []
    for kind, functions in TERMS.items():
        lines += [f"## {TITLES[kind]}", "", "| term | what it is | parameters |", "|---|---|---|"]
        every = {**functions, **{f"tasks.{name}": function for name, function in OF_TASKS.get(kind, {}).items()}}
        lines += [row(name, function) for name, function in sorted(every.items())]
        lines.append("")
    return "\n".join(lines).rstrip()


if __name__ == "__main__":
    sys.exit(main(__doc__, "terms", "term_table.py", ("docs/terms.md",), reference))
