"""The entries of a value as its spec sees them: a bare string as the mapping it is short for, keys as names."""

from collections.abc import Iterator

from anysim_schemas.base import NamedByKey
from anysim_schemas.nodes import Mark, Node, from_data
from anysim_schemas.shapes import Shapes, expanded, inside


def as_mapping(node: Node, shapes: Shapes) -> dict[str, Node] | None:
    """The keys of a mapping, or of the mapping that a bare string is short for; None where it is neither."""
    if isinstance(node.value, str):
        data = expanded(shapes, node.value)
        return (
            None if data is None else {key: from_data(value, node.mark).under(node.key) for key, value in data.items()}
        )
    return node.value if isinstance(node.value, dict) else None


def named_entries(node: Node, shapes: Shapes) -> dict[str, Node] | None:
    """`as_mapping`, with each entry of a mapping of terms named by its key where it gives no name."""
    entries = as_mapping(node, shapes)
    mark = next((mark for shape in shapes for mark in shape.metadata if isinstance(mark, NamedByKey)), None)
    if entries is None or mark is None:
        return entries
    return {key: _with_name(mark.field, key, child) for key, child in entries.items()}


def _with_name(field: str, key: str, node: Node) -> Node:
    value = {} if node.value is None else node.value
    if not isinstance(value, dict) or field in value:
        return node
    name = Node(key, node.key or node.mark)
    return Node({field: name, **value}, node.place, node.key)


def places(node: Node, shapes: Shapes, path: str = "") -> Iterator[tuple[str, Mark]]:
    """Where every value below this one was written, by dotted path, parents first."""
    children: list[tuple[str | int, Node]]
    if isinstance(node.value, list):
        children = list(enumerate(node.value))
    else:
        children = list((named_entries(node, shapes) or {}).items())
    for element, child in children:
        below = f"{path}.{element}" if path else str(element)
        yield below, child.mark
        yield from places(child, inside(shapes, element), below)
