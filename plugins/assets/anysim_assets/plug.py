"""Plugs with prongs, and the sockets with slots that they fit into."""

from typing import Annotated

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim_assets.assembly import Assembly
from anysim_assets.insertion import hole
from anysim_assets.parameters import Size
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

Prongs = Annotated[int, Field(ge=1, le=2)]


def plug(
    *,
    prongs: Prongs = 2,
    prong: Size = (0.0015, 0.0064, 0.016),
    spacing: Positive = 0.007,
    size: Size = (0.03, 0.024, 0.04),
    density: Positive = 1200.0,
    color: Color = (0.92, 0.92, 0.90),
    prong_color: Color = (0.80, 0.68, 0.35),
) -> ImportedModel:
    """A plug along z, its frame in the middle of its body; one or two prongs side by side along x point along -z.

    Frames: `tip` between the prongs' lower ends, `head` in the middle of the body's upper face.

    Args:
        prongs: one, as of a USB plug, or two, as of a charger.
        prong: size of a prong [m].
        spacing: between the middles of two prongs [m].
        size: of the body [m].
        density: [kg/m^3].
        color: of the body.
        prong_color: of the prongs.

    Raises:
        KeyFault: the prongs overlap, or are not within the body's outline.
    """
    places = _places("prong", prongs, prong, spacing, 0.0)
    if places[-1] + prong[0] / 2 > size[0] / 2 or prong[1] > size[1]:
        raise KeyFault(f"the prongs do not fit below a body of {size[0]:g} x {size[1]:g} m", "size")
    body = Assembly("plug")
    width, depth, height = (edge / 2 for edge in size)
    body.board(0, "body", (-width, -depth, -height), (width, depth, height), density, color)
    for number, x in enumerate(places, 1):
        low = (x - prong[0] / 2, -prong[1] / 2, -height - prong[2])
        body.board(0, f"prong_{number}", low, (x + prong[0] / 2, prong[1] / 2, -height), density, prong_color)
    body.site(0, "tip", (0.0, 0.0, -height - prong[2]))
    body.site(0, "head", (0.0, 0.0, height))
    body.afford(Affordance("body", AffordanceKind.BODY, "", ("base.body",), ("carry", "insert")))
    pieces = tuple(f"base.prong_{number + 1}" for number in range(prongs))
    body.afford(Affordance("tip", AffordanceKind.TIP, "tip", pieces, ("insert",)))
    return body.model()


def socket(
    *,
    prongs: Prongs = 2,
    prong: Size = (0.0015, 0.0064, 0.016),
    spacing: Positive = 0.007,
    clearance: Positive = 0.0005,
    size: Size = (0.1, 0.1, 0.02),
    density: Positive = 1200.0,
    color: Color = (0.35, 0.42, 0.55),
) -> ImportedModel:
    """A block with a slot through it for each prong of a plug; its frame is in the middle of its bottom.

    Boxes around the slots, so that each engine has the same slots. Frames: `mouth` between the slots at the upper
    face, and `hole`, which is as far below it as a prong is long; z out of both. The slots turn as the plug's prongs:
    it fits in both ways round.

    Args:
        prongs: one or two.
        prong: size of a prong of the plug [m].
        spacing: between the middles of two slots [m].
        clearance: between a prong in the middle of its slot and the slot, to each side [m].
        size: of the block [m].
        density: [kg/m^3].
        color: of the block.

    Raises:
        KeyFault: the slots run into one another, are deeper than the block or leave no walls.
    """
    places = _places("slot", prongs, prong, spacing, clearance)
    half, deep = prong[0] / 2 + clearance, prong[1] / 2 + clearance
    if prong[2] > size[2]:
        raise KeyFault(f"a prong of {prong[2]:g} m does not fit into a block {size[2]:g} m high", "size")
    width, depth, height = size[0] / 2, size[1] / 2, size[2]
    if places[-1] + half >= 0.9 * width or deep >= 0.9 * depth:
        raise KeyFault(f"the slots leave no walls in a block of {size[0]:g} x {size[1]:g} m", "size")
    body = Assembly("socket")
    body.board(0, "right", (-width, -depth, 0.0), (width, -deep, height), density, color)
    body.board(0, "left", (-width, deep, 0.0), (width, depth, height), density, color)
    edges = [-width, *(edge for x in places for edge in (x - half, x + half)), width]
    for number, (low, high) in enumerate(zip(edges[::2], edges[1::2], strict=True), 1):
        body.board(0, f"wall_{number}", (low, -deep, 0.0), (high, deep, height), density, color)
    body.site(0, "hole", (0.0, 0.0, height - prong[2]))
    body.site(0, "mouth", (0.0, 0.0, height))
    body.afford(hole(prong[2], clearance))
    return body.model()


def _places(what: str, prongs: int, prong: Size, spacing: float, clearance: float) -> tuple[float, ...]:
    """Where the middles of the prongs or slots are along x [m]."""
    if prongs == 1:
        return (0.0,)
    if spacing <= prong[0] + 2 * clearance:
        raise KeyFault(f"a spacing of {spacing:g} m lets the two {what}s run into one another", "spacing")
    return (-spacing / 2, spacing / 2)
