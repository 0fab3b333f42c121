"""Layout: where things go. One entry for each object that has a place of its own."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Fraction, Name, NonNegative, Positive, Reference, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.regions import RegionSpec
from anysim_schemas.relations import SIDES, AlignedSpec, FacingSpec, NearSpec, SideSpec
from anysim_schemas.values import FloatValue, Vec3Value

GROUND = "terrain"

SUPPORTS = ("on", "in_", "under")
PLACES = ("region", "near", *SIDES, "aligned")
"""What narrows down where on a support something goes."""


class PlaceFields(Spec):
    """What can be said of a place; see `PlacementSpec`."""

    position: Vec3Value | None = Field(default=None, description="place of the frame origin [m], world frame")
    on: Reference | None = Field(
        default=None,
        description="rests on this object, or on a surface of it by name (`cabinet.shelf_1`), or on the ground: "
        "`terrain`",
    )
    in_: Reference | None = Field(
        default=None, alias="in", description="rests inside this object: a bin, a drawer (`cabinet.drawer`), a shelf"
    )
    under: Name | None = Field(
        default=None, description="rests below this object; on the ground where `on` says no more"
    )
    x: FloatValue | None = Field(
        default=None,
        description="x [m], world frame; with y, instead of anywhere on the support. 0 where only y is given",
    )
    y: FloatValue | None = Field(default=None, description="y [m], world frame; 0 where only x is given")
    region: Annotated[RegionSpec | Name | None, Field(union_mode="left_to_right")] = Field(
        default=None, description="a part of the plane that its frame origin is in, or the name of one of `regions`"
    )
    near: NearSpec | None = Field(default=None, description="not far from another object")
    left_of: SideSpec | None = Field(default=None, description="to the left of another object (+y)")
    right_of: SideSpec | None = Field(default=None, description="to the right of another object (-y)")
    in_front_of: SideSpec | None = Field(default=None, description="in front of another object (+x)")
    behind: SideSpec | None = Field(default=None, description="behind another object (-x)")
    facing: FacingSpec | None = Field(default=None, description="turned so that its x axis points there; adds to yaw")
    aligned: AlignedSpec | None = Field(default=None, description="turned as another object is, or in line with it")
    rest: Literal["given", "stable"] = Field(
        default="given",
        description="`stable`: drawn from the poses in which its shape stays put on a level surface, each as likely as "
        "when dropped; roll and pitch are then left out",
    )
    roll: FloatValue = Field(default=0.0, description="angle [rad] about the world x axis, applied first")
    pitch: FloatValue = Field(default=0.0, description="angle [rad] about the world y axis, applied second")
    yaw: FloatValue = Field(default=0.0, description="angle [rad] about the world z axis, applied last")
    arrange: Literal["scatter", "pack"] = Field(
        default="scatter",
        description="anywhere, or in rows as close as the clearance allows; what scatter has no room for is packed",
    )
    overhang: NonNegative = Field(
        default=0.0, description="how far it may stick out over the edge of its support [m], where it goes anywhere"
    )
    clearance: NonNegative = Field(default=0.0, description="smallest distance to any other placed object [m]")
    clear_of: dict[Name, NonNegative] = Field(
        default_factory=dict,
        description="smallest distance to single objects or robots by name [m], as they are shaped",
    )
    checked: bool = Field(
        default=True, strict=True, description="false for something that may start inside of others, as a peg in a hole"
    )

    def references(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """The things that this place depends on: the keys that say so, and the name."""
        for field in SUPPORTS:
            target = getattr(self, field)
            if target is not None:
                yield (_key(field),), target.partition(".")[0]
        if isinstance(self.region, RegionSpec) and self.region.of is not None:
            yield ("region", "of"), self.region.of
        for field in ("near", *SIDES, "facing", "aligned"):
            relation = getattr(self, field)
            if relation is not None and relation.of is not None:
                yield (field, "of"), relation.of

    def said(self) -> dict[str, Any]:
        """The fields that were given."""
        return {name: getattr(self, name) for name in self.model_fields_set if name in PlaceFields.model_fields}


class Alternative(PlaceFields):
    """One of several places: what it says wins over what the entry says, which holds for the rest."""

    weight: Positive = Field(default=1.0, description="how likely it is against the others, in any unit")


class PlacementSpec(PlaceFields):
    """A pose: absolute (`position`), or resting on something (`on`, `in`, `under`) where relations and regions allow.

    The reference point is the object's frame origin; what rests on something touches it with its lowest point. All that
    an entry says holds at once, and an entry that cannot be kept is an error that says what is in the way.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("position",), ("on", "in", "under", "x", "y", "region"))

    any_of: tuple[Alternative, ...] = Field(
        default=(), description="places of which one is drawn in each episode; the rest of the entry holds for each"
    )
    ratio: Fraction = Field(default=1.0, description="share of the episodes in which this entry holds")
    otherwise: PlaceFields | None = Field(
        default=None, description="where it is in the other episodes; its nominal place where not given"
    )

    @model_validator(mode="after")
    def _one_way(self) -> "PlacementSpec":
        if self.otherwise is not None and self.ratio == 1.0:
            raise KeyFault("`otherwise` is for the episodes that a `ratio` below 1 leaves out", "otherwise")
        for number, alternative in enumerate(self.any_of):
            try:
                _check(self.chosen(number))
            except ValueError as error:
                raise KeyFault(str(error), "any_of", str(number), *getattr(error, "path", ())) from error
            del alternative
        if not self.any_of:
            _check(self)
        if self.otherwise is not None:
            try:
                _check(self.otherwise)
            except ValueError as error:
                raise KeyFault(str(error), "otherwise", *getattr(error, "path", ())) from error
        return self

    def chosen(self, number: int) -> PlaceFields:
        """The place that alternative `number` says together with the entry."""
        return PlaceFields.model_construct(**(_defaults() | self.said() | self.any_of[number].said()))

    def variants(self) -> Iterator[tuple[tuple[str, ...], PlaceFields]]:
        """Every place that it may be, with the keys that lead there from the entry."""
        if not self.any_of:
            yield (), self
        for number in range(len(self.any_of)):
            yield ("any_of", str(number)), self.chosen(number)
        if self.otherwise is not None:
            yield ("otherwise",), self.otherwise


def _defaults() -> dict[str, Any]:
    return {name: field.get_default(call_default_factory=True) for name, field in PlaceFields.model_fields.items()}


def _key(field: str) -> str:
    return "in" if field == "in_" else field


def _check(place: PlaceFields) -> None:
    """What goes together.

    Raises:
        ValueError: it says no place, or two.
    """
    supports = [field for field in SUPPORTS if getattr(place, field) is not None]
    points = [field for field in ("x", "y") if getattr(place, field) is not None]
    places = [field for field in PLACES if getattr(place, field) is not None]
    if place.position is not None:
        more = [_key(field) for field in (*supports, *points) if field not in PLACES]
        if place.region is not None:
            more.append("region")
        if place.arrange == "pack":
            more.append("arrange")
        if more:
            raise ValueError(f"give either `position` or `{more[0]}`")
    elif not supports and not any(field != "aligned" or (place.aligned and place.aligned.along) for field in places):
        raise ValueError("give either `position` or `on`; `in`, `under`, a region or a relation say a place too")
    if place.on is not None and place.in_ is not None:
        raise KeyFault("give either `on` or `in`", "in")
    if points and place.arrange == "pack":
        raise KeyFault(f"what is packed has its place found; leave `{points[0]}` out", "arrange")
    if place.facing is not None and place.aligned is not None and place.aligned.along is None:
        raise KeyFault(
            "it is turned by `aligned`; leave `facing` out, or give `aligned` an axis with `along`", "facing"
        )


class RepairSpec(Spec):
    """How far a proposed pose may be moved to make it possible."""

    distance: NonNegative = Field(default=0.05, description="greatest sideways shift [m]")
    drop: NonNegative = Field(default=0.1, description="greatest vertical shift, onto its support [m]")
    angle: NonNegative = Field(default=0.35, description="greatest turn [rad]")


class LayoutSourceSpec(Spec):
    """Poses that are proposed from outside. A bare string is the file or the name of the proposer.

    The proposal is checked like everything else: names, numbers, collisions, and what the objects' own layout entries
    say. It is repaired within bounds, or refused with a sentence for each object.
    """

    proposal: str = Field(
        min_length=1,
        description="a JSON file (*.json), relative to the YAML file, or the name of an installed proposer "
        "(entry points `anysim.layouts`)",
    )
    repair: RepairSpec = Field(default=RepairSpec(), description="how far a proposed pose may be moved")
    on_refusal: Literal["error", "layout"] = Field(
        default="error",
        description="what a proposal that cannot be kept leads to: an error, or the layout's own entries",
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The proposal."""
        return {"proposal": text}
