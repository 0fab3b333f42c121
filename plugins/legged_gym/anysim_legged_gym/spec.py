"""The configuration of a simulator, in the sections that legged-gym code has: asset, control, terrain and the rest."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from anysim_schemas.base import Degrees, Flag, Integer, NonNegative, Number, Positive, Spec, Vec3
from anysim_schemas.engine import EngineSpec
from anysim_schemas.errors import KeyFault
from anysim_schemas.terrain import GENERATED, TerrainSpec, TilesSpec


def _ordered(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError(f"the least, {span[0]:g}, is above the most, {span[1]:g}")
    return span


Span = Annotated[tuple[Number, Number], AfterValidator(_ordered)]
"""The least and the most that is drawn, uniformly."""

Factor = Annotated[tuple[NonNegative, NonNegative], AfterValidator(_ordered)]
Steps = Annotated[tuple[Integer, Integer], AfterValidator(_ordered)]
ByName = NonNegative | dict[str, NonNegative]
"""One number, or one for the joints whose names hold a text: `{hip: 40.0, calf: 60.0}`."""


class SimSpec(Spec):
    """Time and gravity."""

    dt: Positive = Field(default=0.002, description="physics time step [s]")
    gravity: Vec3 = Field(default=(0.0, 0.0, -9.81), description="[m/s^2]")


class AssetSpec(Spec):
    """The robot, and which of its links matter to an env."""

    robot: str = Field(default="unitree_go1", description="a legged robot of the catalogue, or the YAML file of one")
    feet: tuple[str, ...] | None = Field(default=None, description="links or tools; the catalogue's legs if not given")
    terminate_after_contacts_on: tuple[str, ...] = Field(default=(), description="parts of names of links")
    penalize_contacts_on: tuple[str, ...] = Field(default=(), description="parts of names of links")
    key_bodies: tuple[str, ...] = Field(default=(), description="links or tools that are tracked and drawn")
    self_collision: Flag | None = Field(default=None, description="as the catalogue says where not given")


class InitStateSpec(Spec):
    """The state after a reset, over the origin of the env's ground."""

    position: Vec3 | None = Field(default=None, description="of the base [m]; the catalogue's height if not given")
    rotation: tuple[Number, Number, Number, Number] = Field(default=(0.0, 0.0, 0.0, 1.0), description="xyzw")
    lin_vel: Vec3 = Field(default=(0.0, 0.0, 0.0), description="of the base [m/s], world axes")
    ang_vel: Vec3 = Field(default=(0.0, 0.0, 0.0), description="of the base [rad/s], world axes")
    default_joint_angles: dict[str, Number] = Field(
        default_factory=dict, description="[rad] by joint, where they are not the catalogue's home"
    )


class ControlSpec(Spec):
    """How actions become torques.

    P: kp (default + scale action - q) - kd qd; V: kp (scale action - qd); T: scale action. Clipped to the limits.
    """

    control_type: Literal["P", "V", "T"] = Field(default="P", description="position, velocity or torque")
    stiffness: ByName | None = Field(default=None, description="kp; the catalogue's where not given")
    damping: ByName | None = Field(default=None, description="kd; the catalogue's where not given. V has none")
    armature: NonNegative | None = Field(default=None, description="[kg m^2]; the catalogue's where not given")
    action_scale: Positive = Field(default=0.25, description="[rad], [rad/s] or [N m] for an action of one")
    clip_actions: Positive = Field(default=100.0, description="largest size of an action")
    decimation: Integer = Field(default=10, gt=0, description="physics steps for one action")


class GroundSpec(Spec):
    """The ground: a plane, heights, or the same heights as triangles, and where they are measured."""

    mesh_type: Literal["plane", "heightfield", "trimesh"] = Field(default="plane", description="how it is built")
    ground: TerrainSpec | None = Field(
        default=None, description="as in `world.terrain`; tiles with a curriculum where it is no plane"
    )
    measured_points_x: tuple[Number, ...] = Field(
        default=tuple(round(-0.8 + 0.1 * i, 1) for i in range(17)), description="ahead of the base [m]"
    )
    measured_points_y: tuple[Number, ...] = Field(
        default=tuple(round(-0.5 + 0.1 * i, 1) for i in range(11)), description="to the left of the base [m]"
    )

    @property
    def surface(self) -> TerrainSpec:
        """What is built."""
        if self.ground is not None:
            return self.ground
        if self.mesh_type == "plane":
            return TerrainSpec()
        return TerrainSpec(kind="tiles", tiles=TilesSpec(choose="curriculum"))

    @model_validator(mode="after")
    def _one_kind(self) -> "GroundSpec":
        kind, tilted = self.surface.kind, self.mesh_type != "plane"
        fits = {
            "plane": ("plane",),
            "heightfield": ("heightfield", "tiles", *GENERATED),
            "trimesh": ("trimesh", "heightfield", "tiles", *GENERATED),
        }[self.mesh_type]
        if kind not in fits:
            named = f"mesh_type {self.mesh_type} is built of kind {' or '.join(fits)}; this is {kind}"
            raise KeyFault(named, *(("ground", "kind") if tilted or self.ground is not None else ("mesh_type",)))
        return self


class DomainRandSpec(Spec):
    """What differs between envs. What is not given stays as built.

    Friction, restitution, masses and armature are drawn once; gains and delays anew at each reset.
    """

    friction: Factor | None = Field(default=None, description="factor of all surfaces, the ground's too")
    restitution: Factor | None = Field(default=None, description="of all surfaces, the ground's too")
    added_base_mass: Span | None = Field(default=None, description="[kg]")
    base_com_bias: Span | None = Field(default=None, description="[m] along each axis of the base")
    joint_armature: Factor | None = Field(default=None, description="[kg m^2] of all joints of an env")
    kp_scale: Factor | None = Field(default=None, description="by joint")
    kd_scale: Factor | None = Field(default=None, description="by joint")
    ctrl_delay: Steps | None = Field(default=None, description="actions by which an action is late")
    max_push_vel_xy: NonNegative = Field(default=1.0, description="[m/s] of `push_robots`")
    max_push_force: NonNegative = Field(default=50.0, description="[N] along each axis, of `push_links`")
    push_links: tuple[str, ...] = Field(default=(), description="links that `push_links` pushes; the base if not given")
    push_steps: Integer = Field(default=1, gt=0, description="actions for which `push_links` pushes")


class DepthSpec(Spec):
    """A depth camera on a link, that looks along its x axis, tilted down by `pitch`."""

    source: Literal["native", "rays"] = Field(
        default="rays", description="native: drawn by the engine; rays: the same on every engine"
    )
    link: str = Field(default="", description="the base where not given")
    position: Vec3 = Field(default=(0.3, 0.0, 0.05), description="in the link's frame [m]")
    pitch: Number = Field(default=0.5, description="below the link's x axis [rad]")
    resolution: tuple[Integer, Integer] = Field(default=(87, 58), description="width and height [pixels]")
    vertical_fov: Degrees = Field(default=58.0, description="[degrees]")
    near_plane: Positive = Field(default=0.1, description="[m]; what is nearer reads as this")
    far_plane: Positive = Field(default=3.0, description="[m]; what is farther reads as this")


class ViewerSpec(Spec):
    """Pictures of one env for a person, and what is drawn into them."""

    headless: Flag = Field(default=True, description="nothing is drawn, and the engine need not be able to")
    size: tuple[Integer, Integer] = Field(default=(640, 480), description="width and height [pixels]")
    eye: Vec3 = Field(default=(1.6, -1.6, 1.0), description="place of the camera from the env's origin [m]")
    target: Vec3 = Field(default=(0.0, 0.0, 0.25), description="where it looks, likewise [m]")
    env: Integer = Field(default=0, ge=0, description="the env that is looked at")
    debug_draw_height_points_around_base: Flag = Field(default=False, description="the measured heights")
    debug_draw_height_points_around_feet: Flag = Field(default=False, description="heights beside each foot")
    debug_draw_key_body_points: Flag = Field(default=False, description="key bodies and feet")
    debug_draw_depth_images: Flag = Field(default=False, description="the depth image, in a corner")


class LeggedSpec(Spec):
    """A batched simulator of one legged robot."""

    simulator: EngineSpec | None = Field(
        default=None, description="an installed engine; where not given, SIMULATOR of the environment says it"
    )
    num_envs: Integer = Field(default=1, gt=0, description="robots that are stepped together")
    seed: Integer = Field(default=0, ge=0, lt=2**63, description="seed of all that is drawn")
    sim: SimSpec = Field(default=SimSpec(), description="time and gravity")
    asset: AssetSpec = Field(default=AssetSpec(), description="the robot")
    init_state: InitStateSpec = Field(default=InitStateSpec(), description="where it begins")
    control: ControlSpec = Field(default=ControlSpec(), description="actions to torques")
    terrain: GroundSpec = Field(default=GroundSpec(), description="the ground")
    domain_rand: DomainRandSpec = Field(default=DomainRandSpec(), description="what differs between envs")
    depth: DepthSpec | None = Field(default=None, description="a depth camera")
    viewer: ViewerSpec = Field(default=ViewerSpec(), description="pictures for a person")

    @model_validator(mode="after")
    def _viewed_env_exists(self) -> "LeggedSpec":
        if self.viewer.env >= self.num_envs:
            raise KeyFault(f"there is no env {self.viewer.env}; envs go from 0 to {self.num_envs - 1}", "viewer", "env")
        return self

    def engine_data(self) -> dict[str, Any] | None:
        """What a run's file holds under `engine`; None where nothing is chosen."""
        return None if self.simulator is None else self.simulator.to_dict()
