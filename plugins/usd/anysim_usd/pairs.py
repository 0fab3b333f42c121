"""Pairs of bodies that never collide: filtered pairs, and collision groups that keep each other out."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from anysim.assets.model import ImportNote
from anysim.model.world import Body
from anysim_usd.library import pxr
from anysim_usd.numbers import get
from anysim_usd.structure import Structure


def excluded_pairs(
    structure: Structure, bodies: Mapping[str, int], touched: Mapping[str, Sequence[Any]], known: Sequence[Body]
) -> tuple[frozenset[tuple[int, int]], list[ImportNote]]:
    """Pairs (low, high) of bodies of which no two shapes may collide; and notes on those of which some may.

    `bodies` are by the path of a part, and so are the prims that are `touched`.
    """
    apart = _filtered(structure)
    groups = _groups(structure)
    if not apart and not groups:
        return frozenset(), []
    shapes: dict[int, list[str]] = {}
    for part, body in bodies.items():
        shapes.setdefault(body, []).extend(str(prim.GetPath()) for prim in touched.get(part, ()))
    above = {path: _above(path) for paths in shapes.values() for path in paths}
    found: set[tuple[int, int]] = set()
    partly: list[str] = []
    for low, high in combinations(sorted(shapes), 2):
        if known[high].parent == low or not shapes[low] or not shapes[high]:
            continue
        kept = [
            bool({(a, b) for a in above[one] for b in above[other]} & apart) or _grouped(groups, one, other)
            for one in shapes[low]
            for other in shapes[high]
        ]
        if all(kept):
            found.add((low, high))
        elif any(kept):
            partly.append(f"{known[low].name} and {known[high].name}")
    notes = []
    if partly:
        some = ", ".join(partly[:3])
        text = f"keep apart only some shapes of {len(partly)} pairs of bodies, which all meet here: {some}"
        notes.append(ImportNote("dropped", "collision filters", text))
    return frozenset(found), notes


def _above(path: str) -> list[str]:
    """A path and those of what it is in."""
    parts = path.split("/")
    return ["/".join(parts[: i + 1]) for i in range(1, len(parts))]


def _filtered(structure: Structure) -> set[tuple[str, str]]:
    """Pairs of paths that are named by filtered pairs, both ways round."""
    found: set[tuple[str, str]] = set()
    for prim in structure.prims:
        relation = prim.GetRelationship("physics:filteredPairs")
        for target in relation.GetForwardedTargets() if relation else ():
            here, there = str(prim.GetPath()), str(target)
            found |= {(here, there), (there, here)}
    return found


class _Group:
    def __init__(self, path: str, members: Any, filtered: set[str], inverted: bool) -> None:
        self.path, self.members, self.filtered, self.inverted = path, members, filtered, inverted

    def keeps_out(self, other: "_Group") -> bool:
        return (other.path in self.filtered) is not self.inverted


def _groups(structure: Structure) -> list[_Group]:
    lib, found = pxr(), []
    for prim in structure.prims:
        if str(prim.GetTypeName()) != "PhysicsCollisionGroup":
            continue
        group = lib.UsdPhysics.CollisionGroup(prim)
        filtered = {str(target) for target in group.GetFilteredGroupsRel().GetForwardedTargets()}
        inverted = bool(get(prim, "physics:invertFilteredGroups"))
        query = group.GetCollidersCollectionAPI().ComputeMembershipQuery()
        found.append(_Group(str(prim.GetPath()), query, filtered, inverted))
    return found


def _grouped(groups: list[_Group], one: str, other: str) -> bool:
    """Whether two shapes are in groups of which either keeps the other out."""
    path = pxr().Sdf.Path
    first, second = ([g for g in groups if g.members.IsPathIncluded(path(shape))] for shape in (one, other))
    return any(a.keeps_out(b) or b.keeps_out(a) for a in first for b in second)
