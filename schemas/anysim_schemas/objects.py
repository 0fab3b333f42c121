"""Objects: what exists. Where it goes is in layout, how it behaves is in its physical fields."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Integer, Number, Positive, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.joints import ObjectJointSpec
from anysim_schemas.plugin import PluginSlot
from anysim_schemas.values import ColorValue, NonNegativeValue, PositiveValue

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh", "asset", "procedural")
PROCEDURAL = "procedural:"
"""What the URI of a procedural asset begins with."""
MESH_ENDINGS = (".stl", ".obj", ".dae", ".glb", ".ply")


class SourceSpec(Spec):
    """The shape of an object: exactly one of a primitive, a mesh file, an asset file or a procedural asset.

    Sizes are full sizes. A bare string is the URI of an asset, or of a mesh where it ends like one.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        *((shape,) for shape in SHAPES[:-1]), ("procedural", "params"),
    )  # fmt: skip

    box: tuple[Positive, Positive, Positive] | None = Field(default=None, description="edge lengths x, y, z [m]")
    sphere: Positive | None = Field(default=None, description="radius [m]")
    cylinder: tuple[Positive, Positive] | None = Field(default=None, description="radius, height along z [m]")
    capsule: tuple[Positive, Positive] | None = Field(
        default=None, description="radius, length of the straight part along z [m]"
    )
    mesh: str | None = Field(default=None, description="URI of a mesh file; collides as its convex hull")
    asset: str | None = Field(default=None, description="URI of a URDF or MJCF file")
    procedural: str | None = Field(
        default=None, description="a builder of articulated assets, as in `anysim list assets`"
    )
    params: Annotated[dict[str, Any], PluginSlot("asset", "procedural")] = Field(
        default_factory=dict, description="parameters owned by the builder"
    )
    scale: Positive = Field(default=1.0, description="scale of a mesh, an asset or a procedural asset")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The URI of a mesh or an asset; `procedural:NAME` is a builder with its defaults."""
        if text.startswith(PROCEDURAL):
            return {"procedural": text.removeprefix(PROCEDURAL)}
        return {"mesh" if text.lower().endswith(MESH_ENDINGS) else "asset": text}

    @classmethod
    def text_means(cls) -> str:
        """What a bare string means, for editors."""
        return (
            "{asset: URI}, or {mesh: URI} where it ends in "
            + ", ".join(MESH_ENDINGS)
            + "; procedural:NAME is a builder"
        )

    @model_validator(mode="after")
    def _exactly_one(self) -> "SourceSpec":
        given = [shape for shape in SHAPES if getattr(self, shape) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(SHAPES)}; got {' and '.join(given) or 'none'}")
        if self.params and self.procedural is None:
            raise KeyFault("`params` are for the builder that `procedural` names", "params")
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


class ObjectSpec(Spec):
    """One object of the world."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("mass",), ("density",))

    source: SourceSpec = Field(description="its shape: a primitive, a mesh or an asset")
    fixed: Flag = Field(default=False, description="welded to the world; may still be placed anew at each reset")
    mass: PositiveValue | None = Field(default=None, description="mass [kg]; exclusive with density")
    density: PositiveValue | None = Field(
        default=None, description="density [kg/m^3]; 1000 where neither it nor mass is given"
    )
    friction: NonNegativeValue | None = Field(
        default=None, description="sliding friction coefficient; 0.8, or an asset's own, where not given"
    )
    restitution: Annotated[Number, Field(ge=0, lt=1)] | None = Field(
        default=None, description="ratio of speeds after and before a bounce; 0, or an asset's own, where not given"
    )
    color: ColorValue | None = Field(
        default=None, description="red, green, blue in [0, 1], or a colour name such as `red`; grey, or a file's own"
    )
    contact: ContactSpec | None = Field(
        default=None, description="how its surface gives; the default, or an asset's own"
    )
    joints: dict[str, ObjectJointSpec] = Field(
        default_factory=dict, description="joints of an articulated object by name, `*` matches any part"
    )
    label: str | None = Field(default=None, description="semantic label; the object's name where not given")
    collides: Flag = Field(default=True, description="false for something that is only seen")

    @model_validator(mode="after")
    def _one_of_mass_and_density(self) -> "ObjectSpec":
        if self.mass is not None and self.density is not None:
            raise ValueError("give either mass or density, not both")
        return self
