"""Parameters of garments: their cut, their cloth, and the pads that hold them. What is drawn is drawn each episode."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from anysim_schemas.base import Name, NonNegative, Positive, Reference, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import NonNegativeValue, PositiveValue, Value
from anysim_soft.spec import Edge, PadSpec, SoftSpec

Share = Annotated[float, Field(ge=0.0, le=0.8)]


class ShirtSpec(Spec):
    """The cut of a T-shirt: y from its hem to its neck, x to its left sleeve, lengths in [m]."""

    chest: Positive = Field(default=0.4, description="width of its body [m]")
    length: Positive = Field(default=0.5, description="from hem to shoulder [m]")
    sleeve: Positive = Field(default=0.15, description="how far a sleeve sticks out of the body, along x [m]")
    cuff: Positive = Field(default=0.16, description="width of a sleeve [m]")
    slope: NonNegative = Field(default=0.3, description="how much a sleeve comes down by its length along x")
    neck: tuple[Positive, Positive] = Field(default=(0.16, 0.05), description="width and depth of the neck's cut [m]")
    panels: Literal[1, 2] = Field(
        default=2, description="of cloth: front and back, sewn along sides, sleeves and shoulders; or one flat piece"
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.neck[0] >= self.chest:
            raise KeyFault(f"the neck is not narrower than the chest, which is {self.chest:g} m wide", "neck")
        if max(self.cuff, self.neck[1]) >= self.length:
            raise KeyFault(f"it is not shorter than the shirt, which is {self.length:g} m long", "cuff")
        return self


class GarmentSpec(SoftSpec):
    """Cloth that is cut to a form, stretches by next to nothing, and resists bending."""

    towel: tuple[Positive, Positive] | None = Field(default=None, description="edges of a towel [m], along x and y")
    shirt: ShirtSpec | None = Field(default=None, description="the cut of a T-shirt")
    spacing: Positive = Field(default=0.025, description="of its points at most [m]")
    areal_density: PositiveValue = Field(default=0.3, description="mass by area of the cloth [kg/m^2]")
    bending: NonNegativeValue = Field(default=3e-5, description="flexural rigidity of a strip by its width [N m]")
    damping: NonNegativeValue = Field(
        default=0.02, description="[s] Rayleigh's of bending: the rigidity times this times the rate resists"
    )
    folded: Value[Share] = Field(
        default=0.0, description="share of its extent along x that lies folded over the rest when an episode begins"
    )
    turned: Value[float] = Field(
        default=0.0, description="how far it is turned in its plane when an episode begins, before it is folded [rad]"
    )
    tilt: Value[float] = Field(
        default=0.0, description="how far that plane then stands up, about y, its lowest point at its frame [rad]"
    )
    radius: Positive = Field(default=0.003, description="[m] from its middle at which contacts act")
    layers: bool = Field(
        default=False,
        description="whether parts of it that lie on each other touch, twice the radius apart; a sticky pad then holds "
        "one point",
    )
    fixed: tuple[Edge, ...] = Field(
        default=(), description="sides or corners of its outline that stay where they begin"
    )
    attached: dict[Edge, Reference] = Field(
        default_factory=dict, description="sides or corners that a body holds where they are at the reset"
    )
    pads: dict[Name, PadSpec] = Field(default_factory=dict, description="hands that hold it while they are closed")

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if (self.towel is None) == (self.shirt is None):
            raise KeyFault("give one of `towel: [WIDTH, LENGTH]` and `shirt: {}`", "towel")
        sticky = {name: pad for name, pad in self.pads.items() if pad.grip == "sticky"}
        if self.layers and (wide := [name for name, pad in sticky.items() if pad.points > 1]):
            raise KeyFault(
                f"layers that touch are pressed into each other between the points that the pad '{wide[0]}' holds, and "
                f"the cloth comes apart; give it `points: 1`",
                "layers",
            )
        return self
