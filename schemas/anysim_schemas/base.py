"""The base of every spec: frozen, closed, in SI units, and written in one form."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, cast

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, Strict, model_validator
from pydantic_core import CoreSchema, core_schema

from anysim_schemas.bounds import DENSITY, LENGTH, MASS, SCALE


class Spec(BaseModel):
    """A frozen, closed piece of configuration: an unknown key is an error, a loaded spec never changes."""

    # A model is built when it is first used: most are used only as parts of another, which builds them again.
    model_config = ConfigDict(
        extra="forbid", frozen=True, validate_default=False, allow_inf_nan=False, defer_build=True
    )

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Groups of keys that exclude each other. A file that gives one group drops what it inherited of the others."""

    kept_under_text: ClassVar[tuple[str, ...]] = ()
    """Keys that stay where a file or an override replaces an inherited mapping by a bare string."""

    belongs_to: ClassVar[Mapping[str, str]] = {}
    """Keys that are looked for here and belong elsewhere, with where that is."""

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any] | None:
        """The mapping that a bare string stands for; None where a string is not enough."""
        return None

    @model_validator(mode="before")
    @classmethod
    def _expand_text(cls, data: object) -> object:
        expanded = cls.from_text(data) if isinstance(data, str) else None
        return data if expanded is None else expanded

    @classmethod
    def text_means(cls) -> str:
        """What a bare string means, for editors: `{term: NAME}`."""
        return ", ".join(f"{{{key}: {value}}}" for key, value in (cls.from_text("NAME") or {}).items())

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-compatible data, without the fields that were left at their defaults of None."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


@dataclass(frozen=True)
class NamedByKey:
    """Marks a mapping of specs: an entry that leaves `field` out takes its key for it, and may be empty altogether."""

    field: str

    def entry(self, key: object, value: object) -> object:
        """One entry of the mapping with its name filled in."""
        if value is None:
            return {self.field: key}
        return {self.field: key, **cast("dict[str, object]", value)} if isinstance(value, dict) else value

    def _fill(self, data: object) -> object:
        if not isinstance(data, dict):
            return data
        return {key: self.entry(key, value) for key, value in cast("dict[object, object]", data).items()}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._fill, handler(source))


NAME_PATTERN = r"^[a-zA-Z][a-zA-Z0-9_]*$"
REFERENCE_PATTERN = r"^[a-zA-Z][a-zA-Z0-9_]*([./][^\s]+)?$"

Name = Annotated[str, Field(pattern=NAME_PATTERN)]
"""The name of an entity, camera, term…: it becomes the first part of a dotted reference such as `panda.tool`."""

Reference = Annotated[str, Field(pattern=REFERENCE_PATTERN)]
"""A reference to something in the world: `cube`, `panda.tool`, `goal`, an affordance `block/mouth`."""

# Strict: the text "0.1" and the boolean `true` are not numbers, and the text "yes" is not a boolean.
Number = Annotated[float, Strict()]
Integer = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]

Whole = Annotated[int, Strict(), Field(ge=0)]
Delay = Annotated[int, Strict(), Field(ge=0, le=10_000)]
"""Control steps, each of which keeps what is late in every env."""
Degrees = Annotated[float, Strict(), Field(gt=1, lt=170)]
"""A field of view."""
Positive = Annotated[float, Strict(), Field(gt=0)]
NonNegative = Annotated[float, Strict(), Field(ge=0)]
Fraction = Annotated[float, Strict(), Field(ge=0, le=1)]
Bounce = Annotated[float, Strict(), Field(ge=0, lt=1)]
"""A coefficient of restitution: what bounces with 1 never comes to rest."""

Length = Annotated[float, Strict(), Field(ge=LENGTH.low, le=LENGTH.high)]
"""A size of something that others touch."""
Scale = Annotated[float, Strict(), Field(ge=SCALE.low, le=SCALE.high)]
Mass = Annotated[float, Strict(), Field(ge=MASS.low, le=MASS.high)]
Density = Annotated[float, Strict(), Field(ge=DENSITY.low, le=DENSITY.high)]

Vec3 = tuple[Number, Number, Number]
Color = Annotated[
    tuple[Fraction, Fraction, Fraction] | str,
    Field(description="red, green, blue in [0, 1], or a colour name such as `red`"),
]
