"""Robots: the entry of a robot in a world, and the catalogue entry it refers to."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Name, NonNegative, Positive, Spec, Vec3
from anysim_schemas.objects import ContactSpec
from anysim_schemas.plugin import PluginSlot
from anysim_schemas.values import NonNegativeValue


class ActionSpec(Spec):
    """The controller of one channel, by name, with its parameters."""

    controller: str = Field(description="an installed controller, as in `anysim list controllers`")
    params: Annotated[dict[str, Any], PluginSlot("controller", "controller")] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _name_shorthand(cls, data: object) -> object:
        return {"controller": data} if isinstance(data, str) else data


class RobotSpec(Spec):
    """A robot in the world."""

    robot: str = Field(description="a robot of the catalogue, as in `anysim list robots`")
    position: Vec3 = (0.0, 0.0, 0.0)
    yaw: float = Field(default=0.0, description="[rad]")
    home: dict[str, float] = Field(default_factory=dict, description="joint positions that differ from the catalogue's home")
    home_noise: NonNegativeValue = Field(default=0.0, description="standard deviation of the arm's home position [rad]")
    actions: dict[str, ActionSpec] = Field(default_factory=dict, description="channel: controller")


class GainSpec(Spec):
    """The drive of a joint: u = kp (q* - q) + kd (qd* - qd) + ff, clipped to the effort limit."""

    kp: NonNegative
    kd: NonNegative
    effort_limit: Positive | None = Field(default=None, description="[N m] or [N]; the source's limit where not given")
    armature: NonNegative = Field(default=0.0, description="rotor inertia seen at the joint [kg m^2] or [kg]")


class ChannelSpec(Spec):
    """A group of joints that is commanded together: the `base`, an `arm` or an `eef`."""

    joints: tuple[str, ...] = Field(min_length=1)
    gains: GainSpec
    opened: tuple[float, ...] | None = Field(default=None, description="eef: joint positions of the open gripper")
    closed: tuple[float, ...] | None = Field(default=None, description="eef: joint targets of the closed gripper")


class ToolSpec(Spec):
    """A frame that tasks refer to, fixed to a link. Convention: z points out of the hand, y along the opening."""

    link: str
    position: Vec3 = (0.0, 0.0, 0.0)
    roll_pitch_yaw: Vec3 = (0.0, 0.0, 0.0)


class SurfaceSpec(Spec):
    """Contact parameters of the links whose names match."""

    links: tuple[str, ...] = Field(min_length=1, description="link names, `*` matches any part")
    friction: NonNegative | None = None
    contact: ContactSpec = ContactSpec()


class RobotModelSpec(Spec):
    """A catalogue entry: what a robot is, independent of any world."""

    name: Name
    description: str
    source: str = Field(description="URI of the URDF or MJCF file")
    license: str = Field(description="SPDX expression of the asset's licence")
    license_source: str = Field(description="where the licence is stated")
    category: Literal["arm", "dual_arm", "hand", "base", "mobile_manipulator", "humanoid", "quadruped", "camera"]
    base: Literal["fixed", "floating"] = "fixed"
    channels: dict[str, ChannelSpec]
    home: dict[str, float] = Field(default_factory=dict, description="joint positions [rad] or [m]; 0 where not given")
    tools: dict[str, ToolSpec] = Field(default_factory=dict)
    surfaces: tuple[SurfaceSpec, ...] = ()
    self_collision: bool = False
    gravity_compensation: bool = Field(default=True, description="the robot's own controller cancels its weight")
