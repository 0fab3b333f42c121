"""Data that knows where it was written: what the loader merges, and where its errors point to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

from anysim_schemas.errors import SpecError, SpecIssue
from anysim_schemas.limits import YAML_DEPTH


class Mark(NamedTuple):
    """A place: a file with line and column (from 1), an override (line 0), or nothing for data given in Python."""

    source: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.source}:{self.line}:{self.column}" if self.line else self.source


NOWHERE = Mark("", 0, 0)


@dataclass(frozen=True, slots=True)
class Node:
    """A value with the place where it starts, and the place of the key that holds it (None for items and roots)."""

    value: "Scalar | dict[str, Node] | list[Node]"
    mark: Mark
    key: Mark | None = None

    @property
    def place(self) -> Mark:
        """Where an error about the value points: to the value, or to the key of a block that starts below it."""
        below = self.key is not None and isinstance(self.value, dict | list) and self.mark.line != self.key.line
        return self.key if below and self.key is not None else self.mark

    def under(self, key: Mark | None) -> "Node":
        """The same value under another key."""
        return replace(self, key=key)

    def child(self, element: str | int) -> "Node | None":
        """The entry of a mapping or the item of a list; None where there is none."""
        if isinstance(self.value, dict):
            return self.value.get(str(element))
        if isinstance(self.value, list) and isinstance(element, int) and 0 <= element < len(self.value):
            return self.value[element]
        return None

    def plain(self) -> Any:
        """The value without positions, as fresh mappings and lists."""
        if isinstance(self.value, dict):
            return {key: child.plain() for key, child in self.value.items()}
        if isinstance(self.value, list):
            return [item.plain() for item in self.value]
        return self.value


Scalar = str | int | float | bool | None


class Fault(NamedTuple):
    """One thing that is wrong, with its place still comparable."""

    mark: Mark
    path: str
    message: str


def from_data(value: object, mark: Mark = NOWHERE, depth: int = 0) -> Node:
    """A node for data given in Python, `depth` levels down; keys become text.

    Raises:
        SpecError: it is deeper than a file may be, as a mapping that contains itself is.
    """
    if YAML_DEPTH.exceeded(depth):
        message = f"the data is more than {YAML_DEPTH.value} levels deep, or contains itself; flatten it"
        raise SpecError([SpecIssue(str(mark), "", message)])
    if isinstance(value, Mapping):
        items = cast("Mapping[object, object]", value).items()
        return Node({str(key): from_data(child, mark, depth + 1).under(mark) for key, child in items}, mark)
    if isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray | memoryview | range):
        return Node([from_data(child, mark, depth + 1) for child in cast("Sequence[object]", value)], mark)
    return Node(cast("Scalar", value), mark)


def in_order(faults: Sequence[Fault], files: Sequence[str]) -> list[SpecIssue]:
    """The faults as issues: by file in the order given, then line and column; overrides last; each one once."""
    rank = {name: index for index, name in enumerate(files)}
    ordered = sorted(faults, key=lambda fault: (rank.get(fault.mark.source, len(rank)), *fault.mark[1:]))
    return list(dict.fromkeys(SpecIssue(str(mark), path, message) for mark, path, message in ordered))
