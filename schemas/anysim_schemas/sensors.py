"""Sensors of a world: what reads, how often, how late, and how well."""

from typing import Any, ClassVar, Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from anysim_schemas.base import Fraction, Name, NonNegative, Positive, Reference, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import DelayValue, FloatValue, unshared


class SensorNoiseSpec(Spec):
    """What is added to each number of a field; of a quaternion, to its rotation, as a rotation vector [rad]."""

    noise: FloatValue | None = Field(default=None, description="drawn anew at each reading")
    white: NonNegative = Field(
        default=0.0,
        description="density of white noise [unit/sqrt(Hz)]: of readings each T [s], normal noise of white/sqrt(T)",
    )
    bias: FloatValue | None = Field(default=None, description="drawn once an episode for each number")
    walk: NonNegative = Field(
        default=0.0,
        description="density of the bias's random walk [unit/s/sqrt(Hz)]: in t [s] it goes walk*sqrt(t) from 0",
    )
    walk_time: Positive | None = Field(
        default=None,
        description="[s] after which the walk has forgotten where it was: it stays within walk*sqrt(walk_time/2); it "
        "goes on for ever if not given",
    )

    @field_validator("noise", "bias")
    @classmethod
    def _alone(cls, noise: Any) -> Any:
        return unshared(noise)

    @model_validator(mode="after")
    def _walks(self) -> Self:
        if self.walk_time is not None and not self.walk:
            raise KeyFault("there is no `walk` that could forget; say how fast it goes", "walk_time")
        return self


class SensorSpec(Spec):
    """A sensor with its parameters beside it, `{sensor: imu, frame: go2.trunk}`, or one of a robot: `go2.body_imu`."""

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "sensor"
    plugin_name_field: ClassVar[str] = "sensor"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("sensor",), ("place",))

    sensor: str | None = Field(default=None, description="an installed sensor, as in `anysim list sensors`")
    place: Reference | None = Field(
        default=None,
        description="ROBOT.SENSOR of the robot's catalogue entry, which says of what kind it is, where, and how noisy",
    )
    rate: Positive | None = Field(
        default=None, description="readings per second, each of whole control steps; each control step if not given"
    )
    delay: DelayValue = Field(
        default=0, description="control steps by which readings are late; the first stands in until then"
    )
    dropout: Fraction = Field(
        default=0.0, description="share of the readings that are lost; the last one holds, and `valid` is 0 meanwhile"
    )
    noise: dict[Name, SensorNoiseSpec] = Field(default_factory=dict, description="noise by field of the sensor")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """A sensor of a robot's catalogue entry."""
        return {"place": text}

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.sensor is None) == (self.place is None):
            both = "give one of them" if self.place is not None else "it has neither"
            raise ValueError(f"a sensor is an installed one (`sensor`) or one of a robot (`place`); {both}")
        return self

    def steps(self, control_dt: float) -> int:
        """Control steps of so many seconds from one reading to the next.

        Raises:
            KeyFault: the rate is not of whole ones.
        """
        steps = 1.0 if self.rate is None else 1.0 / (self.rate * control_dt)
        if round(steps) >= 1 and abs(steps - round(steps)) < 1e-6 * steps:
            return round(steps)
        near = sorted({max(1, int(steps)), int(steps) + 1})
        rates = " or ".join(f"{1.0 / (count * control_dt):.6g}" for count in near)
        raise KeyFault(
            f"a reading belongs to a control step, each {control_dt:g} s: choose {rates} Hz, or another "
            f"`physics.control_dt`",
            "rate",
        )

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the sensor, as written."""
        return dict(self.model_extra or {})
