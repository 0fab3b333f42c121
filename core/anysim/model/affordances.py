"""Affordances: where and how a thing is taken hold of, pressed, or put into, declared by its asset.

An asset says it in local names, so that it holds in whatever World the asset stands.
`anysim.model.affordance_lookup` finds them there.
"""

from dataclasses import dataclass
from enum import StrEnum
from math import pi

from anysim.model.shapes import Vec3


class AffordanceKind(StrEnum):
    """What a hand does with it follows from this."""

    HANDLE = "handle"  # a bar or a knob: closed around
    RIM = "rim"  # an edge: pinched
    BODY = "body"  # the thing itself: closed around
    HOLE = "hole"  # something goes in, along -z of its frame
    BUTTON = "button"  # pressed, along -z of its frame
    LEVER = "lever"  # held or pushed at its end
    HOOK = "hook"  # something is hung on it
    TIP = "tip"  # what touches others: the end of a tool


@dataclass(frozen=True, slots=True)
class Affordance:
    """One affordance of an asset, in the asset's own names.

    Attributes:
        name: such as `drawer_1.handle`; in a World the entity's name is in front of it.
        frame: the link or site that it is at; empty for the root. What is below is along this frame's axes.
        pieces: the geoms that are taken hold of; empty for one that has none, such as a hole.
        use: what it is for, such as `open` and `carry`.
        approach: directions in which a tool may move onto it; empty for any.
        roll: range [rad] by which those directions may be turned about the frame's z, the axis of a bar.
        joint: what moves with it, empty for what does not move by itself.
        depth: of a hole, and the travel of a button [m].
        clearance: between a hole and what fits, to each side [m].
    """

    name: str
    kind: AffordanceKind
    frame: str = ""
    pieces: tuple[str, ...] = ()
    use: tuple[str, ...] = ()
    approach: tuple[Vec3, ...] = ()
    roll: tuple[float, float] = (-pi, pi)
    joint: str = ""
    depth: float = 0.0
    clearance: float = 0.0
