"""Robots in a world: where they stand, how they begin, and who turns actions into commands of their drives."""

from typing import Annotated, Any

from pydantic import Field, field_validator

from anysim_schemas.base import Flag, Spec
from anysim_schemas.dynamics import RobotDynamicsSpec
from anysim_schemas.plugin import PluginSlot
from anysim_schemas.values import DelayValue, FloatValue, NonNegativeValue, Vec3Value, unshared


class ActionSpec(Spec):
    """The controller of one channel, by name, with its parameters. A bare string is the name."""

    controller: str = Field(
        description="an installed controller, as in `anysim list controllers`, or `default`: the first of those that "
        "the catalogue gives the channel"
    )
    params: Annotated[dict[str, Any], PluginSlot("controller", "controller")] = Field(
        default_factory=dict,
        description="parameters owned by the controller; the rest are the catalogue's for the robot, else its defaults",
    )
    noise: FloatValue | None = Field(
        default=None,
        description="drawn anew at each control step and added to each component of the action, within its bounds",
    )
    delay: DelayValue = Field(
        default=0, description="control steps from an action to its effect; until the first one the robot holds still"
    )

    @field_validator("noise")
    @classmethod
    def _alone(cls, noise: Any) -> Any:
        return unshared(noise)

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The name of the controller."""
        return {"controller": text}


class RobotSpec(Spec):
    """A robot in the world."""

    robot: str = Field(description="a robot of the catalogue, as in `anysim list robots`, or the YAML file of one")
    position: Vec3Value = Field(
        default=(0.0, 0.0, 0.0),
        description="place of the base [m], world frame; of the ground under a robot that stands on it",
    )
    yaw: FloatValue = Field(default=0.0, description="angle of the base about the world z axis [rad]")
    home: dict[str, FloatValue] = Field(
        default_factory=dict, description="joint positions that differ from the catalogue's home"
    )
    home_velocity: dict[str, FloatValue] = Field(
        default_factory=dict, description="joint velocities at the reset [rad/s] or [m/s]; 0 where not given"
    )
    home_noise: NonNegativeValue = Field(default=0.0, description="standard deviation of the arm's home position [rad]")
    actions: dict[str, ActionSpec] = Field(default_factory=dict, description="channel: controller")
    dynamics: RobotDynamicsSpec = Field(
        default=RobotDynamicsSpec(), description="how its drives, joints and masses differ from the catalogue's"
    )
    self_collision: Flag | None = Field(
        default=None, description="whether its links collide with each other; as the catalogue says where not given"
    )
