"""Pegs and the blocks with a hole that they fit into, square and round."""

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Cylinder
from anysim_assets.assembly import Assembly, ring, turned
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

Section = Literal["square", "round"]


def hole(depth: float, clearance: float) -> Affordance:
    """A hole at the frame `mouth`, `depth` [m] from there to its end, with `clearance` [m] to each side."""
    return Affordance("mouth", AffordanceKind.HOLE, "mouth", use=("insert",), depth=depth, clearance=clearance)


def peg(
    *,
    section: Section = "square",
    width: Positive = 0.03,
    length: Positive = 0.1,
    along: Literal["x", "z"] = "z",
    density: Positive = 1100.0,
    color: Color = (0.85, 0.55, 0.15),
) -> ImportedModel:
    """A peg, its frame in its middle. Frames: `tip` in the middle of its lower end, `head` of its upper one.

    Affordance: `tip`, which goes into a hole.

    Args:
        section: of the peg.
        width: edge length of a square peg, diameter of a round one [m].
        length: [m].
        along: the axis from `tip` to `head`; a peg along x lies where it is put. The frames' z is that axis.
        density: [kg/m^3].
        color: of the peg.
    """
    body = Assembly("peg")
    body.afford(Affordance("tip", AffordanceKind.TIP, "tip", ("base.shaft",), ("insert",)))
    half = width / 2
    shape = Box((half, half, length / 2)) if section == "square" else Cylinder(half, length / 2)
    if along == "z":
        body.solid(0, "shaft", shape, (0.0, 0.0, 0.0), density, color)
        body.site(0, "tip", (0.0, 0.0, -length / 2))
        body.site(0, "head", (0.0, 0.0, length / 2))
        return body.model()
    turn = turned((0.0, 1.0, 0.0), pi / 2)
    body.solid(0, "shaft", shape, (0.0, 0.0, 0.0), density, color, turn)
    body.site(0, "tip", (-length / 2, 0.0, 0.0), turn)
    body.site(0, "head", (length / 2, 0.0, 0.0), turn)
    return body.model()


def hole_block(
    *,
    section: Section = "square",
    width: Positive = 0.03,
    clearance: Positive = 0.003,
    size: Positive = 0.1,
    height: Positive = 0.05,
    pieces: Annotated[int, Field(ge=8, le=48, description="boxes of a round hole's ring")] = 12,
    density: Positive = 1100.0,
    color: Color = (0.35, 0.42, 0.55),
) -> ImportedModel:
    """A block with a hole through it for a peg; its frame is in the middle of its bottom, where the hole ends.

    Boxes around the hole, so that each engine has the same hole. Frames: `hole`, the lower end of the hole, and
    `mouth`, its upper end, both with z out of it. Affordance: `mouth`.

    Args:
        section: of the hole.
        width: that of the peg: edge length, or diameter [m].
        clearance: between the peg in the middle and the hole, on each side [m]; of a ring to the middle of a box.
        size: outer edge length of the block, or diameter of the ring [m].
        height: [m].
        pieces: boxes around a round hole.
        density: [kg/m^3].
        color: of the block.

    Raises:
        KeyFault: the hole is not smaller than the block.
    """
    inner, outer = width / 2 + clearance, size / 2
    if inner >= 0.9 * outer:
        raise KeyFault(f"a hole of {2 * inner:g} m leaves no walls in a block of {size:g} m", "size")
    body = Assembly("hole_block")
    if section == "square":
        for name, low, high in (
            ("back", (-outer, -outer, 0.0), (-inner, outer, height)),
            ("front", (inner, -outer, 0.0), (outer, outer, height)),
            ("right", (-inner, -outer, 0.0), (inner, -inner, height)),
            ("left", (-inner, inner, 0.0), (inner, outer, height)),
        ):
            body.board(0, name, low, high, density, color)
    else:
        ring(body, 0, "piece", (inner, outer), height, pieces, density, color)
    body.site(0, "hole", (0.0, 0.0, 0.0))
    body.site(0, "mouth", (0.0, 0.0, height))
    body.afford(hole(height, clearance))
    return body.model()


def side_hole(
    *,
    width: Positive = 0.04,
    clearance: Positive = 0.003,
    depth: Positive = 0.08,
    size: Positive = 0.16,
    density: Positive = 1100.0,
    color: Color = (0.35, 0.42, 0.55),
) -> ImportedModel:
    """A standing block with a square hole through it along x, in the middle of its height; its frame is at its bottom.

    Four boxes around the hole. Frames: `hole`, the far end of the hole, and `mouth`, the near one, both with z out of
    the mouth, against the block's x. Affordance: `mouth`.

    Args:
        width: edge length of the peg [m].
        clearance: between the peg in the middle and the hole, on each side [m].
        depth: of the block along x [m].
        size: of the block along y and z [m].
        density: [kg/m^3].
        color: of the block.

    Raises:
        KeyFault: the hole is not smaller than the block.
    """
    inner, outer, half = width / 2 + clearance, size / 2, depth / 2
    if inner >= 0.9 * outer:
        raise KeyFault(f"a hole of {2 * inner:g} m leaves no walls in a block of {size:g} m", "size")
    body = Assembly("side_hole")
    for name, low, high in (
        ("below", (-half, -outer, 0.0), (half, outer, outer - inner)),
        ("above", (-half, -outer, outer + inner), (half, outer, size)),
        ("right", (-half, -outer, outer - inner), (half, -inner, outer + inner)),
        ("left", (-half, inner, outer - inner), (half, outer, outer + inner)),
    ):
        body.board(0, name, low, high, density, color)
    out = turned((0.0, 1.0, 0.0), -pi / 2)
    body.site(0, "hole", (half, 0.0, outer), out)
    body.site(0, "mouth", (-half, 0.0, outer), out)
    body.afford(hole(depth, clearance))
    return body.model()
