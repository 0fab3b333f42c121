"""Merging of several files: mappings are merged, everything else is replaced, null removes."""

from collections.abc import Iterable
from dataclasses import replace

from anysim_schemas.entries import as_mapping
from anysim_schemas.messages import count, describe
from anysim_schemas.nodes import Fault, Mark, Node, from_data
from anysim_schemas.shapes import Shapes, alternatives, inside
from anysim_schemas.yaml import parse


def merge(base: Node, over: Node, shapes: Shapes) -> Node:
    """`over` on top of `base`.

    A mapping is merged key by key; a bare string that is short for a mapping counts as one under a mapping. Scalars
    and lists replace what they meet. A key set to null is removed if it was inherited. A key of one alternative
    (`mass`) removes the inherited keys of the others (`density`). Of what a bare string replaces, the keys stay that
    its spec names in `kept_under_text`.
    """
    if not isinstance(over.value, dict):
        return _with_kept(base, over, shapes)
    below = as_mapping(base, shapes)
    if below is None:
        return over
    merged = dict(below)
    for key, child in over.value.items():
        if key not in merged:
            merged[key] = child
        elif child.value is None:
            del merged[key]
        else:
            merged[key] = merge(merged[key], child, inside(shapes, key))
    return replace(over, value=_without_rivals(merged, over.value, shapes))


def _with_kept(base: Node, over: Node, shapes: Shapes) -> Node:
    """`over`, and of what it replaces the keys that outlive a bare string."""
    names = {name for shape in shapes if shape.spec is not None for name in shape.spec.kept_under_text}
    below = as_mapping(base, shapes) if names and isinstance(over.value, str) else None
    kept = {name: node for name, node in (below or {}).items() if name in names}
    given = as_mapping(over, shapes) if kept else None
    return over if given is None else replace(over, value={**given, **kept})


def _without_rivals(merged: dict[str, Node], given: dict[str, Node], shapes: Shapes) -> dict[str, Node]:
    """The mapping without inherited keys that a given key excludes."""
    groups = alternatives(shapes)
    present = {key for key, node in given.items() if node.value is not None}
    chosen = [group for group in groups if present.intersection(group)]
    if not chosen:
        return merged
    kept = {key for group in chosen for key in group} | given.keys()
    rivals = {key for group in groups for key in group} - kept
    return {key: node for key, node in merged.items() if key not in rivals}


def override(root: Node, overrides: Iterable[str], shapes: Shapes, faults: list[Fault]) -> Node:
    """The data with overrides such as `physics.dt=0.004` on top, in order.

    A path goes through keys and list indices; the value is YAML and is merged like a file with that one key, so an
    empty or null value removes the key.
    """
    for text in overrides:
        mark = Mark(override_name(text), 0, 0)
        path, equals, value = text.partition("=")
        parts = path.strip().split(".")
        if not equals or not all(parts):
            message = "an override is KEY=VALUE with a dotted key, such as physics.dt=0.004"
            faults.append(Fault(mark, "", message))
            continue
        problems: list[Fault] = []
        node = parse(value.strip() or "null", mark.source, problems)
        faults.extend(Fault(mark, path, f"the value cannot be read: {problem.message}") for problem in problems)
        if node is None or problems:
            continue
        try:
            root = _assign(root, parts, _moved(node, mark), shapes, mark)
        except _CannotStep as error:
            faults.append(Fault(mark, path, str(error)))
    return root


def override_name(text: str) -> str:
    """How errors show an override: as it was given on the command line, cut where it is long."""
    return f"-o {text}" if len(text) <= 80 else f"-o {text[:79]}…"


class _CannotStep(Exception):
    """An override leads through something that has no keys."""


def _moved(node: Node, mark: Mark) -> Node:
    """The same data, written at another place."""
    return from_data(node.plain(), mark).under(mark)


def _assign(node: Node, parts: list[str], value: Node, shapes: Shapes, mark: Mark, done: str = "") -> Node:
    head, *rest = parts
    below = inside(shapes, int(head) if isinstance(node.value, list) and head.isdecimal() else head)
    here = f"{done}.{head}" if done else head
    if isinstance(node.value, list):
        if not head.isdecimal() or int(head) >= len(node.value):
            raise _CannotStep(
                f"'{done}' is a list of {count(len(node.value), 'item')}; an index from 0 is expected, got '{head}'"
            )
        items = list(node.value)
        item = items[int(head)]
        items[int(head)] = _assign(item, rest, value, below, mark, here) if rest else merge(item, value, below)
        return replace(node, value=items)
    entries = {} if node.value is None else as_mapping(node, shapes)
    if entries is None:
        raise _CannotStep(f"'{done}' is {describe(node.plain())} and has no key '{head}'")
    old = entries.get(head)
    if rest:
        new = _assign(old or Node(None, mark, mark), rest, value, below, mark, here)
    elif value.value is None and old is not None:
        return replace(node, value={key: child for key, child in entries.items() if key != head})
    else:
        new = value if old is None else merge(old, value, below)
    return replace(node, value=_without_rivals({**entries, head: new}, {head: new}, shapes))
