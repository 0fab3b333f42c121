"""Files of a pack: things with their pieces, joints, frames, and where a hand takes hold of them.

All is in the axes of the thing, whose origin is in the middle of what it stands on, z up, with its joints at zero.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from anysim.model.affordances import AffordanceKind
from anysim_schemas.base import Color, Fraction, NonNegative, Positive, Spec

Vec = tuple[float, float, float]
Size = tuple[Positive, Positive, Positive]
Round = Annotated[tuple[Positive, Positive], Field(description="radius and height [m]")]

FORMS = ("box", "sphere", "cylinder", "capsule", "stack", "shell", "ring")


class ShellSpec(Spec):
    """A vessel with a floor: its wall is of boards, so that what is in it stays in it on every engine."""

    foot: Positive = Field(description="radius of the floor, where the wall begins [m]")
    rim: Positive = Field(description="radius of the opening, inside [m]")
    height: Positive = Field(description="[m]")
    wall: Positive = Field(description="thickness of wall and floor [m]")
    boards: Annotated[int, Field(ge=6, le=32)] = 14


class RingSpec(Spec):
    """A ring of boards, open above and below."""

    inner: Positive = Field(description="radius [m]")
    outer: Positive = Field(description="radius [m]")
    height: Positive = Field(description="[m]")
    boards: Annotated[int, Field(ge=6, le=32)] = 14


class PieceSpec(Spec):
    """One solid of a thing, of one of the forms."""

    box: Size | None = Field(default=None, description="lengths of the edges [m]")
    sphere: Positive | None = Field(default=None, description="radius [m]")
    cylinder: Round | None = None
    capsule: Round | None = Field(default=None, description="radius, and length with the round ends [m]")
    stack: tuple[Round, ...] | None = Field(default=None, description="cylinders on top of each other, lowest first")
    shell: ShellSpec | None = None
    ring: RingSpec | None = None
    at: Vec = Field(default=(0.0, 0.0, 0.0), description="its middle [m]; of a stack, shell or ring that of its bottom")
    axis: Vec = Field(default=(0.0, 0.0, 1.0), description="where its z points to")
    yaw: float = Field(default=0.0, description="turn about its own z, before `axis` [rad]")
    of: str = Field(default="plastic", description="what it is made of: its share of the mass, and its colour")
    color: Color | None = Field(default=None, description="in place of that of what it is made of")
    alpha: Fraction = Field(default=1.0, description="1 is opaque")
    link: str = Field(default="base", description="what it is fixed to")

    @model_validator(mode="after")
    def _one_form(self) -> "PieceSpec":
        if sum(getattr(self, form) is not None for form in FORMS) != 1:
            raise ValueError(f"a piece has one form: {', '.join(FORMS)}")
        return self


class LinkSpec(Spec):
    """A part that turns about an axis or slides along it, from the pose in which the pieces are given."""

    joint: Literal["revolute", "prismatic"]
    at: Vec = Field(description="a place on the axis [m]")
    axis: Vec
    range: tuple[float, float] = Field(description="[rad] or [m], with 0 in it")
    friction: NonNegative = Field(default=0.0, description="[N m] or [N]")
    damping: NonNegative = Field(default=0.0, description="[N m s/rad] or [N s/m]")


class AffordSpec(Spec):
    """Where a hand acts on it."""

    kind: AffordanceKind
    at: str = Field(description="a frame of `frames`")
    pieces: tuple[str, ...] = Field(default=(), description="that are taken hold of")
    use: tuple[str, ...]
    approach: tuple[Vec, ...] = Field(default=(), description="ways in which a hand comes; any if there is none")


class FrameSpec(Spec):
    """A place with a name."""

    at: Vec
    link: str = "base"


class ThingSpec(Spec):
    """A thing of a pack."""

    mass: Positive = Field(description="[kg] of all of it, shared out by volumes and densities")
    pieces: Annotated[dict[str, PieceSpec], Field(min_length=1)]
    links: dict[str, LinkSpec] = Field(default_factory=dict, description="parents before what is on them")
    frames: dict[str, FrameSpec] = Field(default_factory=dict)
    affords: dict[str, AffordSpec] = Field(default_factory=dict)
    about: str = Field(default="", description="what sizes or masses are taken from")

    @model_validator(mode="after")
    def _names(self) -> "ThingSpec":
        for name, piece in self.pieces.items():
            self._known(f"the piece '{name}'", piece.link, ("base", *self.links), "link")
        for name, frame in self.frames.items():
            self._known(f"the frame '{name}'", frame.link, ("base", *self.links), "link")
        for name, afford in self.affords.items():
            self._known(f"'{name}'", afford.at, tuple(self.frames), "frame")
            for piece in afford.pieces:
                self._known(f"'{name}'", piece, tuple(self.pieces), "piece")
        return self

    @staticmethod
    def _known(who: str, name: str, names: tuple[str, ...], what: str) -> None:
        if name not in names:
            raise ValueError(f"{who} speaks of the {what} '{name}'; there are: {', '.join(names) or 'none'}")


class MaterialSpec(Spec):
    """What pieces are made of."""

    density: Positive = Field(description="[kg/m^3]")
    color: Color


class PackSpec(Spec):
    """A file of a pack."""

    materials: dict[str, MaterialSpec] = Field(default_factory=dict, description="beside those that are known")
    things: dict[str, ThingSpec]
