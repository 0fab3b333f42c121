"""The catalogue's entry of a robot: what it is, independent of any world."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Length, Name, NonNegative, Number, Positive, Spec, Vec3
from anysim_schemas.collision_shapes import CollisionShapesSpec
from anysim_schemas.errors import KeyFault
from anysim_schemas.object_source import PACKAGES
from anysim_schemas.objects import ContactSpec
from anysim_schemas.sensors import SensorNoiseSpec
from anysim_schemas.vehicle import VehicleSpec

Category = Literal["arm", "dual_arm", "hand", "base", "mobile_manipulator", "humanoid", "quadruped", "camera"]


class GainSpec(Spec):
    """The drive of a joint: u = kp (q* - q) + kd (qd* - qd) + ff, clipped to the effort limit."""

    kp: NonNegative = Field(description="stiffness [N m/rad] or [N/m]")
    kd: NonNegative = Field(description="damping [N m s/rad] or [N s/m]")
    effort_limit: Positive | None = Field(
        default=None,
        description="largest effort [N m] or [N]; the source's limit of the joint and of its drive where not given",
    )
    armature: NonNegative | None = Field(
        default=None, description="rotor inertia seen at the joint [kg m^2] or [kg]; the source's where not given"
    )
    damping: NonNegative | None = Field(
        default=None, description="of the joint itself [N m s/rad] or [N s/m]; the source's where not given"
    )
    friction: NonNegative | None = Field(
        default=None, description="dry friction of the joint itself [N m] or [N]; the source's where not given"
    )


class ChannelSpec(Spec):
    """A group of joints that is commanded together: the `base`, an `arm` or an `eef`."""

    joints: tuple[str, ...] = Field(min_length=1, description="joint names, in the order of the command")
    groups: dict[Name, tuple[str, ...]] = Field(
        default_factory=dict, description="named parts of the channel, as `left` and `right`: some of its joints"
    )
    gains: GainSpec | None = Field(default=None, description="the drive of every joint; the source's where not given")
    joint_gains: dict[str, GainSpec] = Field(
        default_factory=dict, description="drives that differ: by joint name, `*` matches any part; a later one wins"
    )
    mode: Literal["position", "velocity", "effort"] = Field(
        default="position", description="what the drives obey until a controller says otherwise; wheels: velocity"
    )
    controllers: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="controllers that suit the channel, with their parameters on this robot; the first is the default",
    )
    opened: tuple[Number, ...] | None = Field(default=None, description="eef: joint positions of the open gripper")
    closed: tuple[Number, ...] | None = Field(default=None, description="eef: joint targets of the closed gripper")
    synergies: dict[Name, tuple[Number, ...]] = Field(
        default_factory=dict,
        description="eef: grasps by name, as `power` or `pinch`: joint targets when fully closed, from `opened` on",
    )


class ToolSpec(Spec):
    """A frame that tasks refer to, fixed to a link. Convention: z points out of the hand, y along the opening."""

    link: str = Field(description="the link that carries it")
    position: Vec3 = Field(default=(0.0, 0.0, 0.0), description="place in the link's frame [m]")
    roll_pitch_yaw: Vec3 = Field(default=(0.0, 0.0, 0.0), description="orientation in the link's frame [rad]")
    group: str | None = Field(
        default=None, description="the group of the arm that moves it, where an arm has several, as `left`"
    )


class LegSpec(Spec):
    """A leg: its joints from the body down, and the foot at its end."""

    joints: tuple[str, ...] = Field(min_length=1, description="joint names, from the body to the foot")
    foot: str = Field(description="the link whose frame is the foot")
    radius: NonNegative = Field(default=0.0, description="radius of a ball foot about that frame [m]")
    sole: tuple[Number, Number, Number, Number] | None = Field(
        default=None, description="flat foot: x_min, x_max, y_min, y_max of the sole in the foot's frame [m]"
    )
    sole_height: Number = Field(default=0.0, description="flat foot: height of its frame above the sole [m]")


class SensorPlaceSpec(Spec):
    """A place for a sensor on the robot: `cameras: {wrist: {mount: panda.camera}}`, `sensors: {imu: go2.body_imu}`."""

    kind: Literal["camera", "depth", "imu", "force_torque", "lidar", "tactile", "touch", "tracking"] = Field(
        description="what belongs there"
    )
    link: str = Field(description="the link that carries it")
    position: Vec3 = Field(default=(0.0, 0.0, 0.0), description="place in the link's frame [m]")
    roll_pitch_yaw: Vec3 = Field(
        default=(0.0, 0.0, 0.0), description="orientation in the link's frame [rad]; a camera looks along z, y down"
    )
    params: dict[str, Any] = Field(
        default_factory=dict, description="of the sensor, as `preset: vlp_16` of a LiDAR; a world may say otherwise"
    )
    noise: dict[Name, SensorNoiseSpec] = Field(
        default_factory=dict, description="noise by field of the sensor, as its data sheet has it; a world may say more"
    )


class PartSpec(Spec):
    """Another model fixed to a link: a gripper on an arm, an arm on a base."""

    source: str = Field(
        description="URI of the part's URDF, xacro, SDF or MJCF file, `FILE.xml#BODY` for one of several bodies, or "
        "`procedural:` with a builder"
    )
    params: dict[str, Any] = Field(
        default_factory=dict, description="parameters of a procedural source, or arguments of a xacro"
    )
    link: str = Field(description="the link that carries it")
    position: Vec3 = Field(default=(0.0, 0.0, 0.0), description="place of the part's root in that link's frame [m]")
    roll_pitch_yaw: Vec3 = Field(default=(0.0, 0.0, 0.0), description="orientation in that link's frame [rad]")
    prefix: str = Field(default="", description="put before the names of the part's links and joints")
    license: str = Field(description="SPDX expression of the part's licence")
    license_source: str = Field(description="where the licence is stated")


class SolidSpec(Spec):
    """A solid that a link collides with: exactly one shape, of full sizes."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("box",), ("sphere",), ("cylinder",), ("capsule",))

    box: tuple[Length, Length, Length] | None = Field(default=None, description="edge lengths x, y, z [m]")
    sphere: Length | None = Field(default=None, description="radius [m]")
    cylinder: tuple[Length, Length] | None = Field(default=None, description="radius, height along z [m]")
    capsule: tuple[Length, Length] | None = Field(
        default=None, description="radius, length of the straight part along z [m]"
    )
    position: Vec3 = Field(default=(0.0, 0.0, 0.0), description="place of its middle in the link's frame [m]")
    roll_pitch_yaw: Vec3 = Field(default=(0.0, 0.0, 0.0), description="orientation in the link's frame [rad]")

    @model_validator(mode="after")
    def _exactly_one(self) -> "SolidSpec":
        shapes = ("box", "sphere", "cylinder", "capsule")
        given = [shape for shape in shapes if getattr(self, shape) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(shapes)}; got {' and '.join(given) or 'none'}")
        return self


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
    source: str = Field(
        description="URI of the URDF, xacro, SDF or MJCF file, `FILE.xml#BODY` for one of several bodies, or "
        "`procedural:` with a builder"
    )
    params: dict[str, Any] = Field(
        default_factory=dict, description="parameters of a procedural source, or arguments of a xacro"
    )
    packages: dict[str, str] = Field(default_factory=dict, description=PACKAGES)
    visual_error: NonNegative | None = Field(
        default=None,
        description="[m] that 99 % of its looks may be off, in every world; that of the world where not given",
    )
    needs: str | None = Field(
        default=None, description="the package to install for it, where that is not a dependency: `pip install NEEDS`"
    )
    license: str = Field(description="SPDX expression of the asset's licence")
    license_source: str = Field(description="where the licence is stated")
    category: Category = Field(description="what kind of robot it is")
    base: Literal["fixed", "floating", "planar"] = Field(
        default="fixed",
        description="bolted down, free to move, or `planar`: at its height on joints base_x, base_y and base_yaw, "
        "which are put under the robot and move it over the ground",
    )
    base_height: Number = Field(
        default=0.0, description="height of the base's frame above the ground that it stands on, at home [m]"
    )
    parts: tuple[PartSpec, ...] = Field(default=(), description="models that are fixed to it")
    channels: dict[str, ChannelSpec] = Field(description="the groups of joints that are commanded, by name")
    home: dict[str, Number] = Field(default_factory=dict, description="joint positions [rad] or [m]; 0 where not given")
    tools: dict[str, ToolSpec] = Field(default_factory=dict, description="frames that tasks refer to, by name")
    sensors: dict[str, SensorPlaceSpec] = Field(default_factory=dict, description="places for sensors, by name")
    vehicle: VehicleSpec | None = Field(default=None, description="how it drives, where it does")
    legs: dict[Name, LegSpec] = Field(default_factory=dict, description="its legs by name, front left first")
    collision: dict[str, tuple[SolidSpec, ...]] = Field(
        default_factory=dict,
        description="links that collide with these solids instead of what the source says, which may be nothing, or a "
        "mesh whose convex hull fills what should be hollow",
    )
    collision_shapes: CollisionShapesSpec | None = Field(
        default=None,
        description="what the meshes of the source and of the parts collide as: hull, decompose or primitives; links "
        "that `collision` names have its solids",
    )
    surfaces: tuple[SurfaceSpec, ...] = Field(default=(), description="contact parameters of links")
    self_collision: Flag = Field(default=False, description="whether links of this robot collide with each other")
    self_collision_exclusions: tuple[Annotated[tuple[str, str], Field()], ...] = Field(
        default=(), description="pairs of links that never collide, where others do; `*` matches any part"
    )
    gravity_compensation: Flag = Field(
        default=True,
        description="the robot's own controller cancels its weight; never of one that stands on the ground",
    )

    @model_validator(mode="after")
    def _moves(self) -> "RobotModelSpec":
        if self.collision_shapes is not None and self.collision_shapes.method == "mesh":
            text = "triangles are for what is fixed, and a robot's links move; say `decompose`, or leave it out"
            raise KeyFault(text, "collision_shapes.method")
        return self
