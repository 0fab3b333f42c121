"""Things of a pack: builders of assets from the YAML files of a folder.

A pack is a Python package with such a folder, whose names are entry points of the group `anysim.assets`:

    [project.entry-points."anysim.assets"]
    teapot = "my_things.pack:teapot"

where `my_things/pack.py` has `__getattr__ = pack(Path(__file__).parent / "objects")`.
"""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.errors import SpecError, SpecIssue
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.affordances import Affordance
from anysim.model.hash import split, tidy
from anysim.model.world import Box, Capsule, Cylinder, JointType, Shape, Sphere, Vec3
from anysim_assets.assembly import Assembly, flared_boards, ring_boards
from anysim_household.spec import MaterialSpec, PackSpec, PieceSpec, ThingSpec
from anysim_schemas.base import Color
from anysim_schemas.errors import KeyFault
from anysim_schemas.load import load

MATERIALS = {
    "aluminium": MaterialSpec(density=2700.0, color=(0.78, 0.79, 0.81)),
    "cardboard": MaterialSpec(density=250.0, color=(0.72, 0.57, 0.38)),
    "ceramic": MaterialSpec(density=2400.0, color=(0.88, 0.87, 0.84)),
    "fabric": MaterialSpec(density=300.0, color=(0.45, 0.48, 0.55)),
    "foam": MaterialSpec(density=80.0, color=(0.95, 0.82, 0.25)),
    "food": MaterialSpec(density=950.0, color=(0.80, 0.62, 0.38)),
    "glass": MaterialSpec(density=2500.0, color=(0.72, 0.84, 0.86)),
    "paper": MaterialSpec(density=750.0, color=(0.93, 0.92, 0.88)),
    "plastic": MaterialSpec(density=1000.0, color=(0.32, 0.34, 0.38)),
    "rubber": MaterialSpec(density=1150.0, color=(0.13, 0.13, 0.14)),
    "steel": MaterialSpec(density=7800.0, color=(0.62, 0.64, 0.66)),
    "wood": MaterialSpec(density=650.0, color=(0.66, 0.46, 0.27)),
}
"""Densities [kg/m^3] share the mass of a thing out among its pieces."""

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class Solid(NamedTuple):
    """A convex part of a piece, in the piece's frame; `filled` is what counts for its mass."""

    shape: Shape
    at: Array
    turn: Array
    filled: Shape


def pack(folder: Path) -> Callable[[str], Callable[..., ImportedModel]]:
    """A module's `__getattr__` that finds the builders of a pack by name."""

    def find(name: str) -> Callable[..., ImportedModel]:
        if name.startswith("__") or name not in things(folder):
            raise AttributeError(f"the pack in {folder} has no thing '{name}'")
        return _builder(folder, name)

    return find


@cache
def things(folder: Path) -> dict[str, tuple[ThingSpec, dict[str, MaterialSpec]]]:
    """All things of a pack by name, with the materials of their file.

    Raises:
        SpecError: a file is wrong, with its line; or two have a thing of the same name.
    """
    found: dict[str, tuple[ThingSpec, dict[str, MaterialSpec]]] = {}
    for file in sorted(folder.glob("*.yaml")):
        said = load(PackSpec, file).spec
        if double := found.keys() & said.things.keys():
            words = f"another file of the pack has {', '.join(sorted(double))} already"
            raise SpecError([SpecIssue(str(file), "things", words)])
        found |= {name: (thing, MATERIALS | said.materials) for name, thing in said.things.items()}
    return found


@cache
def _builder(folder: Path, name: str) -> Callable[..., ImportedModel]:
    def build(*, color: Color | None = None) -> ImportedModel:
        return built(name, *things(folder)[name], color)

    thing, _ = things(folder)[name]
    moves = f", with moving parts: {', '.join(thing.links)}" if thing.links else ""
    build.__name__ = build.__qualname__ = name
    build.__doc__ = f"{name.replace('_', ' ').capitalize()} of {thing.mass:g} kg{moves}."
    return build


def built(name: str, thing: ThingSpec, materials: dict[str, MaterialSpec], color: Color | None = None) -> ImportedModel:
    """The model of a thing.

    Raises:
        KeyFault: a piece is of a material that nobody knows, or a shell or ring has no room inside.
    """
    body, numbers, origins = Assembly(name), {"base": 0}, {"base": np.zeros(3)}
    for key, link in thing.links.items():
        numbers[key] = body.link(
            key,
            link.at,
            JointType(link.joint),
            _unit(link.axis),
            lower=link.range[0],
            upper=link.range[1],
            friction=link.friction,
            damping=link.damping,
        )
        origins[key] = np.array(link.at)
    made = {key: list(solids(key, piece)) for key, piece in thing.pieces.items()}
    share = thing.mass / sum(
        _density(key, thing, materials) * inertia.volume(solid.filled, {}) for key, own in made.items() for solid in own
    )
    main = next(iter(thing.pieces.values())).of
    geoms: dict[str, list[str]] = {}
    for key, piece in thing.pieces.items():
        shown = materials[piece.of].color if piece.color is None else piece.color
        shown = color if color is not None and piece.of == main else shown
        turn = _turned(piece)
        for number, solid in enumerate(made[key], 1):
            label = key if len(made[key]) == 1 else f"{key}_{number}"
            geoms.setdefault(key, []).append(f"{piece.link}.{label}")
            at = np.array(piece.at) + P.rotate(turn, solid.at) - origins[piece.link]
            place, direction = split(np.array([*at, *P.multiply(turn, solid.turn)]))
            body.solid(
                numbers[piece.link],
                label,
                solid.shape,
                place,
                share * _density(key, thing, materials),
                shown,
                direction,
                filled=solid.filled,
                alpha=piece.alpha,
            )
    for key, frame in thing.frames.items():
        body.site(numbers[frame.link], key, tidy(np.array(frame.at) - origins[frame.link]))
    for key, afford in thing.affords.items():
        names = tuple(geom for piece in afford.pieces for geom in geoms[piece])
        joint = thing.frames[afford.at].link
        body.afford(
            Affordance(
                key, afford.kind, afford.at, names, afford.use, afford.approach, joint="" if joint == "base" else joint
            )
        )
    return body.model()


def solids(name: str, piece: PieceSpec) -> Iterator[Solid]:
    """The convex parts of a piece, in its own frame.

    Raises:
        KeyFault: a shell or a ring has no room inside.
    """
    none = np.zeros(3)
    if piece.box is not None:
        yield _whole(Box(tidy(np.array(piece.box) / 2)), none)
    elif piece.sphere is not None:
        yield _whole(Sphere(piece.sphere), none)
    elif piece.cylinder is not None:
        yield _whole(Cylinder(piece.cylinder[0], piece.cylinder[1] / 2), none)
    elif piece.capsule is not None:
        radius, length = piece.capsule
        if length <= 2 * radius:
            raise KeyFault(
                f"the capsule '{name}' is {length:g} m long with ends of {radius:g} m: make it a sphere", name
            )
        yield _whole(Capsule(radius, length / 2 - radius), none)
    elif piece.stack is not None:
        level = 0.0
        for radius, height in piece.stack:
            yield _whole(Cylinder(radius, height / 2), np.array([0.0, 0.0, level + height / 2]))
            level += height
    elif piece.shell is not None:
        said = piece.shell
        if said.wall >= min(said.height, said.foot) / 2:
            raise KeyFault(f"walls of {said.wall:g} m leave no room in the shell '{name}'", name)
        yield _whole(Cylinder(said.foot, said.wall / 2), np.array([0.0, 0.0, said.wall / 2]))
        mean = (said.foot + said.rim) / 2 / max(said.foot, said.rim)
        for board, at, turn in flared_boards(said.foot, said.rim, said.height, said.wall, said.boards):
            yield Solid(board, np.array(at), np.array(turn), _narrower(board, mean))
    elif piece.ring is not None:
        said = piece.ring
        if said.inner >= said.outer:
            raise KeyFault(f"the ring '{name}' has a hole of {said.inner:g} m in a radius of {said.outer:g} m", name)
        for board, at, turn, sector in ring_boards((said.inner, said.outer), said.height, said.boards):
            yield Solid(board, np.array(at), np.array(turn), sector)


def _whole(shape: Shape, at: Array) -> Solid:
    return Solid(shape, at, UPRIGHT, shape)


def _narrower(board: Box, share: float) -> Box:
    """Boards of a ring overlap outside: what counts is their mean width."""
    x, y, z = board.half_size
    return Box((x, y * share, z))


def _density(piece: str, thing: ThingSpec, materials: dict[str, MaterialSpec]) -> float:
    of = thing.pieces[piece].of
    if of not in materials:
        raise KeyFault(f"the piece '{piece}' is of '{of}'; there are: {', '.join(sorted(materials))}", piece)
    return materials[of].density


def _turned(piece: PieceSpec) -> Array:
    """The quaternion of a piece: about its own z, then z to `axis` by the shortest way."""
    spin = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(piece.yaw))
    z, to = np.array([0.0, 0.0, 1.0]), np.array(_unit(piece.axis))
    cross, cosine = np.cross(z, to), float(z @ to)
    if cosine < -1.0 + 1e-12:
        return P.multiply(np.array([1.0, 0.0, 0.0, 0.0]), spin)
    lean = np.array([*cross, 1.0 + cosine])
    return P.multiply(lean / np.linalg.norm(lean), spin)


def _unit(axis: Vec3) -> Vec3:
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        raise KeyFault("an axis has a length", "axis")
    return tidy(np.array(axis) / length)
