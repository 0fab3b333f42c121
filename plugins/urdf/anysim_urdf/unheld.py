"""Notes of what a URDF says and the neutral model does not hold: of all that is not in the table of what is read."""

from collections.abc import Iterator, Mapping
from typing import Any

from anysim.assets.model import ImportNote
from anysim.errors import listing

_ORIGIN = {"origin": "xyz rpy"}
_SHAPES = {
    "geometry": "",
    "geometry/box": "size",
    "geometry/cylinder": "radius length",
    "geometry/sphere": "radius",
    "geometry/mesh": "filename scale",
}
_LOOKS = {"material": "name", "material/color": "rgba"}


def _below(path: str, *tables: Mapping[str, str]) -> dict[str, str]:
    return {f"{path}/{key}": attributes for table in tables for key, attributes in table.items()}


READ: Mapping[str, frozenset[str]] = {
    path: frozenset(attributes.split())
    for path, attributes in {
        "robot": "name version",
        "robot/link": "name",
        "robot/link/inertial": "",
        **_below("robot/link/inertial", _ORIGIN, {"mass": "value", "inertia": "ixx iyy izz ixy ixz iyz"}),
        "robot/link/visual": "name",
        **_below("robot/link/visual", _ORIGIN, _SHAPES, _LOOKS),
        "robot/link/collision": "name",
        **_below("robot/link/collision", _ORIGIN, _SHAPES, _LOOKS),
        "robot/joint": "name type",
        **_below("robot/joint", _ORIGIN, {"parent": "link", "child": "link", "axis": "xyz"}),
        **_below("robot/joint", {"limit": "lower upper effort velocity", "dynamics": "damping friction"}),
        **_below("robot/joint", {"mimic": "joint multiplier offset"}),
        **_below("robot", _LOOKS),
    }.items()
}
"""The elements that are read, by path, with their attributes, and those that cannot matter: names, a version."""

SEVERAL = frozenset({"link", "joint", "visual", "collision"})
"""What there may be several of in one parent, besides materials of a robot; of all else the first is read."""

EFFECTS: Mapping[str, str] = {
    "gazebo": "what it says of friction, sensors and plugins is Gazebo's alone",
    "transmission": "gears and drives are those of the catalogue's entry",
    "contact": "PyBullet's surfaces and stiffness; the world's `contact` and `surfaces` have them",
    "texture": "surfaces have plain colours",
    "safety_controller": "limits are those of <limit>",
    "calibration": "it is of the real robot's encoders",
    "capsule": "the shape is missing",
}


def notes_of(root: Any) -> list[ImportNote]:
    """A note for each kind of element and attribute that is there in vain, with how often and where."""
    found: dict[tuple[str, str], list[str]] = {}
    for what, why, owner in _unread(root, "robot"):
        found.setdefault((what, why), []).append(owner)
    return [
        ImportNote("dropped", what, f"{why} ({len(owners)}: {listing(dict.fromkeys(owners), 3)})")
        for (what, why), owners in found.items()
    ]


def _unread(element: Any, path: str, owner: str = "robot") -> Iterator[tuple[str, str, str]]:
    """What is not read below an element, why, and of which link or joint."""
    if element.tag in ("link", "joint"):
        owner = f"{element.tag} '{element.get('name')}'"
    for key in element.attrib:
        if key not in READ[path]:
            yield f"<{element.tag} {key}>", "is left out", owner
    seen: set[str] = set()
    for child in element:
        tag = str(child.tag)
        below = f"{path}/{tag}"
        if below not in READ:
            yield f"<{tag}>", f"is left out{': ' * (tag in EFFECTS)}{EFFECTS.get(tag, '')}", owner
            continue
        if (tag in seen or (seen and element.tag == "geometry")) and tag not in SEVERAL and below != "robot/material":
            yield f"<{tag}>", f"of several in one <{element.tag}> the first is read", owner
        seen.add(tag)
        yield from _unread(child, below, owner)
