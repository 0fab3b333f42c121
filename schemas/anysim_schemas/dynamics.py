"""Differences of a robot from its catalogue entry: drives, joints, masses, surfaces, a payload."""

from pydantic import Field

from anysim_schemas.base import Flag, Spec, Vec3
from anysim_schemas.values import FloatValue, NonNegativeValue, PositiveValue


class PayloadSpec(Spec):
    """A point mass that a link carries."""

    link: str = Field(description="the link that carries it")
    mass: NonNegativeValue = Field(description="its mass [kg]")
    position: Vec3 | None = Field(
        default=None, description="its place in the link's frame [m]; the link's centre of mass where not given"
    )


class RobotDynamicsSpec(Spec):
    """Factors and offsets of the catalogue's values. Each is one draw for the whole robot, unless `independent`."""

    independent: Flag = Field(default=False, description="each joint, drive and link draws for itself")
    kp_scale: PositiveValue = Field(default=1.0, description="factor of the drives' stiffness")
    kd_scale: PositiveValue = Field(default=1.0, description="factor of the drives' damping")
    effort_limit_scale: PositiveValue = Field(default=1.0, description="factor of the drives' effort limits")
    damping_scale: PositiveValue = Field(default=1.0, description="factor of the joints' damping")
    damping_offset: FloatValue = Field(default=0.0, description="added to the joints' damping [N m s/rad] or [N s/m]")
    friction_scale: PositiveValue = Field(default=1.0, description="factor of the joints' dry friction")
    friction_offset: FloatValue = Field(default=0.0, description="added to the joints' dry friction [N m] or [N]")
    armature_scale: PositiveValue = Field(default=1.0, description="factor of the joints' armature")
    armature_offset: FloatValue = Field(default=0.0, description="added to the joints' armature [kg m^2] or [kg]")
    mass_scale: PositiveValue = Field(default=1.0, description="factor of the links' masses and inertias")
    link_friction_scale: PositiveValue = Field(
        default=1.0, description="factor of the friction coefficients of the links' surfaces"
    )
    payload: PayloadSpec | None = Field(default=None, description="a point mass that one link carries")
