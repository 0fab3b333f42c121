"""Pydantic's errors with their places in the files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from anysim_schemas.errors import KeyFault
from anysim_schemas.messages import MISSING, TYPE_ERRORS, count, sentence, suggest, unknown_key
from anysim_schemas.nodes import Fault, Mark, Node
from anysim_schemas.shapes import Shape, Shapes, expectation, field_at, inside, keys, tagged
from anysim_schemas.values import KINDS, TAG_PREFIX, Distribution

UNKNOWN_KEY = "extra_forbidden"
MAX_FAULTS = 1_000
"""How many faults are put into words; for each, the nearest name is looked for."""

LIMITS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")
STRUCTURE = ("missing", UNKNOWN_KEY)
MISMATCHES = TYPE_ERRORS | {"literal_error", "enum"}
CONSTANT = TAG_PREFIX + "constant"


@dataclass(frozen=True)
class _LocatedError:
    """An error whose location has been followed through the data and the annotations."""

    error: ErrorDetails
    path: tuple[str | int, ...]
    """Keys and indices from the root, the missing or unknown key included."""
    depth: int
    """How much of the path exists in the data."""
    node: Node
    """The deepest value that exists."""
    shapes: Shapes
    """What is expected at the node; all branches where a union has not been decided."""
    union: tuple[str | int, ...] | None
    """The path of the outermost union whose branch the location names, and no discriminator has chosen."""
    branch: str | int
    """That branch, as pydantic names it."""
    field: FieldInfo | None
    """The field that the node is, or is an item of."""


def locate(
    error: ValidationError, model: type[BaseModel], root: Node, prefix: str = "", more_keys: Sequence[str] = ()
) -> list[Fault]:
    """The faults behind a validation error, with places and sentences.

    Args:
        error: what pydantic says.
        model: the model that was validated.
        root: the data that was validated, with places.
        prefix: dotted path of the root, for slots inside a spec.
        more_keys: keys that exist at the root besides the model's.
    """
    details = error.errors(include_url=False)
    found = _decide_unions([_follow(one, model, root) for one in details[:MAX_FAULTS]])
    faults: list[Fault] = []
    if len(details) > MAX_FAULTS:
        faults.append(Fault(root.place, prefix, f"there are {len(details):,} faults; {MAX_FAULTS:,} of them follow"))
    for located in _join_lengths(found):
        short = _is_short_list(located)
        path = ".".join(map(str, located.path[:-1] if short else located.path))
        full = ".".join(part for part in (prefix, path) if part)
        faults.append(Fault(_mark(located), full, _message(located, more_keys)))
    return faults


def _follow(error: ErrorDetails, model: type[BaseModel], root: Node) -> _LocatedError:
    node, shapes = root, (Shape(model),)
    field: FieldInfo | None = None
    path: list[str | int] = []
    union: tuple[str | int, ...] | None = None
    branch: str | int = ""
    last = len(error["loc"]) - 1
    for position, element in enumerate(error["loc"]):
        if element == "[key]":
            continue
        if isinstance(element, str) and element.startswith(TAG_PREFIX):
            shapes = tagged(shapes, element)
            continue
        child = node.child(element)
        if child is not None and not (position == last and error["type"] == UNKNOWN_KEY):
            field = field if isinstance(element, int) else field_at(shapes, element)
            shapes, node = inside(shapes, element), child
            path.append(element)
        elif position == last and error["type"] in ("missing", UNKNOWN_KEY):
            depth = len(path)
            return _LocatedError(error, (*path, element), depth, node, shapes, union, branch, field)
        elif inside(shapes, element):  # the field that a bare string stands for
            field, shapes = field_at(shapes, element), inside(shapes, element)
        elif union is None:
            union, branch = tuple(path), element
    cause = cast("Mapping[str, Any]", error.get("ctx", {})).get("error")
    for element in cause.path if isinstance(cause, KeyFault) else ():
        child = node.child(element)
        if child is None:
            break
        node = child
        path.append(element)
    return _LocatedError(error, tuple(path), len(path), node, shapes, union, branch, field)


def _decide_unions(found: Sequence[_LocatedError]) -> Iterator[_LocatedError]:
    """Of the errors of a union only those of the branch that was meant: of the right type, the keys that fit best."""
    unions: dict[tuple[str | int, ...], list[_LocatedError]] = {}
    for located in found:
        if located.union is not None:
            unions.setdefault(located.union, []).append(located)
    for located in found:
        if located.union is None:
            yield located
        elif located.union in unions:
            yield from _decide(unions.pop(located.union))


def _decide(errors: Sequence[_LocatedError]) -> Iterator[_LocatedError]:
    branches: dict[str | int, list[_LocatedError]] = {}
    for located in errors:
        branches.setdefault(located.branch, []).append(located)
    fitting = [group for group in branches.values() if any(_fits_type(e) for e in group)]
    if fitting:
        yield from min(fitting, key=lambda group: (sum(e.error["type"] in STRUCTURE for e in group), len(group)))
    else:  # no branch is of the type that was given
        yield next((e for e in errors if e.error["type"] in TYPE_ERRORS), errors[0])


def _fits_type(located: _LocatedError) -> bool:
    """Whether the error lies below its union, or is no complaint about the type of the value."""
    return len(located.path) > len(located.union or ()) or located.error["type"] not in MISMATCHES


def _join_lengths(found: Iterator[_LocatedError]) -> Iterator[_LocatedError]:
    """One error for a list that is too short, where pydantic reports each missing item."""
    seen: set[tuple[str | int, ...]] = set()
    for located in found:
        kind, context = located.error["type"], cast("Mapping[str, Any]", located.error.get("ctx", {}))
        items = located.node.value
        if _is_short_list(located):
            if located.path[:-1] in seen:
                continue
            seen.add(located.path[:-1])
        # Items that are themselves wrong do not count for pydantic: the list is not too short.
        if kind == "too_short" and isinstance(items, list) and len(items) >= context.get("min_length", 0):
            continue
        yield located


def _is_short_list(located: _LocatedError) -> bool:
    """Whether an item of a list of fixed length is missing."""
    return located.error["type"] == "missing" and bool(located.path) and isinstance(located.path[-1], int)


def _mark(located: _LocatedError) -> Mark:
    kind, node = located.error["type"], located.node
    if kind == UNKNOWN_KEY:
        child = node.child(located.path[-1])
        return child.key if child is not None and child.key is not None else node.place
    return node.key if "[key]" in located.error["loc"] and node.key is not None else node.place


def _message(located: _LocatedError, more_keys: Sequence[str]) -> str:
    error, shapes = located.error, located.shapes
    kind, given = error["type"], cast("object", error["input"])
    context = cast("Mapping[str, Any]", error.get("ctx", {}))
    lengths = {shape.length for shape in shapes if shape.length is not None}
    if kind == UNKNOWN_KEY:
        known = [*keys(shapes), *(more_keys if located.depth == 0 else ())]
        key = str(located.path[-1])
        owner = next((s.spec.belongs_to[key] for s in shapes if s.spec and key in s.spec.belongs_to), None)
        return unknown_key(key, known, _further_down(shapes)) if owner is None else f"unknown key; {owner}"
    if (kind == "too_long" or _is_short_list(located)) and lengths:
        items = located.node.value
        got = len(items) if isinstance(items, list) else 0
        return f"expected {count(max(lengths), 'item')}, got {got or 'none'}{_purpose(located)}"
    if kind == "missing":
        field = field_at(shapes, located.path[-1])
        purpose = f": {field.description}" if field is not None and field.description else ""
        return MISSING + purpose
    expected = expectation(shapes) if kind in TYPE_ERRORS else ""
    if CONSTANT in error["loc"] and isinstance(located.node.value, dict):
        drawn = ", ".join(f"{{{name}: …}}" for name in KINDS[:-1]) + f" or {{{KINDS[-1]}: …}}"
        expected = f"{expected}, {drawn}" if expected else drawn
    text = sentence(kind, context, given, error["msg"], expected)
    if CONSTANT in error["loc"] and isinstance(located.node.value, dict):
        text += next((hint for key in located.node.value if (hint := suggest(key, KINDS))), "")
    return text + _purpose(located) if kind in LIMITS else text


def _purpose(located: _LocatedError) -> str:
    """What the key is for, in parentheses, where its field says so."""
    field = located.field
    return f" ({field.description})" if field is not None and field.description else ""


def _further_down(shapes: Shapes) -> dict[str, str]:
    """The keys of the models one level down, with their paths."""
    return {
        key: f"{parent}.{key}"
        for parent in reversed(keys(shapes))
        for key in keys(
            tuple(s for s in inside(shapes, parent) if s.spec is not None and not issubclass(s.spec, Distribution))
        )
    }
