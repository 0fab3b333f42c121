"""A room: its plan, walls with doors and windows, and furniture, all made from a seed when the world is built."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, get_args

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Fraction, Integer, NonNegative, Number, Positive, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import ColorValue

Furniture = Literal[
    "bed", "wardrobe", "counter", "sofa", "shelf", "desk", "table", "nightstand", "chair", "lamp", "plant"
]
Style = Literal["empty", "living_room", "bedroom", "kitchen", "office"]
Side = Literal["south", "east", "north", "west"]
SIDES: tuple[Side, ...] = ("south", "east", "north", "west")
"""The walls of a rectangular room in the order of their numbers: at the lowest y first, then counterclockwise."""

STYLES: dict[str, dict[Furniture, int]] = {
    "empty": {},
    "living_room": {"sofa": 1, "table": 1, "chair": 2, "shelf": 2, "lamp": 1, "plant": 1},
    "bedroom": {"bed": 1, "nightstand": 1, "wardrobe": 1, "chair": 1, "lamp": 1},
    "kitchen": {"counter": 2, "table": 1, "chair": 4, "shelf": 1},
    "office": {"desk": 2, "chair": 2, "shelf": 2, "plant": 1},
}
"""What stands in a room of a style."""


FURNITURE: tuple[Furniture, ...] = get_args(Furniture)
"""The kinds of furniture, in the order in which they look for a place."""


class OpeningSpec(Spec):
    """An opening in a wall."""

    wall: Side | Integer = Field(
        default="south", description="south, east, north, west; in a room with a `plan`, the number of the wall from 0"
    )
    at: Fraction = Field(default=0.5, description="middle of the opening along the wall, as a share of its length")


class DoorSpec(OpeningSpec):
    """A doorway, from the floor up, through which one can walk."""

    width: Positive = Field(default=0.9, description="width [m]")
    height: Positive = Field(default=2.05, description="height [m]")


class WindowSpec(OpeningSpec):
    """A window with a pane."""

    wall: Side | Integer = Field(default="north", description="as of a door")
    width: Positive = Field(default=1.2, description="width [m]")
    height: Positive = Field(default=1.2, description="height of the opening [m]")
    sill: Positive = Field(default=0.9, description="height of its lower edge above the floor [m]")


class RoomSpec(Spec):
    """A room on a plane. Its floor is at height 0; a rectangular one has its middle at the origin."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("size",), ("plan",))

    size: tuple[Positive, Positive] | None = Field(
        default=None, description="inner extent along x and y [m]; 5 by 4 where neither this nor a plan is given"
    )
    plan: tuple[tuple[Number, Number], ...] | None = Field(
        default=None, description="inner corners x, y [m] of a polygon, counterclockwise, instead of `size`"
    )
    height: Positive = Field(default=2.6, description="of the walls [m]")
    thickness: Positive = Field(default=0.12, description="of the walls, outwards [m]")
    ceiling: Flag = Field(default=False, description="whether there is one")
    doors: tuple[DoorSpec, ...] = Field(default=(DoorSpec(),), description="doorways")
    windows: tuple[WindowSpec, ...] = Field(default=(), description="windows")
    style: Style = Field(default="empty", description="what usually stands in such a room")
    furniture: dict[Furniture, Integer] = Field(
        default_factory=dict[Furniture, Integer], description="how many of each kind, on top of the style; 0 for none"
    )
    walkway: NonNegative = Field(default=0.6, description="width of the passage that stays free from door to door [m]")
    seed: Integer = Field(default=0, ge=0, description="of sizes, places and colours; the same seed is the same room")
    friction: NonNegative = Field(default=0.8, description="sliding friction coefficient of walls and furniture")
    floor_color: ColorValue = Field(
        default=(0.62, 0.50, 0.38), description="of the floor; may be drawn in each episode"
    )
    wall_color: ColorValue = Field(default=(0.87, 0.85, 0.80), description="of the walls; may be drawn in each episode")
    furniture_color: ColorValue | None = Field(
        default=None, description="of every piece, drawn for each; by its kind and the seed where not given"
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The style of the room."""
        return {"style": text}

    @property
    def pieces(self) -> dict[str, int]:
        """How many of each kind of furniture, without those of which there are none."""
        return {str(kind): n for kind, n in (STYLES[self.style] | self.furniture).items() if n}

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """The inner corners [m], counterclockwise."""
        if self.plan is not None:
            return self.plan
        x, y = (e / 2 for e in self.size or (5.0, 4.0))
        return ((-x, -y), (x, -y), (x, y), (-x, y))

    def wall_number(self, opening: OpeningSpec) -> int:
        """The wall that an opening is in: from corner i to corner i + 1."""
        return SIDES.index(opening.wall) if isinstance(opening.wall, str) else opening.wall

    @model_validator(mode="after")
    def _plan_is_a_polygon(self) -> "RoomSpec":
        if self.size is not None and self.plan is not None:
            raise KeyFault("give either `size` or `plan`", "plan")
        if self.plan is not None and len(self.plan) < 3:
            raise KeyFault(f"a room needs at least three corners, got {len(self.plan)}", "plan")
        for kind, count in self.furniture.items():
            if count < 0:
                raise KeyFault(f"expected 0 or more, got {count}", "furniture", kind)
        walls = len(self.outline)
        for key, openings in (("doors", self.doors), ("windows", self.windows)):
            for i, opening in enumerate(openings):
                if isinstance(opening.wall, str) and self.plan is not None:
                    raise KeyFault(f"a plan has numbered walls, 0 to {walls - 1}", key, str(i), "wall")
                if not 0 <= self.wall_number(opening) < walls:
                    raise KeyFault(f"there are the walls 0 to {walls - 1}, got {opening.wall}", key, str(i), "wall")
        return self


def names_of(pieces: Mapping[str, int]) -> list[tuple[str, str]]:
    """(name, kind) of all pieces in the order of placement: `table` where there is one, else `chair_0`, `chair_1`."""
    return [
        (kind if pieces[kind] == 1 else f"{kind}_{i}", kind)
        for kind in FURNITURE
        if kind in pieces
        for i in range(pieces[kind])
    ]


def furniture_names(spec: RoomSpec) -> list[str]:
    """The entities that the furniture of a room becomes."""
    return [name for name, _ in names_of(spec.pieces)]
