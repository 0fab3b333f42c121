"""The description of a learned policy: the YAML file beside its model file."""

from typing import Annotated, Literal

from pydantic import Field

from anysim_schemas.base import Name, Number, Positive, Spec

Term = Literal[
    "base_lin_vel", "base_ang_vel", "projected_gravity", "command", "joint_pos", "joint_vel", "last_action", "clock"
]


class PolicyTermSpec(Spec):
    """A part of what the policy observes, times its scale. A bare string is the term.

    base_lin_vel, base_ang_vel and projected_gravity are in the base's axes, as measured; command is the channel's
    action; joint_pos is relative to `offset`; last_action is the policy's own, before its scale; clock is the sine
    and the cosine of the phase since the reset.
    """

    term: Term = Field(description="what it is")
    scale: Number | tuple[Number, ...] = Field(default=1.0, description="a factor, or one for each component")

    @classmethod
    def from_text(cls, text: str) -> dict[str, str]:
        """The name of the term."""
        return {"term": text}


class PolicyCommandSpec(Spec):
    """A number that tells the policy what to do: a component of the channel's action."""

    name: Name = Field(description="what it is called, as `vx`")
    low: Number = Field(description="least value")
    high: Number = Field(description="largest value")


class PolicySpec(Spec):
    """A policy: its model file, what it observes, and what its output means."""

    model: str = Field(description="the ONNX (.onnx) or TorchScript (.pt) file, relative to this one")
    joints: tuple[str, ...] = Field(
        default=(), description="the joints in the policy's order; those of the channel in its order where not given"
    )
    observations: tuple[PolicyTermSpec, ...] = Field(min_length=1, description="what it observes, in order")
    commands: tuple[PolicyCommandSpec, ...] = Field(default=(), description="what it is told, in order")
    control_type: Literal["P", "V", "T"] = Field(
        default="P", description="the output: position targets around `offset` (P), velocities (V) or efforts (T)"
    )
    action_scale: Number | tuple[Number, ...] = Field(
        default=0.25, description="what an output of 1 means [rad, rad/s, N m]; one number, or one a joint"
    )
    action_clip: Positive = Field(default=100.0, description="the output is clipped to this, before its scale")
    observation_clip: Positive = Field(default=100.0, description="observations are clipped to this, after their scale")
    offset: dict[str, Annotated[Number, Field()]] = Field(
        default_factory=dict, description="joint positions of an output of 0, where they differ from the robot's home"
    )
    period: Positive | None = Field(
        default=None, description="seconds between two evaluations; each control step where not given"
    )
    frequency: Positive = Field(default=1.0, description="of the term `clock` [Hz]")
