"""The ground: a plane, heights from rows, files or generators, a triangle mesh, or tiles of generated ground."""

from typing import Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Flag, Fraction, Integer, NonNegative, Number, Positive, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import ColorValue

Span = NonNegative | tuple[NonNegative, NonNegative]
"""A parameter of generated ground: one number, or what it is at difficulty 0 and at difficulty 1."""

Generated = Literal["rough", "waves", "slopes", "stairs", "stepping_stones", "gaps", "obstacles", "pits"]
GENERATED: dict[str, dict[str, Any]] = {
    "rough": {"amplitude": (0.02, 0.12), "grain": 0.3},
    "waves": {"amplitude": (0.04, 0.3), "wavelength": 2.0},
    "slopes": {"slope": (0.05, 0.5), "down": False, "amplitude": 0.0, "grain": 0.3},
    "stairs": {"rise": (0.05, 0.22), "tread": 0.4, "down": False},
    "stepping_stones": {"stone": (1.0, 0.4), "gap": (0.2, 0.5), "depth": 1.0},
    "gaps": {"gap": (0.2, 1.0), "depth": 1.0},
    "obstacles": {"rise": (0.05, 0.3), "block": (0.4, 1.2), "density": 0.4, "down": False},
    "pits": {"depth": (0.05, 0.4)},
}
"""The kinds of generated ground, and what their parameters are where a file does not say."""


class ReliefSpec(Spec):
    """The parameters of generated ground; each kind has its own, and a parameter of another kind is a fault.

    Those that may be a pair grow (or shrink) with the difficulty: `[at difficulty 0, at difficulty 1]`.
    """

    amplitude: Span | None = Field(
        default=None, description="rough, waves: largest height and depth; slopes: that of bumps on them [m]"
    )
    grain: Positive | None = Field(default=None, description="rough, slopes: distance of neighbouring bumps [m]")
    wavelength: Positive | None = Field(default=None, description="waves: from crest to crest [m]")
    slope: Span | None = Field(default=None, description="slopes: rise over run of the pyramid's sides")
    rise: Span | None = Field(default=None, description="stairs: height of a step; obstacles: of the highest one [m]")
    tread: Positive | None = Field(default=None, description="stairs: depth of a step [m]")
    down: Flag | None = Field(
        default=None, description="slopes, stairs: the middle is a pit, not a hill; obstacles: holes, not blocks"
    )
    stone: Span | None = Field(default=None, description="stepping_stones: edge of a stone [m]")
    gap: Span | None = Field(default=None, description="stepping_stones, gaps: distance to cross [m]")
    depth: Span | None = Field(
        default=None, description="stepping_stones, gaps: how far down it goes; pits: how far it is to climb out [m]"
    )
    block: tuple[Positive, Positive] | None = Field(
        default=None, description="obstacles: shortest and longest edge of a block [m]"
    )
    density: NonNegative | None = Field(default=None, description="obstacles: blocks per square metre")
    platform: Positive = Field(default=2.0, description="edge of the flat square in the middle, where robots start [m]")

    def parameters(self, kind: str) -> dict[str, Any]:
        """What a kind of ground is generated from: as given, else the kind's own values."""
        given = {name: getattr(self, name) for name in GENERATED[kind]}
        return {n: GENERATED[kind][n] if v is None else v for n, v in given.items()} | {"platform": self.platform}

    def _check_parameters(self, kind: str) -> None:
        own = GENERATED.get(kind, {})
        for name in {n: None for table in GENERATED.values() for n in table}:
            if getattr(self, name) is not None and name not in own:
                users = ", ".join(k for k, table in GENERATED.items() if name in table)
                has = f"{kind} has {', '.join(own)}" if own else f"kind {kind} is not generated"
                raise KeyFault(f"`{name}` is a parameter of {users}; {has}", name)
        if self.block is not None and self.block[0] > self.block[1]:
            raise KeyFault(f"the shortest edge {self.block[0]:g} is above the longest {self.block[1]:g}", "block")


class TileColumnSpec(ReliefSpec):
    """One kind of ground in a tiled terrain, with its parameters. A bare string is the kind."""

    kind: Generated = Field(description="how the tiles of this column are generated")
    weight: Positive = Field(default=1.0, description="how often it is chosen, in any unit")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The kind of ground."""
        return {"kind": text}

    @model_validator(mode="after")
    def _own_parameters(self) -> "TileColumnSpec":
        self._check_parameters(self.kind)
        return self


class TilesSpec(Spec):
    """Many pieces of ground beside each other: a row for each level of difficulty, a column for each kind."""

    columns: tuple[TileColumnSpec, ...] = Field(
        default=tuple(TileColumnSpec(kind=kind) for kind in ("rough", "slopes", "stairs", "obstacles")),
        min_length=1,
        description="kinds of ground, side by side along y",
    )
    rows: Integer = Field(default=5, gt=0, description="levels of difficulty, one behind the other along x")
    difficulty: tuple[Fraction, Fraction] = Field(default=(0.0, 1.0), description="of the first and the last row")
    size: Positive = Field(default=8.0, description="edge of a tile [m]")
    border: NonNegative = Field(default=2.0, description="flat ground around all tiles [m]")
    choose: Literal["draw", "curriculum"] = Field(
        default="draw",
        description="each episode draws a level, or an env keeps its own until it is promoted or demoted",
    )
    start: Integer | None = Field(
        default=None, ge=0, description="curriculum: highest level that an env may begin with; the last where not given"
    )

    @model_validator(mode="after")
    def _levels_fit(self) -> "TilesSpec":
        if self.difficulty[0] > self.difficulty[1]:
            raise KeyFault(
                f"the first row {self.difficulty[0]:g} is harder than the last {self.difficulty[1]:g}", "difficulty"
            )
        if self.start is not None and self.choose != "curriculum":
            raise KeyFault("`start` is for `choose: curriculum`; a drawn level needs none", "start")
        if self.start is not None and self.start >= self.rows:
            raise KeyFault(f"levels go from 0 to {self.rows - 1} with {self.rows} rows, got {self.start}", "start")
        for i, column in enumerate(self.columns):
            if column.platform >= self.size:
                raise KeyFault(
                    f"a platform of {column.platform:g} m does not fit a tile of {self.size:g} m",
                    "columns",
                    str(i),
                    "platform",
                )
        return self


class TerrainSpec(ReliefSpec):
    """The ground of a world. A bare string is the kind."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("heights",), ("file", "height_range", "scale"))
    needs: ClassVar[dict[str, tuple[str, ...]]] = {
        "heights": ("heightfield",), "file": ("heightfield", "trimesh"), "height_range": ("heightfield",),
        "scale": ("heightfield", "trimesh"), "tiles": ("tiles",), "difficulty": tuple(GENERATED),
    }  # fmt: skip
    """Keys that go with some kinds alone."""

    kind: Literal[
        "plane",
        "none",
        "heightfield",
        "trimesh",
        "tiles",
        "rough",
        "waves",
        "slopes",
        "stairs",
        "stepping_stones",
        "gaps",
        "obstacles",
        "pits",
    ] = Field(default="plane", description="what the ground is")
    friction: Number = Field(default=0.8, ge=0, description="sliding friction coefficient")
    restitution: Number = Field(default=0.0, ge=0, lt=1, description="ratio of speeds after and before a bounce")
    margin: Number | None = Field(
        default=None,
        ge=0,
        description="distance [m] above the ground from which on it pushes (0), where the engine has compliance",
    )
    color: ColorValue = Field(
        default=(0.45, 0.47, 0.5), description="red, green, blue in [0, 1], a name, or a value drawn in each episode"
    )
    heights: tuple[tuple[Number, ...], ...] | None = Field(
        default=None,
        description="heightfield: rows of heights [m]; first row at the lowest y, first column at the lowest x",
    )
    file: str | None = Field(
        default=None,
        description="heightfield: an array (.npy, .npz), a grey image or a mesh seen from above; trimesh: a mesh file",
    )
    height_range: tuple[Number, Number] | None = Field(
        default=None, description="heightfield from an image: height of black and of white [m]"
    )
    scale: Positive | None = Field(default=None, description="factor of a mesh file's lengths")
    size: tuple[Positive, Positive] = Field(
        default=(10.0, 10.0), description="heightfield and generated ground: extent along x and y [m]"
    )
    cell: Positive = Field(default=0.1, description="generated ground: distance of neighbouring heights [m]")
    difficulty: Fraction | None = Field(
        default=None, description="generated ground: 0 is easy, 1 is hard; 0.5 if unsaid"
    )
    seed: Integer = Field(default=0, ge=0, description="seed of generated ground; the same seed is the same ground")
    tiles: TilesSpec | None = Field(
        default=None, description="kind tiles: which pieces there are, and who stands where"
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The kind of ground."""
        return {"kind": text}

    @property
    def tiling(self) -> TilesSpec:
        """The tiles of kind tiles: as given, else the usual ones."""
        return TilesSpec() if self.tiles is None else self.tiles

    @model_validator(mode="after")
    def _keys_fit_the_kind(self) -> "TerrainSpec":
        if self.kind == "heightfield" and self.heights is None and self.file is None:
            raise ValueError("kind heightfield needs `heights`, or a `file` that has them")
        for name, kinds in self.needs.items():
            if getattr(self, name) is not None and self.kind not in kinds:
                raise KeyFault(f"`{name}` goes with kind {' or '.join(kinds)}; this is {self.kind}", name)
        self._check_parameters(self.kind)
        if self.heights is not None and self.file is not None:
            raise KeyFault("give either `heights` or `file`", "file")
        if self.kind == "trimesh" and self.file is None:
            raise ValueError("kind trimesh needs a `file` with the mesh")
        if self.heights is not None:
            lengths = sorted({len(row) for row in self.heights})
            if len(lengths) > 1:
                raise KeyFault(f"the rows differ in length: {' and '.join(map(str, lengths))}", "heights")
            if len(self.heights) < 2 or lengths[0] < 2:
                raise KeyFault("expected at least two rows of at least two heights", "heights")
        if self.kind in GENERATED and self.platform >= min(self.size):
            raise KeyFault(f"a platform of {self.platform:g} m does not fit into {min(self.size):g} m", "platform")
        return self
