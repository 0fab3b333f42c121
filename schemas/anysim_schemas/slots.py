"""Checks the parts of a spec that belong to plugins, with the models that the plugins declare.

It walks the annotations along the data, not the validated spec: a slot is checked even where something else is wrong.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import get_args, get_origin

from pydantic import BaseModel, ValidationError

from anysim_schemas.entries import as_mapping, named_entries
from anysim_schemas.errors import AnysimError
from anysim_schemas.faults import locate
from anysim_schemas.messages import unknown_key
from anysim_schemas.nodes import Fault, Node
from anysim_schemas.plugin import OptionsResolver, PluginSlot, UnknownPlugin, bound_names
from anysim_schemas.shapes import LISTS, Shape, Shapes, fields_by_key, inside, shapes_of_field


@dataclass(frozen=True)
class _Slot:
    """What one plugin owns of the data."""

    kind: str
    name: str
    name_node: Node
    """Where the name is written, or what would hold it."""
    name_path: str
    options: Node
    path: str
    """Of the options."""
    beside: tuple[str, ...]
    """Keys of the spec that stand beside the options in one mapping."""


def check_slots(model: type[BaseModel], root: Node, resolver: OptionsResolver) -> list[Fault]:
    """The faults of every slot in the data: plugins that are unknown, and options that their models refuse."""
    return [fault for slot in _slots((Shape(model),), root, "") for fault in _check(slot, resolver)]


def _check(slot: _Slot, resolver: OptionsResolver) -> list[Fault]:
    try:
        model = resolver(slot.kind, slot.name)
    except (UnknownPlugin, AnysimError) as error:
        return [Fault(slot.name_node.place, slot.name_path, str(error))]
    if not isinstance(slot.options.value, dict):
        return []  # not a mapping: the core has said so
    if model is None:
        return [
            Fault(child.key or child.place, f"{slot.path}.{key}", _takes_nothing(slot, key))
            for key, child in slot.options.value.items()
        ]
    given, known = slot.options.plain(), fields_by_key(model)
    within = [fault for inner in _slots_of_model(model, slot.options, slot.path) for fault in _check(inner, resolver)]
    bound = {key for key, value in given.items() if slot.beside and key in known and any(bound_names(value))}
    try:
        model.model_validate({key: value for key, value in given.items() if key not in bound})
    except ValidationError as error:
        later = {_join(slot.path, key) for key in bound}  # checked with each value that they can have
        return [f for f in locate(error, model, slot.options, slot.path, slot.beside) if f.path not in later] + within
    return within


def _takes_nothing(slot: _Slot, key: str) -> str:
    return f"{unknown_key(key, slot.beside, {})}; the {slot.kind} '{slot.name}' takes no parameters"


def _slots(shapes: Shapes, node: Node, path: str) -> Iterator[_Slot]:
    for shape in shapes:
        if shape.model is not None:
            yield from _slots_of_model(shape.model, node, path)
        elif _is_list(shape):
            for index, item in enumerate(node.value if isinstance(node.value, list) else ()):
                yield from _slots(inside((shape,), index), item, f"{path}.{index}")
        else:
            for key, child in (named_entries(node, (shape,)) or {}).items():
                yield from _slots(inside((shape,), key), child, _join(path, key))


def _is_list(shape: Shape) -> bool:
    origin = get_origin(shape.kind)
    return isinstance(origin, type) and issubclass(origin, LISTS) and bool(get_args(shape.kind))


def _slots_of_model(model: type[BaseModel], node: Node, path: str) -> Iterator[_Slot]:
    entries = as_mapping(node, (Shape(model),))
    if entries is None:
        return
    holder = Node(entries, node.place, node.key)
    fields = fields_by_key(model)
    kind = getattr(model, "plugin_kind", None)
    if isinstance(kind, str):
        name_key = str(getattr(model, "plugin_name_field", "term"))
        options = replace(holder, value={key: child for key, child in entries.items() if key not in fields})
        yield from _slot(kind, name_key, holder, options, path, path, tuple(fields))
    for key, field in fields.items():
        marker = next((mark for mark in field.metadata if isinstance(mark, PluginSlot)), None)
        if marker is not None and (marker.name_field in entries or key in entries):
            options = entries.get(key, replace(holder, value={}))
            yield from _slot(marker.kind, marker.name_field, holder, options, path, _join(path, key), (), fields)
        elif key in entries:
            yield from _slots(shapes_of_field(model, key), entries[key], _join(path, key))


def _slot(
    kind: str,
    name_key: str,
    holder: Node,
    options: Node,
    path: str,
    options_path: str,
    beside: tuple[str, ...],
    fields: Mapping[str, object] | None = None,
) -> Iterator[_Slot]:
    """The slot, if its name is given or has a default."""
    given = holder.child(name_key)
    name = given.value if given is not None else getattr((fields or {}).get(name_key), "default", None)
    if isinstance(name, str):
        yield _Slot(kind, name, given or holder, _join(path, name_key), options, options_path, beside)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key
