"""Types that the parameters of builders have in common."""

from math import pi
from typing import Annotated, Literal

from pydantic import Field, Strict

from anysim_schemas.base import Positive, Spec

Size = tuple[Positive, Positive, Positive]
"""Full outer edge lengths x, y, z [m]."""

Angle = Annotated[float, Strict(), Field(gt=0, le=pi)]
"""How far something opens [rad]."""


class Handle(Spec):
    """What a hand takes hold of. A round bar of 16 mm keeps its grip where a square one is levered out of the fingers.

    A bar is a capsule on two posts, a knob a disc on a stem.
    """

    style: Literal["bar", "knob", "none"] = Field(default="bar", description="a bar on two posts, a knob, or nothing")
    direction: Literal["auto", "horizontal", "vertical"] = Field(
        default="auto", description="of a bar; auto: vertical on doors, horizontal on drawers and lids"
    )
    length: Positive = Field(default=0.12, description="straight part of a bar [m]")
    radius: Positive = Field(default=0.008, description="of a bar, and half that of a knob's disc [m]")
    standoff: Positive = Field(default=0.04, description="from the front to the middle of the bar, or of the disc [m]")
    density: Positive = Field(default=2700.0, description="[kg/m^3], aluminium")
