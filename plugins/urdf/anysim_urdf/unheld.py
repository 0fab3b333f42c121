"""Notes of what a URDF says and the neutral model does not hold.

`anysim_urdf.coverage` has the fate of each element and attribute; one that is left out, or not in the table, is noted.
"""

from collections.abc import Iterator
from typing import Any

from anysim.assets.model import Fate, ImportNote
from anysim.errors import listing
from anysim_urdf.coverage import SEVERAL, Row, attribute, element, known


def notes_of(root: Any) -> list[ImportNote]:
    """A note for each kind of element and attribute that is there in vain, with how often and where."""
    found: dict[tuple[str, str], list[str]] = {}
    for what, why, owner in _unread(root, "robot"):
        found.setdefault((what, why), []).append(owner)
    return [
        ImportNote("dropped", what, f"{why} ({len(owners)}: {listing(dict.fromkeys(owners), 3)})")
        for (what, why), owners in found.items()
    ]


def _unread(node: Any, path: str, owner: str = "robot") -> Iterator[tuple[str, str, str]]:
    """What is not read below an element, why, and of which link or joint."""
    if node.tag in ("link", "joint"):
        owner = f"{node.tag} '{node.get('name')}'"
    for key in node.attrib:
        row = attribute(path, key)
        if row is None or row.fate is Fate.LEFT_OUT:
            yield f"<{node.tag} {key}>", _left_out(row), owner
    seen: set[str] = set()
    for child in node:
        tag = str(child.tag)
        below = f"{path}/{tag}"
        if tag == "gazebo" and _springs_alone(child):
            continue
        if not known(below):
            yield f"<{tag}>", _left_out(element(below)), owner
            continue
        if (tag in seen or (seen and node.tag == "geometry")) and tag not in SEVERAL and below != "robot/material":
            yield f"<{tag}>", f"of several in one <{node.tag}> the first is read", owner
        seen.add(tag)
        yield from _unread(child, below, owner)


def _springs_alone(gazebo: Any) -> bool:
    """Whether a <gazebo> holds nothing but the spring of a joint."""
    joints = {joint.get("name") for joint in gazebo.getparent().findall("joint")}
    return len(gazebo) > 0 and gazebo.get("reference") in joints and all(known(f"robot/gazebo/{c.tag}") for c in gazebo)


def _left_out(row: Row | None) -> str:
    return f"is left out: {row.text}" if row is not None and row.text else "is left out"
