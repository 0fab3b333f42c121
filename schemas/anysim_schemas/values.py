"""Values that are drawn anew in each episode: a constant, a range, a choice, a normal or log-uniform distribution.

A field of type `Value[float]` accepts `0.1`, `{range: [0.05, 0.2]}`, `{log_uniform: [0.01, 1.0]}`, `{choice: [0.1,
0.2]}` and `{normal: {mean: 0.1, std: 0.02, low: 0.0}}`. For vectors the bounds of a range and the moments of a normal
are component-wise. What is drawn may be gated (`ratio`, `otherwise`) and shared by several fields (`shared`).
"""

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, TypeVar, cast

from pydantic import Discriminator, Field, Tag, model_validator

from anysim_schemas.base import (
    Bounce,
    Color,
    Degrees,
    Delay,
    Density,
    Flag,
    Fraction,
    Integer,
    Mass,
    Name,
    NonNegative,
    Number,
    Positive,
    Scale,
    Spec,
    Vec3,
)
from anysim_schemas.errors import KeyFault

T = TypeVar("T")

Word = Annotated[Flag | Integer | Number | str, Field(union_mode="left_to_right")]
"""A single value of any kind, as it is written."""

KINDS = ("range", "log_uniform", "choice", "normal")
"""The keys that make a mapping a value that is drawn."""

TAG_PREFIX = "as:"
"""Marks the branch of a value in the location of an error, so that it is never taken for a key."""


def _components(value: object) -> tuple[float, ...]:
    """The numbers of a scalar or vector; a colour name has none."""
    if isinstance(value, str):
        raise ValueError(f"the colour name '{value}' has no order; give numbers, or draw from a list with `choice`")
    return cast("tuple[float, ...]", value) if isinstance(value, tuple) else (cast("float", value),)


def _check_order(low: object, high: object, what: str) -> None:
    for lower, upper in zip(_components(low), _components(high), strict=True):
        if lower > upper:
            raise ValueError(f"the lower {what} {lower:g} is above the upper {what} {upper:g}")


_LABELS: tuple[tuple[Any, str], ...] = (
    (Number, "number"), (Positive, "positive"), (NonNegative, "non_negative"), (Fraction, "fraction"),
    (Bounce, "bounce"), (Scale, "scale"), (Mass, "mass"), (Density, "density"),
    (Vec3, "vector"), (Color, "color"), (Delay, "delay"), (Flag, "flag"), (Degrees, "degrees"), (Word, "word"),
)  # fmt: skip


class Variant(Spec):
    """Names its variants by what they hold, `Range_positive`, and keeps them where pickle looks for them."""

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        cls.__doc__ = cls.__doc__ or cls.__base__.__doc__
        globals().setdefault(cls.__name__, cls)

    @classmethod
    def model_parametrized_name(cls, params: tuple[Any, ...]) -> str:
        """The name of a variant, as it stands in the JSON Schema."""
        labels = [label for kind, label in _LABELS if kind is params[0]]
        return f"{cls.__name__}_{labels[0]}" if labels else super().model_parametrized_name(params)


class Distribution(Variant, Generic[T]):
    """What the values that are drawn have in common: the key that says how, whether at all, and with whom."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("range",),
        ("log_uniform",),
        ("choice", "weights"),
        ("normal",),
    )

    ratio: Fraction = Field(default=1.0, description="share of the episodes in which it is drawn at all")
    otherwise: T | None = Field(
        default=None, description="the value of the other episodes; the nominal one where not given"
    )
    shared: Name | None = Field(
        default=None,
        description="fields that share a name share one draw in each episode: all high in theirs, or all low",
    )

    @model_validator(mode="after")
    def _gated(self) -> "Distribution[T]":
        if self.otherwise is not None and self.ratio == 1.0:
            raise KeyFault("`otherwise` is for the episodes that a `ratio` below 1 leaves out", "otherwise")
        return self


class Range(Distribution[T], Generic[T]):
    """Uniform between two bounds, component by component; whole numbers include both bounds."""

    range: tuple[T, T] = Field(description="lower and upper bound")

    @model_validator(mode="after")
    def _ordered(self) -> "Range[T]":
        _check_order(*self.range, what="bound")
        return self


class LogUniform(Distribution[T], Generic[T]):
    """Uniform in the logarithm between two positive bounds, component by component: each decade is equally likely."""

    log_uniform: tuple[T, T] = Field(description="lower and upper bound, above 0")

    @model_validator(mode="after")
    def _ordered(self) -> "LogUniform[T]":
        if min(_components(self.log_uniform[0])) <= 0:
            raise KeyFault(f"a log-uniform value needs bounds above 0, got {self.log_uniform[0]}", "log_uniform")
        _check_order(*self.log_uniform, what="bound")
        return self


class Choice(Distribution[T], Generic[T]):
    """One of the listed values, each equally likely unless `weights` says otherwise."""

    choice: tuple[T, ...] = Field(min_length=1, description="the values to draw from")
    weights: tuple[NonNegative, ...] | None = Field(
        default=None, description="how likely each is, in any unit; equal where not given"
    )

    @model_validator(mode="after")
    def _weights_match(self) -> "Choice[T]":
        if self.weights is not None and (len(self.weights) != len(self.choice) or sum(self.weights) <= 0):
            raise KeyFault(
                f"{len(self.choice)} choices need {len(self.choice)} weights with a positive sum; "
                f"got {len(self.weights)} with the sum {sum(self.weights):g}",
                "weights",
            )
        return self


class NormalParameters(Variant, Generic[T]):
    """Mean and standard deviation; draws outside [low, high] are clipped to it."""

    mean: T = Field(description="mean")
    std: T = Field(description="standard deviation")
    low: T | None = Field(default=None, description="smallest value drawn")
    high: T | None = Field(default=None, description="largest value drawn")

    @model_validator(mode="after")
    def _ordered(self) -> "NormalParameters[T]":
        _components(self.mean)
        if any(component < 0 for component in _components(self.std)):
            raise KeyFault(f"the standard deviation must not be negative, got {self.std}", "std")
        if self.low is not None and self.high is not None:
            _check_order(self.low, self.high, what="limit")
        return self


class Normal(Distribution[T], Generic[T]):
    """Normally distributed."""

    normal: NormalParameters[T] = Field(description="mean, standard deviation and limits")


def kind_of(value: object) -> str:
    """The tag of the branch that a value is of."""
    mapping = cast("dict[object, object]", value) if isinstance(value, dict) else {}
    for kind in KINDS:
        if kind in mapping or (isinstance(value, Distribution) and hasattr(cast("object", value), kind)):
            return TAG_PREFIX + kind
    return TAG_PREFIX + "constant"


if TYPE_CHECKING:
    Value = T | Range[T] | LogUniform[T] | Choice[T] | Normal[T]
else:

    class Value:
        """`Value[X]`: an X, or a distribution over X.

        Built item by item: a typing alias would leave the T of `Range[T]` open, and bounds unchecked.
        """

        def __class_getitem__(cls, item: Any) -> Any:
            return Annotated[
                Annotated[item, Tag(TAG_PREFIX + "constant")]
                | Annotated[Range[item], Tag(TAG_PREFIX + "range")]
                | Annotated[LogUniform[item], Tag(TAG_PREFIX + "log_uniform")]
                | Annotated[Choice[item], Tag(TAG_PREFIX + "choice")]
                | Annotated[Normal[item], Tag(TAG_PREFIX + "normal")],
                Discriminator(kind_of),
            ]


if TYPE_CHECKING:
    ChoiceOf = T | Choice[T]
else:

    class ChoiceOf:
        """`ChoiceOf[X]`: an X that has no order, or a choice among several."""

        def __class_getitem__(cls, item: Any) -> Any:
            return Annotated[
                Annotated[item, Tag("as:constant")] | Annotated[Choice[item], Tag("as:choice")],
                Discriminator(lambda value: "as:choice" if kind_of(value) == "as:choice" else "as:constant"),
            ]


FloatValue = Value[Number]
PositiveValue = Value[Positive]
NonNegativeValue = Value[NonNegative]
FractionValue = Value[Fraction]
Vec3Value = Value[Vec3]
ColorValue = Value[Color]
BounceValue = Value[Bounce]
ScaleValue = Value[Scale]
MassValue = Value[Mass]
DensityValue = Value[Density]
DelayValue = Value[Delay]

if TYPE_CHECKING:
    FlagValue = bool | Choice[bool]
else:
    FlagValue = Annotated[
        Annotated[Flag, Tag(TAG_PREFIX + "constant")] | Annotated[Choice[Flag], Tag(TAG_PREFIX + "choice")],
        Discriminator(kind_of),
    ]
    """True, false, or a choice of both: there is nothing between them."""


def unshared(noise: Any) -> Any:
    """Refuse to share the draws of a value that is drawn anew at each step, or for several numbers at once."""
    if isinstance(noise, Distribution) and cast("Distribution[float]", noise).shared is not None:
        raise KeyFault("noise is drawn for itself, number by number; leave `shared` out", "shared")
    return cast("Any", noise)
