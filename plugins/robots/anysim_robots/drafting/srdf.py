"""SRDF files beside a model: groups of joints, poses by name, and pairs of links that never collide."""

from collections.abc import Iterator, Mapping
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from anysim.assets.bounded_files import xml_root
from anysim.assets.model import ImportedModel, ImportNote
from anysim.errors import AssetError, listing

_READ = frozenset({"group", "group_state", "disable_collisions"})
_WHY = {
    "end_effector": "tools and channels are those of the draft",
    "virtual_joint": "the base is that of the draft",
    "passive_joint": "what drives a joint is said by its channel",
    "chain": "it is a planner's",
}


class Srdf(NamedTuple):
    """Joints by group, positions by the name of a pose and by joint, and pairs of links."""

    file: Path
    groups: Mapping[str, tuple[str, ...]]
    poses: Mapping[str, Mapping[str, float]]
    apart: tuple[tuple[str, str], ...]
    notes: tuple[ImportNote, ...]


def beside(file: Path) -> Path | None:
    """The SRDF file of a model: of the same name in its folder or in `srdf` beside it, else the only one there."""
    stem = file.name.split(".")[0]
    for folder in (file.parent, file.parent / "srdf", file.parent.parent / "srdf"):
        if (folder / f"{stem}.srdf").is_file():
            return folder / f"{stem}.srdf"
    found = sorted((file.parent.parent / "srdf").glob("*.srdf")) if file.parent.parent.is_dir() else []
    return found[0] if len(found) == 1 else None


def read(file: Path, model: ImportedModel) -> Srdf:
    """What an SRDF file says of a model; names that the model does not have are left out with a note.

    Raises:
        AssetError: a missing or damaged file, a group that contains itself, a position that is no number.
    """
    root, _ = xml_root(file)
    if root.tag != "robot":
        raise AssetError(f"{file}: an SRDF has the root element <robot>, this one has <{root.tag}>")
    reader = _Reader(file, root, model)
    groups = {name: joints for name in reader.elements if (joints := reader.group(name, ()))}
    poses = reader.poses()
    apart = tuple(dict.fromkeys(reader.apart()))
    reader.unread()
    return Srdf(file, groups, poses, apart, tuple(reader.notes))


class _Reader:
    def __init__(self, file: Path, root: Any, model: ImportedModel) -> None:
        self.file, self.root, self.model = file, root, model
        self.notes: list[ImportNote] = []
        self.moving = {joint.name: joint for joint in model.joints}
        self.elements = {g.get("name"): g for g in root.findall("group") if g.get("name") and len(g)}
        self.unknown: dict[str, list[str]] = {}

    def group(self, name: str, above: tuple[str, ...]) -> tuple[str, ...]:
        """The joints of a group that move, followers left out, in the model's order."""
        if name in above:
            raise AssetError(f"{self.file}: the group '{name}' contains itself")
        found: set[str] = set()
        for part in self.elements[name]:
            own = part.get("name") or ""
            if part.tag == "joint":
                found.add(own)
            elif part.tag == "link":
                body = self.model.links.get(own)
                found |= {joint.name for joint in self.model.joints if joint.body == body}
            elif part.tag == "chain":
                found |= set(self._chain(part.get("base_link") or "", part.get("tip_link") or ""))
            elif part.tag == "group" and own in self.elements:
                found |= set(self.group(own, (*above, name)))
            else:
                self.unknown.setdefault(f"<{part.tag}> of a group", []).append(own or name)
        return tuple(n for n, joint in self.moving.items() if n in found and joint.mimic is None)

    def _chain(self, base: str, tip: str) -> Iterator[str]:
        links = self.model.links
        if base not in links or tip not in links:
            self.unknown.setdefault("<chain>", []).append(f"{base} to {tip}")
            return
        body, joints = links[tip], {joint.body: joint.name for joint in self.model.joints}
        while body != links[base] and body in joints:
            yield joints[body]
            body = self.model.bodies[body].parent

    def poses(self) -> dict[str, dict[str, float]]:
        """Positions of joints by pose; those of several groups with one name are one pose."""
        found: dict[str, dict[str, float]] = {}
        for state in self.root.findall("group_state"):
            pose = found.setdefault(state.get("name") or "", {})
            for part in state.findall("joint"):
                name, words = part.get("name") or "", (part.get("value") or "").split()
                if name not in self.moving or len(words) != 1:
                    self.unknown.setdefault("<joint> of a <group_state>", []).append(name)
                    continue
                try:
                    value = float(words[0])
                except ValueError:
                    value = float("nan")
                if not isfinite(value):
                    raise AssetError(f"{self.file}:{part.sourceline}: the position of '{name}' is '{words[0][:40]}'")
                pose[name] = value
        return found

    def apart(self) -> Iterator[tuple[str, str]]:
        """Pairs of links of the model that never collide."""
        for pair in self.root.findall("disable_collisions"):
            one, other = pair.get("link1") or "", pair.get("link2") or ""
            if one in self.model.links and other in self.model.links:
                yield one, other
            else:
                self.unknown.setdefault("<disable_collisions>", []).append(f"{one} and {other}")

    def unread(self) -> None:
        """Notes on what the model does not have, and on elements that are not read."""
        for what, names in self.unknown.items():
            text = f"is left out: the model has no such part ({len(names)}: {listing(dict.fromkeys(names), 3)})"
            self.notes.append(ImportNote("dropped", f"{what} of {self.file.name}", text))
        tags = [str(element.tag) for element in self.root]
        for tag in dict.fromkeys(tag for tag in tags if tag not in _READ):
            why = f"is left out: {_WHY.get(tag, 'it is no part of a draft')} ({tags.count(tag)})"
            self.notes.append(ImportNote("dropped", f"<{tag}> of {self.file.name}", why))
