"""Scene files beneath a world: what another program's file says, entry by entry, under what the YAML says itself."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import atan2, hypot
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
    given = None if source is None else source.plain()
    if read is None or source is None:
        return root
    try:
        spec = SceneSpec.model_validate(given)
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


# ------------------------------------------------------------------ what readers share


def free_name(wanted: str, otherwise: str, taken: Collection[str]) -> str:
    """A name that anysim takes, made of one of another program, that is not taken; `otherwise` is for one without."""
    name = re.sub(r"[^a-zA-Z0-9_]", "_", wanted.replace("::", "_"))
    name = name if re.match(r"[a-zA-Z]", name) else f"{otherwise}_{name}" if name else otherwise
    free, count = name, 0
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    return free


def control_step(dt: float, usual: float = 0.02) -> float:
    """The whole multiple of a time step [s] that is nearest to the usual time between two actions [s]."""
    steps = max(1, round(usual / dt)) if dt > 0 else 1
    return usual if abs(steps * dt - usual) < 1e-9 else steps * dt


def placed(position: Iterable[float], quaternion: Iterable[float]) -> dict[str, Any]:
    """An entry of the layout for a position [m] and a unit quaternion xyzw, that other things may touch at first."""
    angles = dict(zip(("roll", "pitch", "yaw"), roll_pitch_yaw(quaternion), strict=True))
    turned = {key: angle for key, angle in angles.items() if angle}
    return {"position": [float(v) for v in position], **turned, "checked": False}


def roll_pitch_yaw(quaternion: Iterable[float]) -> list[float]:
    """Angles [rad] of a unit quaternion xyzw, exact to rounding; the roll is 0 where the pitch is a right angle."""
    x, y, z, w = (float(v) for v in quaternion)
    ahead = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
    level = hypot(ahead[0], ahead[1])
    pitch = atan2(-ahead[2], level)
    if level < 1e-9:
        return [0.0, pitch, atan2(-2 * (x * y - w * z), 1 - 2 * (x * x + z * z))]
    return [atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), pitch, atan2(ahead[1], ahead[0])]
