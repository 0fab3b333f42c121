"""Objects: what exists. Where it goes is in layout, how it behaves is in its physical fields."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Integer, Number, Positive, Spec
from anysim_schemas.matter import DampingSpec, MaterialValue, SolverSpec, TextureValue
from anysim_schemas.values import BounceValue, ColorValue, NonNegativeValue, PositiveValue, Vec3Value

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh", "asset")
MESH_ENDINGS = (".stl", ".obj", ".dae", ".glb", ".ply")


class SourceSpec(Spec):
    """The shape of an object: exactly one of a primitive, a mesh file or an asset file. Sizes are full sizes.

    A bare string is the URI of an asset, or of a mesh where it ends like one.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = tuple((shape,) for shape in SHAPES)

    box: tuple[Positive, Positive, Positive] | None = Field(default=None, description="edge lengths x, y, z [m]")
    sphere: Positive | None = Field(default=None, description="radius [m]")
    cylinder: tuple[Positive, Positive] | None = Field(default=None, description="radius, height along z [m]")
    capsule: tuple[Positive, Positive] | None = Field(
        default=None, description="radius, length of the straight part along z [m]"
    )
    mesh: str | None = Field(default=None, description="URI of a mesh file; collides as its convex hull")
    asset: str | None = Field(default=None, description="URI of a URDF or MJCF file")
    scale: Positive = Field(default=1.0, description="scale of a mesh or asset")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The URI of a mesh or an asset."""
        return {"mesh" if text.lower().endswith(MESH_ENDINGS) else "asset": text}

    @classmethod
    def text_means(cls) -> str:
        """What a bare string means, for editors."""
        return "{asset: URI}, or {mesh: URI} where it ends in " + ", ".join(MESH_ENDINGS)

    @model_validator(mode="after")
    def _exactly_one(self) -> "SourceSpec":
        given = [shape for shape in SHAPES if getattr(self, shape) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(SHAPES)}; got {' and '.join(given) or 'none'}")
        return self


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

    source: SourceSpec = Field(description="its shape: a primitive, a mesh or an asset")
    fixed: Flag = Field(default=False, description="welded to the world; may still be placed anew at each reset")
    mass: PositiveValue | None = Field(default=None, description="mass [kg]; exclusive with density")
    density: PositiveValue | None = Field(
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
