"""Robots: the entry of a robot in a world, and the catalogue entry it refers to."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from anysim_schemas.base import Flag, Name, NonNegative, Number, Positive, Spec, Vec3
from anysim_schemas.dynamics import RobotDynamicsSpec
from anysim_schemas.objects import ContactSpec
from anysim_schemas.plugin import PluginSlot
from anysim_schemas.values import FloatValue, NonNegativeValue, Vec3Value, WholeValue, unshared


class ActionSpec(Spec):
    """The controller of one channel, by name, with its parameters. A bare string is the name."""

    controller: str = Field(description="an installed controller, as in `anysim list controllers`")
    params: Annotated[dict[str, Any], PluginSlot("controller", "controller")] = Field(
        default_factory=dict, description="parameters owned by the controller"
    )
    noise: FloatValue | None = Field(
        default=None,
        description="drawn anew at each control step and added to each component of the action, within its bounds",
    )
    delay: WholeValue = Field(
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

    robot: str = Field(description="a robot of the catalogue, as in `anysim list robots`")
    position: Vec3Value = Field(default=(0.0, 0.0, 0.0), description="place of the base [m], world frame")
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


class GainSpec(Spec):
    """The drive of a joint: u = kp (q* - q) + kd (qd* - qd) + ff, clipped to the effort limit."""

    kp: NonNegative = Field(description="stiffness [N m/rad] or [N/m]")
    kd: NonNegative = Field(description="damping [N m s/rad] or [N s/m]")
    effort_limit: Positive | None = Field(
        default=None, description="largest effort [N m] or [N]; the source's limit where not given"
    )
    armature: NonNegative = Field(default=0.0, description="rotor inertia seen at the joint [kg m^2] or [kg]")


class ChannelSpec(Spec):
    """A group of joints that is commanded together: the `base`, an `arm` or an `eef`."""

    joints: tuple[str, ...] = Field(min_length=1, description="joint names, in the order of the command")
    gains: GainSpec = Field(description="the drive of every joint of the channel")
    opened: tuple[Number, ...] | None = Field(default=None, description="eef: joint positions of the open gripper")
    closed: tuple[Number, ...] | None = Field(default=None, description="eef: joint targets of the closed gripper")


class ToolSpec(Spec):
    """A frame that tasks refer to, fixed to a link. Convention: z points out of the hand, y along the opening."""

    link: str = Field(description="the link that carries it")
    position: Vec3 = Field(default=(0.0, 0.0, 0.0), description="place in the link's frame [m]")
    roll_pitch_yaw: Vec3 = Field(default=(0.0, 0.0, 0.0), description="orientation in the link's frame [rad]")


class SurfaceSpec(Spec):
    """Contact parameters of the links whose names match."""

    links: tuple[str, ...] = Field(min_length=1, description="link names, `*` matches any part")
    friction: NonNegative | None = Field(
        default=None, description="sliding friction coefficient; the source's where not given"
    )
    contact: ContactSpec = Field(default=ContactSpec(), description="how the surface gives")


class RobotModelSpec(Spec):
    """A catalogue entry: what a robot is, independent of any world."""

    name: Name = Field(description="the name in the catalogue")
    description: str = Field(description="one line for people")
    source: str = Field(description="URI of the URDF or MJCF file")
    license: str = Field(description="SPDX expression of the asset's licence")
    license_source: str = Field(description="where the licence is stated")
    category: Literal["arm", "dual_arm", "hand", "base", "mobile_manipulator", "humanoid", "quadruped", "camera"] = (
        Field(description="what kind of robot it is")
    )
    base: Literal["fixed", "floating"] = Field(default="fixed", description="bolted down, or free to move")
    channels: dict[str, ChannelSpec] = Field(description="the groups of joints that are commanded, by name")
    home: dict[str, Number] = Field(default_factory=dict, description="joint positions [rad] or [m]; 0 where not given")
    tools: dict[str, ToolSpec] = Field(default_factory=dict, description="frames that tasks refer to, by name")
    surfaces: tuple[SurfaceSpec, ...] = Field(default=(), description="contact parameters of links")
    self_collision: Flag = Field(default=False, description="whether links of this robot collide with each other")
    gravity_compensation: Flag = Field(default=True, description="the robot's own controller cancels its weight")
