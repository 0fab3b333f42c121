"""Insertions: how the tip of one thing goes into the hole of another, with which turns about the hole's axis.

A candidate is the pose that the tip comes to, z ahead, in the frame of the body that the hole is in. The turns in
which it fits come from the shapes: a grid of turns is filtered by collision all along the way, and of each range of
turns that is free the middle is a candidate, or several where the range is wide, as that of a round peg.
"""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.affordance_lookup import (
    FoundAffordance,
    affordances_of,
    asset_hash,
    collision_geom,
    resolve_affordance,
)
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Body, BodyKind, EntityKind, Geom, Mesh, World
from anysim_banks.collision import geometry_of
from anysim_banks.pieces import Piece
from anysim_banks.sampling import Candidates
from anysim_banks.subject import pieces_about

AHEAD = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
"""Half a turn about x: from a tip, whose z points back along the thing, to the candidate's frame, whose z is ahead."""
STATIONS = 8
"""Of the way into the hole, at which nothing may touch."""
APART = np.pi / 8
"""[rad] between the candidates of a wide range of turns."""
UNSAID = 0.001
"""[m] clearance of a hole of which none is said."""


@dataclass(frozen=True, eq=False)
class Solid:
    """What collides of one entity, in the frame of one of its bodies, and that body."""

    pieces: tuple[Piece, ...]
    geoms: tuple[Geom, ...]
    meshes: tuple[Mesh, ...]
    body: Body


@dataclass(frozen=True, eq=False)
class Hole:
    """A hole, as `anysim_banks.method.About` has it.

    Attributes:
        frame: (7,) of its mouth in its body's frame, z out of it.
        around: its entity, joints at their initial positions.
    """

    asset: str
    affordance: Affordance
    hash: str
    link: int
    frame: Array
    around: Solid

    @property
    def place(self) -> str:
        """A digest of the affordance."""
        return hashlib.sha256(f"{self.affordance}".encode()).hexdigest()

    @property
    def clearance(self) -> float:
        """[m] to each side."""
        return self.affordance.clearance or UNSAID


@dataclass(frozen=True, eq=False)
class Peg:
    """What goes in, as `anysim_banks.method.Tool` has it; `tip` (7,) is in its root's frame, z back along it."""

    name: str
    hash: str
    tip: Array
    solid: Solid


@dataclass(frozen=True, eq=False)
class Insertions:
    """Insertions of a peg into a hole."""

    subject: Hole
    tool: Peg

    def sampled(self, count: int, rng: np.random.Generator) -> Candidates:
        """A grid of turns, the same whatever the seed."""
        del rng
        half = np.pi / count * np.arange(count)
        zero = np.zeros(count)
        turned = np.stack([zero, zero, zero - self.subject.affordance.depth, zero, zero, np.sin(half), np.cos(half)], 1)
        ends = P.compose(np.broadcast_to(self.subject.frame, turned.shape), turned)
        poses = P.unsigned(P.compose(ends, np.broadcast_to(AHEAD, ends.shape)))
        return Candidates(poses, zero, np.full(count, "insertion"), np.zeros(count, dtype=int))

    def free(self, candidates: Candidates) -> Array:
        """(n,) bool: middles of the ranges of turns in which the peg passes all of the way."""
        passes = np.array([self._passes(pose) for pose in candidates.pose], dtype=bool)
        chosen = np.zeros(len(passes), dtype=bool)
        for begin, length in _ranges(passes):
            wide = length * 2 * np.pi / len(passes)
            many = max(1, round(wide / APART))
            middles = begin + (np.arange(many) + 0.5) / many * length - (0.5 if many == 1 else 0.0)
            chosen[np.floor(middles).astype(int) % len(passes)] = True
        return chosen

    def trial(self, engine: str) -> Any:
        from anysim_banks.insertion_trial import InsertionTrial

        return InsertionTrial(self.subject, self.tool, engine)

    def about(self) -> Mapping[str, object]:
        from anysim_banks.insertion_trial import EASY, SEATED, TILT, TIMES

        test = {"easy": EASY, "times": list(TIMES), "seated": SEATED, "tilt": TILT}
        return {"tip": np.round(self.tool.tip, 9).tolist(), "depth": self.subject.affordance.depth, "test": test}

    def failed(self, raw: int, free: int, held: int) -> str:
        what = f"{self.tool.name} does not go into {self.subject.asset} {self.subject.affordance.name}"
        return f"{what}: of {raw} turns about its axis {free} are free, and in {held} it comes to its end"

    def _passes(self, pose: Array) -> bool:
        """Whether nothing touches from the mouth to shortly before the end."""
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        request, result = coal.CollisionRequest(), coal.CollisionResult()
        root = P.compose(P.compose(pose, AHEAD), P.inverse(self.tool.tip))
        back = P.rotate(pose[3:], np.array([0.0, 0.0, -1.0])) * self.subject.affordance.depth
        for share in np.linspace(0.98, 0.02, STATIONS):
            at = root + np.concatenate([(1.0 - share) * back, np.zeros(4)])
            for shape, local in self._pegs:
                here = P.compose(at, local)
                where = coal.Transform3s(P.to_matrix(here[3:]), here[:3])
                for other, there in self._walls:
                    result.clear()
                    if coal.collide(shape, where, other, there, request, result):
                        return False
        return True

    @cached_property
    def _pegs(self) -> list[tuple[Any, Array]]:
        return _made(self.tool.solid)

    @cached_property
    def _walls(self) -> list[tuple[Any, Any]]:
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        return [
            (shape, coal.Transform3s(P.to_matrix(pose[3:]), pose[:3])) for shape, pose in _made(self.subject.around)
        ]


def insertions(world: World, entity: str, only: str = "") -> Iterator[Insertions]:
    """Insertions of all free things of a World into the holes of one of its entities, or the hole that is named."""
    number = world.entity_numbers[entity]
    holes = [a for a in affordances_of(world, number) if a.kind is AffordanceKind.HOLE and only in ("", a.name)]
    for spec in holes:
        if spec.depth <= 0:
            raise AssetError(f"the hole '{entity}.{spec.name}' has no `depth` [m]; its asset declares it")
        for other, owner in enumerate(world.entities):
            free = owner.kind is EntityKind.OBJECT and world.bodies[owner.root].kind is BodyKind.FREE
            if other == number or not free:
                continue
            for tip in (a for a in affordances_of(world, other) if a.kind is AffordanceKind.TIP):
                found = resolve_affordance(world, other, tip)
                if found.frame.body == owner.root:
                    yield Insertions(_hole(world, resolve_affordance(world, number, spec)), _peg(world, found))


def _hole(world: World, found: FoundAffordance) -> Hole:
    owner, body = world.entities[found.entity], found.frame.body
    frame = np.array([*found.frame.position, *found.frame.quaternion])
    link, own = body - owner.body_start, asset_hash(world, owner, body)
    return Hole(owner.source or owner.name, found.spec, own, link, frame, _solid(world, found.entity, body))


def _peg(world: World, found: FoundAffordance) -> Peg:
    owner = world.entities[found.entity]
    tip = np.array([*found.frame.position, *found.frame.quaternion])
    own = asset_hash(world, owner, owner.root)
    return Peg(f"{owner.name}.{found.spec.name}", own, tip, _solid(world, found.entity, owner.root))


def _solid(world: World, entity: int, number: int) -> Solid:
    pieces: list[Piece] = []
    geoms: list[Geom] = []
    for geom, piece in pieces_about(world, world.entities[entity], number):
        x, y, z, *turn = piece.pose.tolist()
        pieces.append(piece)
        moved = replace(collision_geom(world.geoms[geom], 0), position=(x, y, z), quaternion=tuple(turn))
        geoms.append(replace(moved, name=f"piece{len(geoms)}"))
    used = {getattr(geom.shape, "mesh", "") for geom in geoms}
    meshes = tuple(mesh for mesh in world.meshes if mesh.name in used)
    inertial = world.bodies[number].inertial
    return Solid(tuple(pieces), tuple(geoms), meshes, Body("", BodyKind.FREE, inertial=inertial))


def _made(solid: Solid) -> list[tuple[Any, Array]]:
    return [(geometry_of(piece), piece.pose) for piece in solid.pieces]


def _ranges(passes: Array) -> list[tuple[int, int]]:
    """Where ranges of neighbours on a circle that are true begin, and how many each has."""
    if passes.all():
        return [(0, len(passes))]
    start = int(np.argmin(passes))  # at one that is false no range wraps
    found: list[tuple[int, int]] = []
    begin = -1
    for step in range(1, len(passes) + 1):
        at = (start + step) % len(passes)
        if passes[at] and begin < 0:
            begin = start + step
        elif not passes[at] and begin >= 0:
            found.append((begin, start + step - begin))
            begin = -1
    return found
