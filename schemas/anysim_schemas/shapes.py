"""Types that a spec expects at a place: the annotations of pydantic models along the keys of a file.

One fact, read off the models, serves the merging of files, the slots of plugins and the sentences of errors.
"""

import enum
import types
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import PurePath
from typing import Annotated, Any, Literal, NamedTuple, Union, cast, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo

from anysim_schemas.base import Spec

LISTS = (list, tuple, set, frozenset, Sequence)


class Shape(NamedTuple):
    """One type that may stand at a place, without its annotations; those are in `metadata`, the outermost first."""

    kind: Any
    metadata: tuple[Any, ...] = ()

    @property
    def model(self) -> type[BaseModel] | None:
        """The type where it is a pydantic model."""
        return self.kind if isinstance(self.kind, type) and issubclass(self.kind, BaseModel) else None

    @property
    def spec(self) -> type[Spec] | None:
        """The type where it is a spec."""
        model = self.model
        return model if model is not None and issubclass(model, Spec) else None

    @property
    def length(self) -> int | None:
        """The number of items of a tuple of fixed length."""
        items = get_args(self.kind)
        return len(items) if get_origin(self.kind) is tuple and items and items[-1] is not Ellipsis else None


Shapes = tuple[Shape, ...]


def shapes_of(annotation: Any, metadata: Sequence[Any] = ()) -> Shapes:
    """The types behind an annotation: the branches of a union, without None."""
    return tuple(_flatten(annotation, tuple(metadata)))


def _flatten(annotation: Any, metadata: tuple[Any, ...]) -> Iterator[Shape]:
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *extra = get_args(annotation)
        yield from _flatten(inner, (*metadata, *extra))
    elif origin in (Union, types.UnionType):
        for branch in get_args(annotation):
            yield from _flatten(branch, metadata)
    elif hasattr(annotation, "__value__"):  # a named type alias
        yield from _flatten(annotation.__value__, metadata)
    elif annotation not in (None, types.NoneType):
        yield Shape(annotation, metadata)


@cache
def fields_by_key(model: type[BaseModel]) -> Mapping[str, FieldInfo]:
    """The fields of a model by the key that a file writes."""
    return {_key(name, field): field for name, field in model.model_fields.items()}


@cache
def shapes_of_field(model: type[BaseModel], key: str) -> Shapes:
    """The types behind a key of a model; empty where it has no such key."""
    field = fields_by_key(model).get(key)
    return shapes_of(field.annotation, field.metadata) if field is not None else ()


def _key(name: str, field: FieldInfo) -> str:
    alias = field.validation_alias if field.validation_alias is not None else field.alias
    return alias if isinstance(alias, str) else name


def keys(shapes: Shapes) -> list[str]:
    """The keys that exist at a place."""
    models = [shape.model for shape in shapes]
    return list(dict.fromkeys(key for model in models if model is not None for key in fields_by_key(model)))


def field_at(shapes: Shapes, element: str | int) -> FieldInfo | None:
    """The field behind a key."""
    models = [shape.model for shape in shapes]
    return next((f for m in models if m is not None for k, f in fields_by_key(m).items() if k == element), None)


def inside(shapes: Shapes, element: str | int) -> Shapes:
    """What is expected one key or index further down; empty where nothing is known about it."""
    return tuple(below for shape in shapes for below in _inside(shape, element))


def _inside(shape: Shape, element: str | int) -> Shapes:
    if shape.model is not None:
        return shapes_of_field(shape.model, str(element))
    origin, args = get_origin(shape.kind), get_args(shape.kind)
    if not isinstance(origin, type) or not args:
        return ()
    if issubclass(origin, Mapping):
        return shapes_of(args[-1])
    if shape.length is not None:
        return shapes_of(args[element]) if isinstance(element, int) and element < len(args) else ()
    return shapes_of(args[0]) if issubclass(origin, LISTS) else ()


def tagged(shapes: Shapes, tag: str) -> Shapes:
    """The branch of a union that a discriminator has chosen; empty where the tag is none of its branches."""
    return tuple(shape for shape in shapes if any(isinstance(m, Tag) and m.tag == tag for m in shape.metadata))


def expanded(shapes: Shapes, text: str) -> dict[str, Any] | None:
    """The mapping that a bare string stands for at this place; None where it stands for itself."""
    specs = [shape.spec for shape in shapes]
    return next((data for spec in specs if spec is not None and (data := spec.from_text(text)) is not None), None)


def alternatives(shapes: Shapes) -> tuple[tuple[str, ...], ...]:
    """The groups of keys that exclude each other at this place."""
    specs = [shape.spec for shape in shapes if shape.spec is not None]
    return tuple(dict.fromkeys(group for spec in specs for group in spec.alternatives))


_NAMES: tuple[tuple[type, str], ...] = (
    (bool, "true or false"), (int, "a whole number"), (float, "a number"), (str, "text"), (bytes, "text"),
    (PurePath, "text"),
)  # fmt: skip


def expectation(shapes: Shapes) -> str:
    """What is expected in words: `a number`, `a list of 3 numbers or text`; empty where that is unknown."""
    words = [_words(shape) for shape in shapes]
    return " or ".join(dict.fromkeys(words)) if words and all(words) else ""


def _words(shape: Shape) -> str:
    origin, args = get_origin(shape.kind), get_args(shape.kind)
    if origin is Literal:
        return "one of " + ", ".join(str(choice) for choice in args)
    kind = origin or shape.kind
    if not isinstance(kind, type):
        return ""
    if issubclass(kind, BaseModel | Mapping):
        return "a mapping"
    if issubclass(kind, enum.Enum):
        return "one of " + ", ".join(str(cast("enum.Enum", choice).value) for choice in cast("Any", kind))
    named = next((words for base, words in _NAMES if issubclass(kind, base)), "")
    return named or (_list_words(shape) if issubclass(kind, LISTS) else "")


def _list_words(shape: Shape) -> str:
    items = {_words(s) for s in inside((shape,), 0)}
    plurals = {"a whole number": "whole numbers", "a number": "numbers", "text": "texts", "a mapping": "mappings"}
    plural = plurals.get(items.pop(), "items") if len(items) == 1 else "items"
    if shape.length is not None:
        return f"a list of {shape.length} {plural}"
    return "a list" if plural == "items" else f"a list of {plural}"
