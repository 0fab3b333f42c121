"""What every spec has in common: frozen, closed, in SI units."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field


class Spec(BaseModel):
    """A frozen, closed piece of configuration: an unknown key is an error, a loaded spec never changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-compatible data, without the fields that were left at their defaults of None."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


Name = Annotated[str, Field(pattern=r"^[a-zA-Z][a-zA-Z0-9_]*$", description="letters, digits and underscores")]
"""The name of an entity, camera, term…: it becomes the first part of a dotted reference such as `panda.tool`."""

Reference = Annotated[str, Field(pattern=r"^[a-zA-Z][a-zA-Z0-9_]*(\.[^\s]+)?$")]
"""A dotted reference to something in the world: `cube`, `panda.tool`, `cabinet.drawer`, `goal`."""

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Vec3 = tuple[float, float, float]
Color = Annotated[
    tuple[Fraction, Fraction, Fraction] | str,
    Field(description="red, green, blue in [0, 1], or a colour name such as `red`"),
]
