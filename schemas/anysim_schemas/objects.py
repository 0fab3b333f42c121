"""Objects: what exists. Where it goes is in layout, how it behaves is in its physical fields."""

from typing import Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Name, Positive, Spec, Vec3
from anysim_schemas.values import ColorValue, NonNegativeValue, PositiveValue


class SourceSpec(Spec):
    """The shape of an object: exactly one of a primitive, a mesh file or an asset file. Sizes are full sizes."""

    box: tuple[Positive, Positive, Positive] | None = Field(default=None, description="edge lengths x, y, z [m]")
    sphere: Positive | None = Field(default=None, description="radius [m]")
    cylinder: tuple[Positive, Positive] | None = Field(default=None, description="radius, height along z [m]")
    capsule: tuple[Positive, Positive] | None = Field(
        default=None, description="radius, length of the straight part along z [m]"
    )
    mesh: str | None = Field(default=None, description="URI of a mesh file; collides as its convex hull")
    asset: str | None = Field(default=None, description="URI of a URDF or MJCF file")
    scale: Positive = Field(default=1.0, description="scale of a mesh or asset")

    @model_validator(mode="before")
    @classmethod
    def _uri_shorthand(cls, data: object) -> object:
        """A bare string is the URI of an asset (or of a mesh, by its ending)."""
        if isinstance(data, str):
            key = "mesh" if data.lower().endswith((".stl", ".obj", ".dae", ".glb", ".ply")) else "asset"
            return {key: data}
        return data

    @model_validator(mode="after")
    def _exactly_one(self) -> "SourceSpec":
        given = [kind for kind in ("box", "sphere", "cylinder", "capsule", "mesh", "asset") if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of box, sphere, cylinder, capsule, mesh, asset; got {given or 'none'}")
        return self


class ContactSpec(Spec):
    """How a surface gives, engine-neutrally. Presets: `default`, `pad` (stiff gripper pads), `soft`."""

    preset: Literal["default", "pad", "soft"] = "default"
    torsional_friction: float = Field(default=0.005, ge=0, description="spin resistance [m]")
    rolling_friction: float = Field(default=0.0001, ge=0, description="rolling resistance [m]")
    priority: int = Field(default=0, description="in a pair the surface of higher priority decides friction and stiffness")


class ObjectSpec(Spec):
    """One object of the world."""

    source: SourceSpec
    fixed: bool = Field(default=False, description="welded to the world; may still be placed anew at each reset")
    mass: PositiveValue | None = Field(default=None, description="[kg]; exclusive with density")
    density: PositiveValue | None = Field(default=None, description="[kg/m^3]; 1000 where neither is given")
    friction: NonNegativeValue = Field(default=0.8, description="sliding friction coefficient")
    restitution: float = Field(default=0.0, ge=0, lt=1, description="ratio of speeds after and before a bounce")
    color: ColorValue = Field(default=(0.7, 0.7, 0.7))
    contact: ContactSpec = ContactSpec()
    label: str | None = Field(default=None, description="semantic label; the object's name where not given")
    collides: bool = True

    @model_validator(mode="after")
    def _one_of_mass_and_density(self) -> "ObjectSpec":
        if self.mass is not None and self.density is not None:
            raise ValueError("give either mass or density, not both")
        return self


class TerrainSpec(Spec):
    """The ground: an infinite plane, nothing, or a height field."""

    kind: Literal["plane", "none", "heightfield"] = "plane"
    friction: float = Field(default=0.8, ge=0)
    restitution: float = Field(default=0.0, ge=0, lt=1)
    color: tuple[float, float, float] = (0.45, 0.47, 0.5)
    heights: tuple[tuple[float, ...], ...] | None = Field(
        default=None, description="heightfield: rows of heights [m]; the first row is at the lowest y, the first column at the lowest x"
    )
    size: tuple[Positive, Positive] = Field(default=(10.0, 10.0), description="heightfield: extent along x and y [m]")

    @model_validator(mode="before")
    @classmethod
    def _name_shorthand(cls, data: object) -> object:
        return {"kind": data} if isinstance(data, str) else data

    @model_validator(mode="after")
    def _heights_given(self) -> "TerrainSpec":
        if (self.kind == "heightfield") != (self.heights is not None):
            raise ValueError("`heights` goes with kind heightfield, and with no other")
        if self.heights is not None and (len(self.heights) < 2 or len({len(row) for row in self.heights}) != 1):
            raise ValueError("heights needs at least two rows, all of the same length")
        return self


class LightSpec(Spec):
    """A directional light, or a point light where it has a position."""

    direction: Vec3 = (0.0, 0.0, -1.0)
    position: Vec3 | None = None
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: Positive = 0.8


class ContactSensorSpec(Spec):
    """Net contact force on an entity or link, in newtons, world axes."""

    body: str = Field(description="an entity (`cube`) or one of its links (`panda.panda_leftfinger`)")
    against: Name | None = Field(default=None, description="count only contacts with this entity")
