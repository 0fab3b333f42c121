"""The bodies of a stage, the joints between them, and the trees that these make."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from anysim.assets.model import ImportNote
from anysim.conventions import Array
from anysim.errors import AssetError, listing, suggest
from anysim.math import pose as P
from anysim_usd.coverage import JOINTS
from anysim_usd.library import pxr
from anysim_usd.numbers import DIRECTIONS, directions, get, quaternion, vector
from anysim_usd.space import IDENTITY, Space

BASE = ""
"""The path of what stands still: the world of the stage."""


class Part(NamedTuple):
    """A rigid body: its prim, its name among all of them, and where its frame (7,) is."""

    path: str
    name: str
    prim: Any
    frame: Array
    still: bool


class Tie(NamedTuple):
    """A joint between two parts, and its frames (7,) in theirs; `BASE` stands for the world."""

    path: str
    name: str
    prim: Any
    kind: str
    ends: tuple[str, str]
    frames: tuple[Array, Array]

    def turned(self, parent: str) -> "Tie":
        """The joint with the parent first; `forward` of a joint tells whether that is its own order."""
        return self if self.ends[0] == parent else self._replace(ends=self.ends[::-1], frames=self.frames[::-1])


@dataclass
class Tree:
    """Parts that joints tie to one root, parents before children; `fixed` where the root stands still.

    `ties` are those by which each part but the root is carried, by the part's path; `further` the others between the
    same two, as MuJoCo writes a body of several joints: each moves on from where the one before it has led.
    """

    path: str
    root: str
    fixed: bool
    parts: list[str] = field(default_factory=list)
    ties: dict[str, Tie] = field(default_factory=dict)
    further: dict[str, list[Tie]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """What it is called: the prim that holds it."""
        return self.path.rpartition("/")[2]


class Structure:
    """What of a stage moves, by the paths of prims.

    `prims` are all that count, instances unfolded; `owner` is the part that a prim belongs to, or `BASE`.
    """

    def __init__(self, stage: Any, path: Path, space: Space, notes: list[ImportNote]) -> None:
        lib = pxr()
        self.stage, self.path, self.space, self.notes = stage, path, space, notes
        everything = lib.Usd.TraverseInstanceProxies(lib.Usd.PrimDefaultPredicate)
        self.prims = list(lib.Usd.PrimRange.Stage(stage, everything))
        self.parts: dict[str, Part] = {}
        self.owner: dict[str, str] = {BASE: BASE}
        bodies = [prim for prim in self.prims if self._is_body(prim)]
        moving = {str(prim.GetPath()) for prim in bodies}
        for prim in self.prims:
            here = str(prim.GetPath())
            self.owner[here] = here if here in moving else self.owner[str(prim.GetPath().GetParentPath()).rstrip("/")]
            if here in moving:
                still = bool(get(prim, "physics:kinematicEnabled"))
                self.parts[here] = Part(here, _called(prim), prim, space.of(prim).pose, still)
                if still:
                    self._note(
                        "info", f"body '{_called(prim)}'", "is kinematic: it stands still here, until it is moved"
                    )
        self.ties = list(self._ties())
        self.trees = list(self._trees())
        for tree in self.trees:
            self._name_apart(tree)

    def _note(self, kind: Any, where: str, message: str) -> None:
        self.notes.append(ImportNote(kind, where, message))

    def _is_body(self, prim: Any) -> bool:
        lib = pxr()
        if not prim.HasAPI(lib.UsdPhysics.RigidBodyAPI) or not prim.IsA(lib.UsdGeom.Xformable):
            return False
        return get(prim, "physics:rigidBodyEnabled") is not False

    # ------------------------------------------------------------------ joints

    def _ties(self) -> Iterator[Tie]:
        for prim in self.prims:
            if str(prim.GetTypeName()) not in JOINTS:
                continue
            path, name = str(prim.GetPath()), _called(prim)
            where = f"joint '{name}'"
            if get(prim, "physics:jointEnabled") is False:
                self._note("dropped", where, "is disabled, and left out")
                continue
            if str(prim.GetTypeName()) == "PhysicsJoint" and len(directions(prim)) == len(DIRECTIONS):
                self._note("dropped", where, "leaves all directions free, and is left out")
                continue
            ends, frames = list[str](), list[Array]()
            for side in ("0", "1"):
                owner, frame = self._end(prim, side, where)
                ends.append(owner)
                frames.append(frame)
            if ends[0] == ends[1]:
                what = "the world" if ends[0] == BASE else f"'{self.parts[ends[0]].name}'"
                self._note("dropped", where, f"ties {what} to itself, and is left out")
                continue
            yield Tie(path, name, prim, str(prim.GetTypeName()), (ends[0], ends[1]), (frames[0], frames[1]))

    def _end(self, joint: Any, side: str, where: str) -> tuple[str, Array]:
        """The part at one end of a joint, and the joint's frame (7,) in it."""
        relation = joint.GetRelationship(f"physics:body{side}")
        targets = relation.GetForwardedTargets() if relation else []
        local = vector(joint, f"physics:localPos{side}", (0.0, 0.0, 0.0)) * self.space.metres
        turn = quaternion(joint, f"physics:localRot{side}")
        if len(targets) > 1:
            raise AssetError(
                f"{self.path}: {where} has {len(targets)} bodies at one end, {listing(map(str, targets), 4)}"
            )
        if not targets:
            return BASE, P.compose(self.space.up, np_pose(local, turn))
        prim = self.stage.GetPrimAtPath(targets[0])
        if not prim:
            raise AssetError(f"{self.path}: {where} refers to the body '{targets[0]}', which does not exist")
        place = self.space.of(prim)
        owner = self.owner.get(str(prim.GetPath()), BASE)
        here = np_pose(place.point(local), P.multiply(place.pose[3:], turn))
        return owner, here if owner == BASE else P.compose(P.inverse(self.parts[owner].frame), here)

    # ------------------------------------------------------------------ trees

    def _trees(self) -> Iterator[Tree]:
        beside: dict[str, list[Tie]] = {path: [] for path in (BASE, *self.parts)}
        for tie in self.ties:
            if not get(tie.prim, "physics:excludeFromArticulation"):
                for end in tie.ends:
                    beside[end].append(tie)
        seen: set[str] = set()
        for start in self.parts:
            if start in seen:
                continue
            group = self._reached(start, beside)
            seen |= group
            yield self._tree(group, beside)

    def _name_apart(self, tree: Tree) -> None:
        """Give what is called the same in a tree the names of what it is in as well."""
        parts = [part for part in tree.parts if part != BASE]
        for path, name in unique({path: self.parts[path].name for path in parts}).items():
            self.parts[path] = self.parts[path]._replace(name=name)
        ties = {tie.path: part for part, tie in tree.ties.items()}
        for path, name in unique({path: tree.ties[part].name for path, part in ties.items()}).items():
            tree.ties[ties[path]] = tree.ties[ties[path]]._replace(name=name)

    def _reached(self, start: str, beside: dict[str, list[Tie]]) -> set[str]:
        found, waiting = {start}, [start]
        while waiting:
            for tie in beside[waiting.pop()]:
                for end in tie.ends:
                    if end != BASE and end not in found:
                        found.add(end)
                        waiting.append(end)
        return found

    def _tree(self, group: set[str], beside: dict[str, list[Tie]]) -> Tree:
        members = [path for path in self.parts if path in group]
        ground = [tie for tie in beside[BASE] if set(tie.ends) & group]
        welded = [tie for tie in ground if tie.kind == "PhysicsFixedJoint"]
        if welded:
            root, fixed = next(end for end in welded[0].ends if end != BASE), True
            ground.remove(welded[0])
        elif ground:
            root, fixed = BASE, True
        else:
            root = self._carrier(members, beside)
            fixed = self.parts[root].still
        tree = Tree(self._holder(members), root, fixed, [root])
        known, waiting = {root}, [root]
        used: set[str] = {welded[0].path} if welded else set()
        while waiting:
            here = waiting.pop()
            if here != root:
                tree.parts.append(here)
            below = []
            for tie in beside[here]:
                other = tie.ends[1] if tie.ends[0] == here else tie.ends[0]
                if tie.path in used or other not in group:
                    continue
                used.add(tie.path)
                if other in below and tie.kind != "PhysicsFixedJoint" != tree.ties[other].kind:
                    tree.further.setdefault(other, []).append(tie.turned(here))
                    continue
                if other in known:
                    self._loop(tie)
                known.add(other)
                tree.ties[other] = tie.turned(here)
                below.append(other)
            waiting += reversed(below)
        for tie in ground:
            if tie.path not in used:
                self._loop(tie)
        return tree

    def _loop(self, tie: Tie) -> None:
        raise AssetError(
            f"{self.path}: joint '{tie.name}' closes a loop, which is not supported; set its "
            "physics:excludeFromArticulation, and it is left out"
        )

    def _carrier(self, members: list[str], beside: dict[str, list[Tie]]) -> str:
        """The root of what floats: what is said to be, else what no joint carries, else what stands first."""
        lib = pxr()
        for prim in (self.parts[path].prim for path in members):
            if prim.HasAPI(lib.UsdPhysics.ArticulationRootAPI):
                return str(prim.GetPath())
        carried = {tie.ends[1] for path in members for tie in beside[path]}
        return next((path for path in members if path not in carried), members[0])

    def _holder(self, members: list[str]) -> str:
        """What a tree is: the component of the stage that holds it, else the innermost prim that does."""
        split = [path.split("/") for path in members]
        common = [level[0] for level in zip(*split, strict=False) if len(set(level)) == 1]
        for depth in range(len(common), 1, -1):
            path = "/".join(common[:depth])
            if any(p not in members and p.startswith(f"{path}/") for p in self.parts):
                break
            if str(pxr().Usd.ModelAPI(self.stage.GetPrimAtPath(path)).GetKind()) == "component":
                return path
        path = "/".join(common)
        holds_others = any(p not in members and p.startswith(f"{path}/") for p in self.parts)
        return members[0] if len(common) < 2 or holds_others else path

    def chosen(self, name: str) -> Tree | None:
        """The tree that a name means, or the only one; None where nothing moves.

        Raises:
            AssetError: several, and none is named; no tree of that name.
        """
        if not name:
            if len(self.trees) > 1:
                names = [self._short(tree) for tree in self.trees]
                raise AssetError(
                    f"{self.path}: holds {len(names)} trees of bodies, {listing(names, 6)}; name the one that is "
                    f"meant: {self.path.name}#{names[0]}"
                )
            return self.trees[0] if self.trees else None
        found = [tree for tree in self.trees if name in self.names_of(tree)]
        if len(found) == 1:
            return found[0]
        known = [self._short(tree) for tree in self.trees]
        raise AssetError(
            f"{self.path}: there {'is no' if not found else 'are several'} '{name}'{suggest(name, known)} "
            f"(trees of bodies: {listing(known, 8)}); name one by its path, without the first slash"
        )

    def names_of(self, tree: Tree) -> tuple[str, ...]:
        """What a tree is called by: its path, its name, and the name of its root."""
        root = () if tree.root == BASE else (self.parts[tree.root].name, tree.root.lstrip("/"))
        return (tree.path.lstrip("/"), tree.name, *root)

    def _short(self, tree: Tree) -> str:
        """A name that means this tree alone."""
        names = [other.name for other in self.trees]
        return tree.name if names.count(tree.name) == 1 else tree.path.lstrip("/")

    def root_frame(self, tree: Tree) -> Array:
        """Where the frame (7,) of a model's root is: that of the body, but with z up where the stage has y up."""
        if tree.root == BASE:
            return IDENTITY
        frame = self.parts[tree.root].frame
        return frame if self.space.upright else np_pose(frame[:3], IDENTITY[3:])


def np_pose(position: Array, quaternion_: Array) -> Array:
    """A pose (7,) of arrays."""
    return P.pose(position, quaternion_)


def _called(prim: Any) -> str:
    name = get(prim, "anysim:name")
    return str(name) if name else prim.GetName()


def unique(names: dict[str, str]) -> dict[str, str]:
    """By path a name that no other path has: the last names of the path, as many as it takes."""
    found = dict(names)
    for depth in range(1, 64):
        taken: dict[str, list[str]] = {}
        for path, name in found.items():
            taken.setdefault(name, []).append(path)
        several = [path for paths in taken.values() if len(paths) > 1 for path in paths]
        if not several:
            return found
        for path in several:
            before = path.strip("/").split("/")[:-1]
            found[path] = "_".join([*before[-depth:], names[path]]) if depth <= len(before) else found[path]
    return {path: f"{name}_{i}" for i, (path, name) in enumerate(found.items())}
