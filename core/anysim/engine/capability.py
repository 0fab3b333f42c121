"""Capabilities of engines and needs of worlds. Negotiation fails closed: a mismatch is an error before the build."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import NamedTuple

from anysim.errors import CapabilityError


class Capability(StrEnum):
    """One thing an engine may be able to do. The value is what messages and tables print."""

    RIGID_BODIES = "rigid bodies"
    ARTICULATIONS = "articulations"
    CONTACTS_STATIC = "contacts with static things"
    CONTACTS_MOVING = "contacts between moving bodies"
    TERRAIN_PLANE = "terrain: plane"
    TERRAIN_HEIGHTFIELD = "terrain: heightfield"
    TERRAIN_TRIMESH = "terrain: triangle mesh (concave)"
    SHAPE_MESH = "shape: mesh (convex)"
    MIMIC_JOINTS = "mimic joints"
    MIMIC_CURVES = "mimic joints: curves"
    TENDONS = "fixed tendons: springs and dampers"
    TENDON_LIMITS = "fixed tendons: limits, dry friction and armature"
    TENDON_DRIVES = "fixed tendons: drives"
    SPATIAL_TENDONS = "spatial tendons"
    CONNECTS = "connects"
    WELDS = "welds"
    JOINT_FRICTION = "joint friction"
    JOINT_SPRINGS = "joint springs"
    ARMATURE = "armature"
    JOINT_LIMITS = "joint limits"
    EFFORT_LIMITS = "effort limits"
    GRAVITY_COMPENSATION = "gravity compensation"
    RESTITUTION = "restitution"
    TORSIONAL_FRICTION = "torsional friction"
    COMPLIANCE = "compliance of contacts, limits and ties"
    BODY_DAMPING = "damping of free bodies"
    SOLVER_SETTINGS = "solver settings by entity"
    CONTROL_POSITION = "control: position"
    CONTROL_VELOCITY = "control: velocity"
    CONTROL_EFFORT = "control: effort"
    ACTUATION_EXPLICIT = "actuation: explicit_pd"
    ACTUATION_NATIVE = "actuation: native"
    VELOCITY_LIMITS = "velocity limits"
    WRENCHES = "external wrenches"
    CONTACT_SENSORS = "contact sensors"
    CONTACT_POINTS = "contact points"
    RAYCAST = "raycast"
    RENDER_RGB = "render: rgb"
    RENDER_DEPTH = "render: depth"
    RENDER_SEGMENTATION = "render: segmentation"
    RENDER_SHADOWS = "render: shadows"
    RENDER_LIGHTS = "render: several lights, or one with a place"
    TEXTURES = "render: textures"
    MATERIALS = "render: materials"
    SNAPSHOT_STATE = "snapshot: state"
    SNAPSHOT_TRAJECTORY = "snapshot: trajectory"
    VARYING_ENTITIES = "entities that vary by env"
    PARAMETERS_PER_ENV = "parameters per env"
    DYNAMICS = "dynamics"  # bodies fall; the null engine moves nothing by itself


class Support(NamedTuple):
    """How well: exact, or approximate with the error that was measured.

    `errors` are the numbers of the note that the contract suite measures, by the names it has for them.
    """

    exact: bool = True
    note: str = ""
    errors: Mapping[str, float] = MappingProxyType({})


def approximately(note: str, **errors: float) -> Support:
    """Support with measured errors: `approximately("within {bounce:g} of the coefficient", bounce=0.05)`.

    `anysim.testing.errors.MEASURES` has the names, and the contract suite checks that no error is larger than declared.
    """
    return Support(False, note.format(**errors), MappingProxyType(errors))


@dataclass(frozen=True)
class Capabilities:
    """What an engine declares. A capability that is not in `supported` is absent."""

    supported: Mapping[Capability, Support] = field(default_factory=dict[Capability, Support])

    @classmethod
    def of(cls, *exact: Capability, approximate: Mapping[Capability, str | Support] | None = None) -> "Capabilities":
        """`Capabilities.of(A, B, approximate={C: approximately("{sink:g} m of sink", sink=2e-3), D: "ignored"})`."""
        notes = {c: Support(False, s) if isinstance(s, str) else s for c, s in (approximate or {}).items()}
        table = {c: Support() for c in exact} | notes
        return cls(dict(sorted(table.items(), key=lambda item: list(Capability).index(item[0]))))

    def __contains__(self, capability: object) -> bool:
        return capability in self.supported

    def __iter__(self) -> Iterator[Capability]:
        return iter(self.supported)


@dataclass(frozen=True, slots=True)
class Need:
    """A world needs `capability` because of `why`: `joint 'wrist' is a mimic (robot 'arm')`.

    `path` is the key of the spec that asks for it, or the nearest above it, dotted: `world.cameras.front.channels`.
    """

    capability: Capability
    why: str
    path: str = ""


def check(
    engine: str,
    capabilities: Capabilities,
    needs: Sequence[Need],
    source: str = "this world",
    refusals: Sequence[str] = (),
    place: Callable[[str], str] = str,
) -> list[Need]:
    """Raise one CapabilityError that lists every absent need; return the needs met only approximately.

    `refusals` are the engine's own reasons against this world in particular, see `SimEngine.refusals`. `place` gives
    `file:line:column` for the path of a need, or the path itself where it is not known.
    """
    absent = [need for need in needs if need.capability not in capabilities]
    if absent or refusals:
        reasons = "; ".join([*(f"{need.why} ({need.capability}){_at(need.path, place)}" for need in absent), *refusals])
        raise CapabilityError(
            f"{engine} cannot run {source}: {reasons}. "
            f"Choose another engine (`anysim list engines` shows what each can do) or change what is named."
        )
    return [need for need in needs if not capabilities.supported[need.capability].exact]


def _at(path: str, place: Callable[[str], str]) -> str:
    where = place(path) if path else ""
    if where == "data":  # a mapping has keys, but no lines
        return f" at {path}"
    return f" at {where}" if where and where != path else ""


class Matrix(NamedTuple):
    """What several engines can do.

    `rows` hold a capability and a cell for each engine; a cell ends in the number of its note where it is approximate.
    `notes` hold `engine: measured error`.
    """

    engines: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]


def matrix(engines: Mapping[str, Capabilities], lifecycles: Mapping[str, str] | None = None) -> Matrix:
    """The table of capabilities by engine; `lifecycles` adds a row on how entities come and go."""
    notes: list[str] = []
    rows: list[tuple[str, ...]] = []
    for capability in Capability:
        cells: list[str] = []
        for name, declared in engines.items():
            support = declared.supported.get(capability)
            if support is None or support.exact:
                cells.append("-" if support is None else "yes")
                continue
            note = f"{name}: {support.note}"
            if note not in notes:
                notes.append(note)
            cells.append(f"approx. [{notes.index(note) + 1}]")
        rows.append((str(capability), *cells))
        if capability is Capability.VARYING_ENTITIES and lifecycles is not None:
            rows.append(("lifecycle of entities", *(lifecycles[name] for name in engines)))
    return Matrix(tuple(engines), tuple(rows), tuple(notes))


class Allowance(NamedTuple):
    """What an engine declares of a number that it cannot take over exactly.

    By how much a quantity of the audit may differ from the World's, relative to it, and why.
    """

    relative: float
    reason: str
