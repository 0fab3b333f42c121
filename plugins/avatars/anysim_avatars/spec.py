"""Parameters of avatars: who there is, where they begin, and what they do one after another."""

from typing import Literal, Self

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Integer, Name, NonNegative, Number, Positive, Reference, Spec, Vec3
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import FloatValue, PositiveValue, Range

Point2 = tuple[Number, Number]
WAYS = ("go_to", "path", "turn_to")


class ActionSpec(Spec):
    """One thing that an avatar does. What it looks at, reaches for and how it bends holds while it lasts."""

    go_to: Point2 | Reference | None = Field(default=None, description="a point on the ground [m], or a body by name")
    near: NonNegative = Field(default=0.0, description="with `go_to`: how far from it the walk may end [m]")
    path: tuple[Point2, ...] | None = Field(default=None, description="points on the ground [m], walked through")
    turn_to: Number | None = Field(default=None, description="heading [rad] to turn to on the spot")
    clip: Name | None = Field(
        default=None,
        description="a clip, or one of `motions`: idle, sit, talk, …; beside a walk, how the arms are held",
    )
    seat: Positive = Field(default=0.45, description="height of the seat behind it [m], for the clip `sit`")
    seconds: NonNegative | Range[NonNegative] | None = Field(
        default=None, description="how long a clip lasts [s]; a recording once, another for ever if not given"
    )
    speed: Positive = Field(default=1.0, lt=2.01, description="of walking, at most [m/s]")
    gaze: Vec3 | Reference | None = Field(default=None, description="a point [m] or a body that is looked at")
    reach: Vec3 | Range[Vec3] | Reference | None = Field(
        default=None, description="a point [m], may be drawn, or a body that the palm is put to"
    )
    ease: Positive = Field(default=0.4, description="in which gaze and reach come, and go before it [s]")
    hand: Literal["left", "right"] = Field(default="right", description="the hand that reaches")
    bend: Number = Field(default=0.0, ge=-0.4, le=1.4, description="how far the trunk leans forward [rad]")

    @classmethod
    def from_text(cls, text: str) -> dict[str, str]:
        """A clip."""
        return {"clip": text}

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = [key for key in WAYS if getattr(self, key) is not None]
        if len(given) > 1:
            raise KeyFault(f"an avatar does one thing at a time, and here are {' and '.join(given)}", given[1])
        if self.path is not None and not 1 <= len(self.path) <= 16:
            raise KeyFault(f"a path has 1 to 16 points, here are {len(self.path)}", "path")
        return self


class PersonSpec(Spec):
    """What one of several avatars has of its own."""

    x: FloatValue | None = Field(default=None, description="where it begins [m]")
    y: FloatValue | None = Field(default=None, description="where it begins [m]")
    yaw: FloatValue | None = Field(default=None, description="where it faces [rad]")
    do: tuple[ActionSpec, ...] | None = Field(default=None, description="what it does, one after another")


class AvatarSpec(Spec):
    """One avatar, or several that are drawn by one seed."""

    count: Integer = Field(default=1, gt=0, le=32, description="how many; they are called NAME_0, NAME_1, …")
    seed: Integer = Field(default=0, ge=0, lt=2**32, description="draws size, proportions and colours of each")
    look: Literal["capsules", "body"] = Field(
        default="capsules", description="what is drawn: the capsules that touch things, or a body of smooth limbs"
    )
    height: PositiveValue = Field(default=Range(range=(1.55, 1.9)), description="of the body [m]")
    x: FloatValue = Field(default=0.0, description="where it begins [m]; drawn for each avatar and episode")
    y: FloatValue = Field(
        default=0.0, description="where it begins [m]; with a count and no spread they stand in a row"
    )
    yaw: FloatValue = Field(default=0.0, description="where it faces [rad]")
    do: tuple[ActionSpec, ...] = Field(default=(), description="what it does, one after another; then it stands")
    each: tuple[PersonSpec, ...] = Field(
        default=(), max_length=32, description="what the first ones have in place of that; there are at least as many"
    )
    again: Flag = Field(default=False, description="begin anew after the last")
    motions: dict[Name, str] = Field(
        default_factory=dict, description="recordings by name: BVH files, whose clips these are"
    )

    @property
    def number(self) -> int:
        """How many there are."""
        return max(self.count, len(self.each))

    def own(self, number: int) -> PersonSpec:
        """What one of them has of its own."""
        return self.each[number] if number < len(self.each) else PersonSpec()

    def one(self, number: int) -> Self:
        """What one of them begins with and does."""
        own = {key: value for key, value in self.own(number) if value is not None}
        return self.model_copy(update=own)
