"""Values that are drawn anew in each episode: a constant, a range, a choice or a normal distribution.

A field of type `Value[float]` accepts `0.1`, `{range: [0.05, 0.2]}`, `{choice: [0.1, 0.2]}` and
`{normal: {mean: 0.1, std: 0.02, low: 0.0}}`. For vectors the bounds of a range and the moments of a normal are
component-wise.
"""

from typing import Annotated, Any, Generic, TypeVar

from pydantic import Discriminator, Field, Tag, model_validator

from anysim_schemas.base import Color, Fraction, NonNegative, Positive, Spec, Vec3

T = TypeVar("T")


class Range(Spec, Generic[T]):
    """Uniform between two bounds, component by component."""

    range: tuple[T, T] = Field(description="lower and upper bound")

    @model_validator(mode="after")
    def _ordered(self) -> "Range[T]":
        low, high = self.range
        pairs = zip(low, high, strict=True) if isinstance(low, tuple) and isinstance(high, tuple) else [(low, high)]
        for lower, upper in pairs:  # pyright: ignore[reportUnknownVariableType]
            if lower > upper:  # pyright: ignore[reportUnknownVariableType]
                raise ValueError(f"the lower bound {lower} is above the upper bound {upper}")
        return self


class Choice(Spec, Generic[T]):
    """One of the listed values, each equally likely unless `weights` says otherwise."""

    choice: tuple[T, ...] = Field(min_length=1)
    weights: tuple[NonNegative, ...] | None = None

    @model_validator(mode="after")
    def _weights_match(self) -> "Choice[T]":
        if self.weights is not None and (len(self.weights) != len(self.choice) or sum(self.weights) <= 0):
            raise ValueError(f"{len(self.choice)} choices need as many weights with a positive sum")
        return self


class NormalParameters(Spec, Generic[T]):
    """Mean and standard deviation; draws outside [low, high] are clipped to it."""

    mean: T
    std: T
    low: T | None = None
    high: T | None = None


class Normal(Spec, Generic[T]):
    """Normally distributed."""

    normal: NormalParameters[T]


def _kind(value: Any) -> str:
    for kind in ("range", "choice", "normal"):
        if (isinstance(value, dict) and kind in value) or hasattr(value, kind):
            return kind
    return "constant"


Value = Annotated[
    Annotated[T, Tag("constant")]
    | Annotated[Range[T], Tag("range")]
    | Annotated[Choice[T], Tag("choice")]
    | Annotated[Normal[T], Tag("normal")],
    Discriminator(_kind),
]

FloatValue = Value[float]
PositiveValue = Value[Positive]
NonNegativeValue = Value[NonNegative]
FractionValue = Value[Fraction]
Vec3Value = Value[Vec3]
ColorValue = Value[Color]
