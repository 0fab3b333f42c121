"""Scene files beneath a world: what another program's file says, entry by entry, under what the YAML says itself."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

from pydantic import Field, ValidationError

from anysim_schemas.base import Spec
from anysim_schemas.errors import AnysimError
from anysim_schemas.nodes import Fault, Mark, Node, from_data
from anysim_schemas.object_source import PACKAGES
from anysim_schemas.shapes import Shapes

SceneNote = tuple[Literal["repaired", "dropped", "info"], str, str]
"""Kind, element and message, as in the report of an import."""


class SceneSpec(Spec):
    """A scene file of another program whose bodies are objects of this world. A bare string is its URI.

    What the YAML says of an object, a light or a camera of the file is merged on top; `null` takes it out.
    """

    file: str = Field(description="URI of an MJCF or SDF file, or of another format that a scene reader reads")
    packages: dict[str, str] = Field(default_factory=dict, description=PACKAGES)
    notes: tuple[SceneNote, ...] | None = Field(
        default=None,
        description="what of the file is not in this world; written when the file is read, which is then done: "
        "what it says stands beside this key",
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The URI of the file."""
        return {"file": text}


class SceneEntry(NamedTuple):
    """One value of a scene: its keys from the root of a run, and the file and the line that say it."""

    keys: tuple[str, ...]
    value: Any
    file: str
    line: int


class ImportedScene(NamedTuple):
    """What a scene file says of a run, in order, and what of it is not in there."""

    entries: tuple[SceneEntry, ...]
    notes: tuple[SceneNote, ...] = ()


SceneReader = Callable[[str, Mapping[str, str], Mark], ImportedScene]
"""Reads the file of a URI, with the folders of packages, for a key that is written at a place."""


def with_scene(root: Node, read: SceneReader | None, shapes: Shapes, faults: list[Fault]) -> Node:
    """The data on top of what its scene file says; as it is without one, or where that has been read before."""
    world = root.child("world")
    source = None if world is None else world.child("source")
    if read is None or source is None:
        return root
    try:
        spec = SceneSpec.model_validate(source.plain())
    except ValidationError:
        return root  # the spec of the run says so
    if spec.notes is not None:
        return root
    try:
        scene = read(spec.file, spec.packages, source.mark)
    except AnysimError as error:
        faults.append(Fault(source.place, "world.source", str(error)))
        return root
    told = from_data({"world": {"source": {"notes": [list(note) for note in scene.notes]}}}, source.mark)
    from anysim_schemas.merging import merge  # which reads YAML, as worlds that are data do not

    return merge(merge(_tree(scene.entries), root, shapes), told, shapes)


def _tree(entries: Sequence[SceneEntry]) -> Node:
    """The entries as nested mappings; a mapping is where its first entry is."""
    root = Node({}, Mark("", 0, 0))
    for entry in entries:
        mark = Mark(entry.file, entry.line, 1)
        root = _with(root, entry.keys, from_data(entry.value, mark), mark)
    return root


def _with(node: Node, keys: tuple[str, ...], value: Node, mark: Mark) -> Node:
    below = node.value if isinstance(node.value, dict) else {}
    own = below.get(keys[0]) or Node({}, mark)
    made = value if len(keys) == 1 else _with(own, keys[1:], value, mark)
    return replace(node, value={**below, keys[0]: made.under(own.key or mark)})
