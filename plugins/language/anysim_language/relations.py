"""Relations between things in whole millimetres: what lies on or in what, what is left of, behind or near what."""

from typing import NamedTuple

from anysim.model.shapes import Plane
from anysim_language.moment import Extent, Moment
from anysim_language.things import Thing

TOUCH = 8
"""A thing lies on what is at most so far [mm] below its lowest point, or as deep in it."""
APART = 40
"""Things are left of, or behind, each other from here on [mm]."""
NEAR = 100
"""Things whose boxes are at most so far [mm] from each other are near."""


class Support(NamedTuple):
    """What carries a thing: `relation` is `on` or `in`; `where` is a thing, or one of its parts as `cabinet.drawer_1`.

    `slack` [mm] is by how much all that decides it may change before it no longer holds.
    """

    relation: str
    where: str
    slack: int


GROUND = "ground"


def support(moment: Moment, thing: Thing) -> Support | None:
    """What a thing lies on or in; None for what is in the air."""
    box = moment.extent(thing.name)
    found: list[tuple[int, Support]] = []
    for other in moment.objects:
        if other.name == thing.name:
            continue
        entity = moment.world.entities[other.entity]
        for body in range(entity.body_start, entity.body_stop):
            part = "" if body == entity.root else moment.world.bodies[body].name.removeprefix(entity.name)
            for top, held in _held(moment, thing, box, other, body):
                found.append((top, Support(held[0], f"{other.name}{part}", held[1])))
    if found:
        inside = [one for one in found if one[1].relation == "in"]
        return max(inside or found, key=lambda one: (one[0], one[1].slack, one[1].where))[1]
    if abs(box.low[2]) <= TOUCH and _flat(moment):
        return Support("on", GROUND, TOUCH - abs(box.low[2]))
    return None


def _flat(moment: Moment) -> bool:
    """Whether the ground is at height 0 everywhere."""
    return any(isinstance(geom.shape, Plane) and geom.body < 0 for geom in moment.world.geoms)


def _held(moment: Moment, thing: Thing, box: Extent, other: Thing, body: int) -> list[tuple[int, tuple[str, int]]]:
    """Where a body carries a box: the height of each surface below it, how, and with which slack."""
    pieces = moment.pieces(body)
    if not pieces:
        return []
    x, y, _ = box.centre
    found: list[tuple[int, tuple[str, int]]] = []
    boxes = [piece.box for piece in pieces]
    bottom, brim = min(box.low[2] for box in boxes), max(box.high[2] for box in boxes)
    within = _within(boxes, x, y)
    if (other.words.container or _inside(moment, body)) and within > 0 and bottom - TOUCH <= box.low[2] < brim - TOUCH:
        return [(box.low[2], ("in", min(within, box.low[2] - bottom + TOUCH, brim - TOUCH - box.low[2])))]
    for piece in pieces:
        gap = abs(box.low[2] - piece.box.high[2])
        edge = piece.depth(x, y)
        if gap <= TOUCH and edge > 0:
            found.append((piece.box.high[2], ("on", min(edge, TOUCH - gap + 1))))
    return found


def _within(boxes: list[Extent], x: int, y: int) -> int:
    """How far [mm] a point of the plane is within all of some boxes together; not positive outside."""
    return min(
        x - min(box.low[0] for box in boxes),
        max(box.high[0] for box in boxes) - x,
        y - min(box.low[1] for box in boxes),
        max(box.high[1] for box in boxes) - y,
    )


def _inside(moment: Moment, body: int) -> bool:
    """Whether a body has a frame named `inside`, as drawers and trays have."""
    return any(site.body == body and site.name.rpartition(".")[2] == "inside" for site in moment.world.sites)


def direction(moment: Moment, a: str, b: str) -> tuple[str, int]:
    """How `a` is to `b` as the viewer sees it: `left`, `right`, `behind`, `before`, or nothing; and the slack [mm]."""
    viewer = moment.viewer
    side = viewer.lateral(moment.at(a)) - viewer.lateral(moment.at(b))
    ahead = viewer.ahead(moment.at(a)) - viewer.ahead(moment.at(b))
    if max(abs(side), abs(ahead)) < APART:
        return "", 0
    if abs(side) >= abs(ahead):
        return ("left" if side > 0 else "right"), min(abs(side) - APART, abs(side) - abs(ahead))
    return ("behind" if ahead > 0 else "before"), min(abs(ahead) - APART, abs(ahead) - abs(side))


def gap(a: Extent, b: Extent) -> int:
    """The distance between two boxes along their axes, whole millimetres of the largest one; 0 where they overlap."""
    return max(0, *(max(a.low[i] - b.high[i], b.low[i] - a.high[i]) for i in range(3)))
