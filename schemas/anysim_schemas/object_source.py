"""Sources of an object and their number: one source, a list or a folder to draw from, a count."""

from typing import Annotated, Any, ClassVar

from pydantic import Discriminator, Field, Strict, Tag, model_validator

from anysim_schemas.base import Length, Name, Scale, Spec
from anysim_schemas.collision_shapes import COLLISION, CollisionShapesSpec
from anysim_schemas.errors import KeyFault
from anysim_schemas.plugin import PluginSlot
from anysim_schemas.values import TAG_PREFIX, Choice, Range

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh", "asset", "procedural")
PROCEDURAL = "procedural:"
"""What the URI of a procedural asset begins with."""
ASSET = "URI of a URDF or MJCF file, FILE.xml#BODY for one of several; or of another format that an importer reads"
PACKAGES = "folders, as URIs, of packages that a URDF refers to as `package://NAME/…`, by NAME"
MESH_ENDINGS = (".stl", ".obj", ".dae", ".glb", ".gltf", ".off", ".3mf", ".ply")


class SourceSpec(Spec):
    """The shape of an object: exactly one of a primitive, a mesh file, an asset file or a procedural asset.

    Sizes are full sizes. A bare string is the URI of an asset, or of a mesh where it ends like one.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        *((shape, "scale") for shape in SHAPES[:-3]),
        ("mesh", "scale", "collision"),
        ("asset", "packages", "scale", "collision"),
        ("procedural", "params", "scale"),
    )

    box: tuple[Length, Length, Length] | None = Field(default=None, description="edge lengths x, y, z [m]")
    sphere: Length | None = Field(default=None, description="radius [m]")
    cylinder: tuple[Length, Length] | None = Field(default=None, description="radius, height along z [m]")
    capsule: tuple[Length, Length] | None = Field(
        default=None, description="radius, length of the straight part along z [m]"
    )
    mesh: str | None = Field(
        default=None, description="URI of a mesh file; collides as its convex hull unless `collision` says otherwise"
    )
    asset: str | None = Field(default=None, description=ASSET)
    packages: dict[str, str] = Field(default_factory=dict, description=PACKAGES)
    procedural: str | None = Field(
        default=None, description="a builder of articulated assets, as in `anysim list assets`"
    )
    params: Annotated[dict[str, Any], PluginSlot("asset", "procedural")] = Field(
        default_factory=dict, description="parameters owned by the builder"
    )
    scale: Scale = Field(default=1.0, description="scale of this source; the object's own `scale` multiplies it")
    collision: CollisionShapesSpec | None = Field(default=None, description=COLLISION)

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The URI of a mesh or an asset; `procedural:NAME` is a builder with its defaults."""
        if text.startswith(PROCEDURAL):
            return {"procedural": text.removeprefix(PROCEDURAL)}
        return {"mesh" if text.lower().endswith(MESH_ENDINGS) else "asset": text}

    @classmethod
    def text_means(cls) -> str:
        """What a bare string means, for editors."""
        endings = ", ".join(MESH_ENDINGS)
        return f"{{asset: URI}}, or {{mesh: URI}} where it ends in {endings}; procedural:NAME is a builder"

    @model_validator(mode="after")
    def _exactly_one(self) -> "SourceSpec":
        given = [shape for shape in SHAPES if getattr(self, shape) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(SHAPES)}; got {' and '.join(given) or 'none'}")
        if self.params and self.procedural is None:
            raise KeyFault("`params` are for the builder that `procedural` names", "params")
        if self.packages and self.asset is None:
            raise KeyFault("`packages` are for the URDF that `asset` names", "packages")
        if self.collision is not None and self.mesh is None and self.asset is None:
            raise KeyFault("`collision` is for meshes, of the files that `mesh` and `asset` name", "collision")
        return self


class SourceChoice(Choice[SourceSpec]):
    """One of several sources, drawn anew in each episode; each is equally likely unless `weights` says otherwise."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("choice", "weights", "ratio", "otherwise", "shared"),)


class SourceFolder(Spec):
    """One of the files of a folder, each equally likely, drawn anew in each episode."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("folder", "pattern", "scale", "collision", "shared"),)

    folder: str = Field(description="URI of a folder: relative to this file, or such as `package:my_assets/mugs`")
    pattern: str = Field(default="*", description="which files of it, such as `*.obj` or `*/model.urdf`")
    scale: Scale = Field(default=1.0, description="scale of each of them")
    collision: CollisionShapesSpec | None = Field(default=None, description=COLLISION)
    shared: Name | None = Field(default=None, description="fields that share a name share one draw in each episode")

    @model_validator(mode="after")
    def _stays_inside(self) -> "SourceFolder":
        if self.pattern.startswith("/") or ".." in self.pattern.split("/") or not self.pattern:
            raise KeyFault(
                f"the pattern '{self.pattern}' leaves the folder; give one for files in it, such as '*.obj'", "pattern"
            )
        return self


def _source_kind(value: object) -> str:
    """Which form of a source is written."""
    for kind, form in (("choice", SourceChoice), ("folder", SourceFolder)):
        if (isinstance(value, dict) and kind in value) or isinstance(value, form):
            return TAG_PREFIX + kind
    return TAG_PREFIX + "one"


Source = Annotated[
    Annotated[SourceSpec, Tag(TAG_PREFIX + "one")]
    | Annotated[SourceChoice, Tag(TAG_PREFIX + "choice")]
    | Annotated[SourceFolder, Tag(TAG_PREFIX + "folder")],
    Discriminator(_source_kind),
]
"""One source; or `{choice: [...], weights: [...]}`; or `{folder: ..., pattern: ...}`."""

MAX_COUNT = 100_000
Whole = Annotated[int, Strict(), Field(ge=0, le=MAX_COUNT)]


class CountRange(Range[Whole]):
    """A whole number from the first to the last, both included, each equally likely."""


class CountChoice(Choice[Whole]):
    """One of the listed numbers."""


def _count_kind(value: object) -> str:
    for kind, form in (("range", CountRange), ("choice", CountChoice)):
        if (isinstance(value, dict) and kind in value) or isinstance(value, form):
            return TAG_PREFIX + kind
    return TAG_PREFIX + "number"


Count = Annotated[
    Annotated[Whole, Tag(TAG_PREFIX + "number")]
    | Annotated[CountRange, Tag(TAG_PREFIX + "range")]
    | Annotated[CountChoice, Tag(TAG_PREFIX + "choice")],
    Discriminator(_count_kind),
]
"""How many: a number, `{range: [1, 4]}` (both included), or `{choice: [0, 3], weights: [1, 2]}`."""


def most(count: "int | CountRange | CountChoice") -> int:
    """The greatest number that a count can be."""
    if isinstance(count, int):
        return count
    drawn = count.range if isinstance(count, CountRange) else count.choice
    return max(*drawn, count.otherwise or 0)
