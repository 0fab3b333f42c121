"""Data without what is wrong with it, so that checks that come later can look at the rest."""

import re
from collections.abc import Sequence
from dataclasses import replace

from anysim_schemas.nodes import Fault, Node
from anysim_schemas.shapes import Shapes, inside

UNKNOWN = "unknown key"
"""How the sentence for a key that does not exist begins."""

_MEANT = re.compile(r"did you mean '([^']+)'")
_SHALLOW = 2


def without(root: Node, faults: Sequence[Fault], shapes: Shapes) -> Node | None:
    """The data without single faulty values; an unknown key that is like a known one stands for that.

    None where leaving it out would make later checks complain of what is only misspelt: a whole section, an entry that
    others may refer to, an item of a list. `shapes` are those of the root.
    """
    rest: Node | None = root
    for fault in dict.fromkeys(faults):
        if rest is None or not fault.path:
            return None
        unknown = fault.message.startswith(UNKNOWN)
        meant = _MEANT.search(fault.message) if unknown else None
        rest = _left(rest, fault.path.split("."), shapes, unknown, meant[1] if meant else "", 0)
    return rest


def _left(node: Node, parts: Sequence[str], shapes: Shapes, unknown: bool, meant: str, depth: int) -> Node | None:
    head, *more = parts
    key = int(head) if isinstance(node.value, list) and head.isdigit() else head
    child = node.child(key)
    if child is None:
        return None
    if more:
        below = _left(child, more, inside(shapes, key), unknown, meant, depth + 1)
        return None if below is None else _with(node, key, below)
    named = not any(shape.model is not None for shape in shapes)  # entries by names that others may use
    if named or not isinstance(node.value, dict):
        return None
    if isinstance(child.value, dict) and not _may_go(unknown, meant, depth):
        return None
    entries = {name: entry for name, entry in node.value.items() if name != head}
    if meant and meant not in entries:
        entries[meant] = child
    return replace(node, value=entries)


def _may_go(unknown: bool, meant: str, depth: int) -> bool:
    """Whether nothing else refers to what is in a mapping, or it keeps its place under the name that was meant."""
    return unknown and (bool(meant) or depth >= _SHALLOW)


def _with(node: Node, key: str | int, child: Node) -> Node:
    if isinstance(node.value, list):
        return replace(node, value=[child if i == key else item for i, item in enumerate(node.value)])
    assert isinstance(node.value, dict)  # it has a child by this key
    return replace(node, value={**node.value, str(key): child})
