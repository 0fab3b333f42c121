"""The imported model: parts of a World with local names and local indices, as an importer makes them of a file.

Every importer (URDF here, MJCF in the package that has a parser for it) returns an `ImportedModel`; `compile_world`
puts it into a World under an entity's name. Importers of other formats are entry points of the group
`anysim.importers`, functions with the signature of `Importer`.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import StrEnum
from math import isinf, isnan
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

from anysim.assets.meshes import WholeMesh
from anysim.conventions import IDENTITY_QUATERNION
from anysim.model.affordances import Affordance
from anysim.model.frames import FixedFrame
from anysim.model.world import (
    ORIGIN,
    Body,
    Constraint,
    ControlMode,
    Geom,
    HeightField,
    Joint,
    Material,
    Mesh,
    Site,
    SpatialTendon,
    Tendon,
    Texture,
)


class ImportNote(NamedTuple):
    """What a user of a file should know: `repaired` values were changed, `dropped` ones left out, `info` is neither."""

    kind: Literal["repaired", "dropped", "info"]
    where: str  # a link, joint or element of the source
    message: str

    def __str__(self) -> str:
        return f"{self.where}: {self.message} ({self.kind})"


class Fate(StrEnum):
    """What becomes of an element or an attribute of a file, in the tables of importers."""

    EXACT = "exact"
    APPROXIMATED = "approximated"  # a note says where, if it matters there
    REFUSED = "refused"  # with an error that names it
    LEFT_OUT = "left out"  # with a note
    HARMLESS = "cannot matter"  # no note: nothing that is simulated depends on it


class ActuatorHint(NamedTuple):
    """A drive that the source itself declares, for what the catalogue entry leaves open; joints are local.

    `shares` are the further joints of a drive that pulls at a tendon, see `anysim.model.world.Actuator`.
    """

    joint: int
    mode: ControlMode
    kp: float
    kd: float
    effort_limit: float
    shares: tuple[tuple[int, float], ...] = ()

    def renumbered(self, joint: Callable[[int], int]) -> "ActuatorHint":
        """The same drive where joints have other numbers."""
        return self._replace(joint=joint(self.joint), shares=tuple((joint(j), ratio) for j, ratio in self.shares))


def mode_of(gain: float, stiffness: float, damping: float) -> ControlMode | None:
    """The mode of a drive of MuJoCo's, whose force is gain x control - stiffness x position - damping x velocity.

    None where that is neither an effort nor an error of a position or a velocity.
    """
    if stiffness > 0 and abs(stiffness - gain) < 1e-9 * gain:
        return ControlMode.POSITION
    if stiffness == 0 and damping > 0 and abs(damping - gain) < 1e-9 * gain:
        return ControlMode.VELOCITY
    return ControlMode.EFFORT if stiffness == 0 and damping == 0 else None


class SensorHint(NamedTuple):
    """A sensor that the source declares, for a draft of a catalogue entry and for scenes: an asset alone has none.

    `kind` is that of an installed sensor, `frame` a link or a site, `params` are its others, `sources` the names of the
    sensors of the source that it stands for.
    """

    name: str
    kind: str
    frame: str
    params: Mapping[str, Any]
    sources: tuple[str, ...]


@dataclass(frozen=True)
class ImportedModel:
    """One kinematic tree. Names are local (`panda_hand`), indices are into the tuples of this model.

    - `bodies[0]` is the root, with parent -1 and its own frame at the identity; its kind is what the source says: FREE
      where it floats, else STATIC (its placement may change that). All other bodies are links, depth first,
      children in source order, each with exactly one joint; `joints[i]` moves `bodies[i + 1]`.
    - What a source joins rigidly is lumped: masses, centres and inertias are composed, geoms moved along, and the frame
      of the lumped link is a Site with the link's name. `links` maps every link name of the source, lumped or not, to
      its body, and `geom_links` tells for each geom the link it was on in the source.
    - Collision geoms have `collides` set; visual ones have `visible` set and do not collide. A mesh that collides holds
      its convex hull, and `wholes` has what each hull was made of. `meshes` have a `hash` of source bytes and
      processing, names unique within the model.
    - `mimic` inside joints, tendons, constraints, `excluded_pairs` and hints use local indices.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    geoms: tuple[Geom, ...] = ()
    geom_links: tuple[str, ...] = ()
    sites: tuple[Site, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    heightfields: tuple[HeightField, ...] = ()
    textures: tuple[Texture, ...] = ()
    materials: tuple[Material, ...] = ()
    links: Mapping[str, int] = field(default_factory=dict)
    actuator_hints: tuple[ActuatorHint, ...] = ()
    excluded_pairs: frozenset[tuple[int, int]] = frozenset()
    report: tuple[ImportNote, ...] = ()
    affordances: tuple[Affordance, ...] = ()
    tendons: tuple[Tendon, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    spatial_tendons: tuple[SpatialTendon, ...] = ()
    sensors: tuple[SensorHint, ...] = ()
    wholes: Mapping[str, WholeMesh] = field(default_factory=dict)

    def drive_of(self, joint: int) -> ActuatorHint | None:
        """The drive that the source declares for a joint; None where it declares none, or several."""
        found = [hint for hint in self.actuator_hints if hint.joint == joint]
        return found[0] if len(found) == 1 else None

    @property
    def frames(self) -> Mapping[str, FixedFrame]:
        """The links and sites by name, each fixed to a body; a site wins over a link that is called the same."""
        links = {name: FixedFrame(body, ORIGIN, IDENTITY_QUATERNION) for name, body in self.links.items()}
        return links | {site.name: FixedFrame(site.body, site.position, site.quaternion) for site in self.sites}


def noted(model: ImportedModel, *notes: ImportNote) -> ImportedModel:
    """The model with more to know of it."""
    return replace(model, report=(*model.report, *notes))


_MAY_BE_INFINITE = frozenset({"lower", "upper", "velocity_limit", "effort_limit"})


def strange_number(model: ImportedModel) -> str:
    """The first number of a model that is none, in words such as `joint 'elbow': its damping is nan`; empty if all are.

    Only limits may be infinite. Arrays of meshes and heights are not looked at: who makes them does.
    """
    named: dict[str, tuple[Any, ...]] = {
        "body": model.bodies,
        "joint": model.joints,
        "geom": model.geoms,
        "site": model.sites,
    }
    named |= {"tendon": (*model.tendons, *model.spatial_tendons), "constraint": model.constraints}
    for kind, parts in named.items():
        for number, part in enumerate(parts):
            for name, value in _strange(part):
                return f"{kind} '{part.name or number}': its {name} is {value}"
    for hint in model.actuator_hints:
        for name, value in _strange(hint):
            return f"the drive of joint '{model.joints[hint.joint].name}': its {name} is {value}"
    return ""


def _strange(part: object, name: str = "value") -> Iterator[tuple[str, float]]:
    if isinstance(part, float):
        if isnan(part) or (isinf(part) and name not in _MAY_BE_INFINITE):
            yield name, part
    elif isinstance(part, tuple):
        for key, value in zip(getattr(part, "_fields", (name,) * len(part)), part, strict=True):
            yield from _strange(value, key)
    elif is_dataclass(part):
        for one in fields(part):
            yield from _strange(getattr(part, one.name), one.name)


class Importer(Protocol):
    """Reads one file. `root` is the folder that no reference in the file may leave; `scale` multiplies all lengths.

    `visual_error` [m] is how far what is only looked at may be off, `anysim.assets.meshes.light_mesh` keeps it.

    That of MJCF takes `body` too, the name of one of several trees in the file: all others and what refers to them stay
    behind; empty: there is one. That of URDF takes `packages` too, a mapping of the names of packages to folders.
    Masses scale with the cube of `scale` and inertias with its fifth power (the density stays). Raises AssetError for a
    file that is missing or holds what the neutral model cannot say, naming the file and the element.
    """

    def __call__(
        self, path: Path, *, root: Path, scale: float = 1.0, visual_error: float = ..., **own: Any
    ) -> ImportedModel: ...
