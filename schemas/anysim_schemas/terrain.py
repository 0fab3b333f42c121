"""The ground."""

from typing import Any, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Number, Positive, Spec, Vec3
from anysim_schemas.errors import KeyFault


class TerrainSpec(Spec):
    """The ground: an infinite plane, nothing, or a height field. A bare string is the kind."""

    kind: Literal["plane", "none", "heightfield"] = Field(default="plane", description="what the ground is")
    friction: Number = Field(default=0.8, ge=0, description="sliding friction coefficient")
    restitution: Number = Field(default=0.0, ge=0, lt=1, description="ratio of speeds after and before a bounce")
    color: Vec3 = Field(default=(0.45, 0.47, 0.5), description="red, green, blue in [0, 1]")
    heights: tuple[tuple[Number, ...], ...] | None = Field(
        default=None,
        description="heightfield: rows of heights [m]; first row at the lowest y, first column at the lowest x",
    )
    size: tuple[Positive, Positive] = Field(default=(10.0, 10.0), description="heightfield: extent along x and y [m]")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The kind of ground."""
        return {"kind": text}

    @model_validator(mode="after")
    def _heights_given(self) -> "TerrainSpec":
        if (self.kind == "heightfield") != (self.heights is not None):
            raise ValueError("`heights` goes with kind heightfield, and with no other")
        if self.heights is not None:
            lengths = sorted({len(row) for row in self.heights})
            if len(lengths) > 1:
                raise KeyFault(f"the rows differ in length: {' and '.join(map(str, lengths))}", "heights")
            if len(self.heights) < 2 or lengths[0] < 2:
                raise KeyFault("expected at least two rows of at least two heights", "heights")
        return self
