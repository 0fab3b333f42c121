"""Levels of difficulty: changes to a file that a name in it chooses."""

from collections.abc import Sequence
from dataclasses import replace

from anysim_schemas.merging import merge
from anysim_schemas.messages import listing, suggest
from anysim_schemas.nodes import Fault, Node
from anysim_schemas.shapes import Shapes

_CHOICES = ("level", "levels", "robot", "alternates")


def split(overrides: Sequence[str]) -> tuple[list[str], list[str]]:
    """Overrides that choose a level or a robot or say what it changes, and the others, which are on top of that."""
    about = [text for text in overrides if text.partition("=")[0].partition(".")[0].strip() in _CHOICES]
    return about, [text for text in overrides if text not in about]


def with_level(root: Node, shapes: Shapes, faults: list[Fault]) -> Node:
    """The data with the changes of the level that they name.

    The names of the levels stay, and what they change is gone: the result is the same if it is read again.
    """
    level, levels = root.child("level"), root.child("levels")
    if levels is not None and not isinstance(levels.value, dict):
        return root  # the spec says so
    known = levels.value if levels is not None and isinstance(levels.value, dict) else {}
    if level is not None and isinstance(level.value, str):
        if level.value not in known:
            words = f"there is no level '{level.value}'{suggest(level.value, list(known))}"
            faults.append(Fault(level.place, "level", f"{words} (levels: {listing(list(known))})"))
        else:
            root = merge(root, known[level.value], shapes)
    if levels is None or not isinstance(root.value, dict):
        return root
    names = {name: replace(node, value={}) if isinstance(node.value, dict) else node for name, node in known.items()}
    return replace(root, value={**root.value, "levels": replace(levels, value=names)})
