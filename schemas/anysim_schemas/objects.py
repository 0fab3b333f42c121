"""Objects: what exists. Where it goes is in layout, how it behaves is in its physical fields."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, Strict, model_validator

from anysim_schemas.base import Flag, Integer, NonNegative, Number, Positive, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.joints import ObjectJointSpec
from anysim_schemas.matter import DampingSpec, MaterialValue, SolverSpec, TextureValue
from anysim_schemas.object_source import Count, Source, SourceSpec as SourceSpec, most
from anysim_schemas.values import (
    BounceValue,
    ColorValue,
    DensityValue,
    MassValue,
    NonNegativeValue,
    PositiveValue,
    ScaleValue,
    Vec3Value,
)

Columns = Annotated[int, Strict(), Field(gt=0)]


class ContactSpec(Spec):
    """How a surface gives, engine-neutrally. Presets: `default`, `pad` (stiff gripper pads), `soft`."""

    preset: Literal["default", "pad", "soft"] = Field(default="default", description="stiffness and damping by name")
    torsional_friction: Annotated[Number, Field(ge=0)] | None = Field(
        default=None, description="spin resistance [m]; the preset's where not given"
    )
    rolling_friction: Annotated[Number, Field(ge=0)] | None = Field(
        default=None, description="rolling resistance [m]; the preset's where not given"
    )
    priority: Integer | None = Field(
        default=None,
        description="the surface of higher priority decides friction and stiffness; the preset's where not given",
    )
    offset: Positive | None = Field(
        default=None,
        description="distance [m] from which on contacts are prepared; forces act from touch on. The engine's own "
        "where not given",
    )


class ObjectSpec(Spec):
    """One object of the world."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("mass",), ("density",))
    belongs_to: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("position", "pose", "quaternion", "on", "yaw", "x", "y", "z"),
        "where an object is belongs to `world.layout`, under its name",
    )

    source: Source = Field(description="its shape: a primitive, a mesh or an asset; or several to draw from")
    scale: ScaleValue = Field(
        default=1.0, description="multiplies all its lengths; a range is drawn from as many sizes as `sizes` says"
    )
    sizes: Annotated[int, Strict(), Field(ge=2, le=64)] = Field(
        default=5, description="in how many sizes a drawn range of `scale` is made: geometry is fixed at build"
    )
    count: Count | None = Field(
        default=None, description="how many there are: cube_0, cube_1, …; one, of the bare name, where not given"
    )
    family: Literal["rigid", "articulation", "rigid_instancer"] | None = Field(
        default=None, description="what it must be; as its source has it where not given. An instancer is many as one"
    )
    grid: tuple[Columns, Columns] | None = Field(
        default=None, description="with rigid_instancer: columns along x and y of one layer; about a cube otherwise"
    )
    gap: NonNegative | None = Field(
        default=None, description="with rigid_instancer: free space between neighbours [m]; a tenth of their size"
    )
    fixed: Flag = Field(default=False, description="welded to the world; may still be placed anew at each reset")
    mass: MassValue | None = Field(default=None, description="mass [kg]; exclusive with density")
    density: DensityValue | None = Field(
        default=None, description="density [kg/m^3]; 1000 where neither it nor mass is given"
    )
    com_offset: Vec3Value | None = Field(
        default=None, description="shifts the centre of mass of its (root) body [m], body frame"
    )
    inertia_scale: PositiveValue | None = Field(
        default=None, description="factor on the inertia that shape and mass give; 1 where not given"
    )
    friction: NonNegativeValue | None = Field(
        default=None, description="sliding friction coefficient; 0.8, or an asset's own, where not given"
    )
    restitution: BounceValue | None = Field(
        default=None, description="ratio of speeds after and before a bounce; 0, or an asset's own, where not given"
    )
    damping: DampingSpec | None = Field(default=None, description="how fast it comes to rest by itself; not at all")
    contact: ContactSpec | None = Field(
        default=None, description="how its surface gives; the default, or an asset's own"
    )
    joints: dict[str, ObjectJointSpec] = Field(
        default_factory=dict, description="joints of an articulated object by name, `*` matches any part"
    )
    solver: SolverSpec | None = Field(
        default=None, description="settings of the contact solver for this object, where an engine has them"
    )
    color: ColorValue | None = Field(
        default=None,
        description="red, green, blue in [0, 1], or a colour name such as `red`; its material's, a file's own, or grey",
    )
    texture: TextureValue | None = Field(default=None, description="what is painted on it, tinted with `color`")
    material: MaterialValue | None = Field(
        default=None, description="how it answers light, and its colour where `color` and `texture` say nothing"
    )
    label: str | None = Field(default=None, description="semantic label; the object's name where not given")
    collides: Flag = Field(default=True, description="false for something that is only seen")

    @model_validator(mode="after")
    def _one_of_mass_and_density(self) -> "ObjectSpec":
        if self.mass is not None and self.density is not None:
            raise ValueError("give either mass or density, not both")
        return self

    @model_validator(mode="after")
    def _a_number_of_them(self) -> "ObjectSpec":
        if self.count is not None and most(self.count) < 1:
            raise KeyFault("a count that is always 0 is no object; leave the object out, or set it to null", "count")
        if self.family == "rigid_instancer":
            if not isinstance(self.count, int):
                raise KeyFault(
                    "a rigid_instancer needs a `count` that is one number: it is made once, as a whole",
                    "count" if self.count is not None else "family",
                )
            return self
        for key in ("grid", "gap"):
            if getattr(self, key) is not None:
                raise KeyFault(f"`{key}` is for `family: rigid_instancer`; others are placed by the layout", key)
        return self
