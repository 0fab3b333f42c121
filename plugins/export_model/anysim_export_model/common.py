"""Parts of a model that no format holds, and names that are free."""

from dataclasses import MISSING, fields
from typing import Any

from anysim.assets.model import ImportedModel
from anysim.errors import AnysimError
from anysim.model.shapes import ORDINARY
from anysim.model.world import Geom, Joint, JointType, World
from anysim_export_model.notes import Notes
from anysim_export_model.scene import Piece

_MODEL = frozenset(
    "name bodies joints geoms geom_links sites meshes heightfields textures materials links actuator_hints "
    "excluded_pairs report affordances".split()
)
_JOINT = frozenset(
    "name body type axis anchor lower upper velocity_limit effort_limit damping friction armature initial mimic "
    "limit_softness stiffness spring_rest".split()
)
_WORLD = frozenset(
    "name physics bodies joints geoms sites actuators cameras lights contact_sensors entities robots meshes "
    "heightfields excluded_pairs textures materials slots tiles scenery notes visual_error".split()
)


def unknown_parts(part: ImportedModel | Joint | World, notes: Notes, owner: str) -> None:
    """Say what a model has of which no writer knows: parts that came into the neutral model later."""
    known = {ImportedModel: _MODEL, Joint: _JOINT, World: _WORLD}[type(part)]
    for field in fields(part):
        value: Any = getattr(part, field.name)
        default = field.default_factory() if field.default_factory is not MISSING else field.default
        if field.name not in known and value != default:
            notes.lost(field.name.replace("_", " "), "is left out: the writer does not know it", owner)


def check_joint(joint: Joint, kind: str) -> None:
    """Raises AnysimError for a joint that is neither a hinge nor a slide."""
    if joint.type not in (JointType.REVOLUTE, JointType.PRISMATIC):
        raise AnysimError(
            f"joint '{joint.name}' is a {joint.type.value} joint, which {kind} files of this writer do not hold; "
            "leave the entity out with --entity"
        )


def looks(geom: Geom, notes: Notes) -> None:
    """Say what a surface looks like beyond its colour."""
    if geom.texture:
        notes.lost("texture", "is left out: geoms have plain colours", geom.name)
    if geom.material:
        notes.lost("material", "is left out but for its colour", geom.name)


def never_written(piece: Piece, notes: Notes) -> None:
    """Say what of a tree no format holds."""
    model = piece.model
    unknown_parts(model, notes, piece.name)
    for joint in model.joints:
        unknown_parts(joint, notes, joint.name)
    for body in model.bodies:
        if body.solver is not None:
            notes.lost("solver settings", "are left out: they are of an engine", body.name)
        if any(body.damping):
            notes.lost("damping of a free body", "is left out", body.name)
    if model.affordances:
        notes.lost("affordances", "are left out: they are anysim's own", piece.name)


def is_ordinary(geom: Geom) -> bool:
    """Whether nothing is known of how a geom touches."""
    return geom.surface == ORDINARY


def free(name: str, taken: set[str]) -> str:
    """The name, or the first of `name_1`, `name_2`, … that is not taken; it is taken from then on."""
    found, count = name, 0
    while found in taken:
        count += 1
        found = f"{name}_{count}"
    taken.add(found)
    return found
