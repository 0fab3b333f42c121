"""Patterns of LiDARs as worlds write them."""

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from anysim_schemas.base import Number, Positive, Spec
from anysim_sensors import patterns
from anysim_sensors.patterns import Pattern

Count = Annotated[int, Field(ge=1, le=1_000_000)]


class SpinningSpec(Spec):
    """Beams one above the other that turn together about z."""

    kind: Literal["spinning"]
    elevations: tuple[Number, ...] = Field(min_length=1, description="of the beams, up from the xy plane [rad]")
    columns: Count = Field(description="directions about z")
    field: Positive = Field(default=2 * pi, description="what they sweep, centred ahead [rad]")

    def rays(self, _scan: int) -> Pattern:
        """Those of a scan, column after column."""
        return patterns.spinning(self.elevations, self.columns, 1.0, self.field)


class PlanarSpec(Spec):
    """One beam that turns in the xy plane."""

    kind: Literal["planar"]
    columns: Count = Field(description="directions about z")
    field: Positive = Field(default=2 * pi, description="what it sweeps, centred ahead [rad]")

    def rays(self, _scan: int) -> Pattern:
        """Those of a scan."""
        return patterns.planar(self.columns, 1.0, self.field)


class SolidStateSpec(Spec):
    """A rosette about x, never the same twice: two prisms that turn against each other."""

    kind: Literal["solid_state"]
    count: Count = Field(description="rays of a scan")
    half_angle: Positive = Field(description="of the cone that it fills [rad]")
    petals: Positive = Field(default=7.3, description="turns of the slower prism in a scan")

    def rays(self, scan: int) -> Pattern:
        """Those of a scan by its number."""
        return patterns.rosette(self.count, 1.0, self.half_angle, self.petals, scan)


class WoundSpec(Spec):
    """A beam that turns about z and goes up and down, never the same way twice."""

    kind: Literal["wound"]
    count: Count = Field(description="rays of a scan")
    low: Number = Field(description="lowest elevation [rad]")
    high: Number = Field(description="highest elevation [rad]")
    turns: Positive = Field(default=20.3, description="about z in a scan")

    def rays(self, scan: int) -> Pattern:
        """Those of a scan by its number."""
        return patterns.wound(self.count, 1.0, self.low, self.high, self.turns, scan)


PatternSpec = Annotated[SpinningSpec | PlanarSpec | SolidStateSpec | WoundSpec, Field(discriminator="kind")]
