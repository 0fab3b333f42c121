"""Table of what becomes of each element and attribute of MJCF: the importer asks it, and docs/importing.md shows it.

MuJoCo reads a file before the importer does, so the rows of `FIELDS` name the fields of its parsed elements, after
defaults, includes and repetitions; `ATTRIBUTES` has the attributes of a file that are called otherwise.
"""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from anysim.assets.model import Fate


class Row(NamedTuple):
    """The fate of fields of one kind of element; `names` are of `mujoco.MjSpec`, `text` says how or why."""

    fate: Fate
    names: str
    text: str = ""


_EXACT, _ABOUT, _NOT, _OUT, _IDLE = Fate
_POSE, _WORLD = "pos quat alt", "the world's `physics` has it"
_FLUID = "shapes are dragged by their inertia alone"
_NUMBERS = "numbers of a program's own"
_MIXED = "one that mixes a time constant and a damping is MuJoCo's default, as in MuJoCo"
_YIELD = "springs are elastic"
_LAWS = "a motor, position or velocity drive of one hinge or slide becomes a drive; others are left out"

FIELDS: Mapping[str, tuple[Row, ...]] = {
    "body": (
        Row(_EXACT, f"{_POSE} mass ipos iquat ialt inertia fullinertia explicitinertial"),
        Row(_ABOUT, "gravcomp", "all of the weight, or none below a half"),
        Row(_OUT, "userdata", _NUMBERS),
        Row(_OUT, "plugin", "it is MuJoCo's alone"),
        Row(_IDLE, "mocap", "it is fixed as others without a joint, whose poses are states that may be written, too"),
        Row(_IDLE, "simple fuse sleep", "it is of how MuJoCo computes"),
    ),
    "joint": (
        Row(_EXACT, "type pos axis range limited armature frictionloss ref actfrclimited springdamper springref"),
        Row(_ABOUT, "damping", "the linear part of a polynomial; none of a free joint"),
        Row(_ABOUT, "actfrcrange", "the larger end limits both"),
        Row(_EXACT, "solimp_limit margin solimp_friction", "as the compliance of a limit and of dry friction"),
        Row(_ABOUT, "solref_limit solref_friction", _MIXED),
        Row(_ABOUT, "stiffness", "the linear part of a polynomial; none of a free joint"),
        Row(_OUT, "actgravcomp", "a compensated weight is no load of a drive"),
        Row(_OUT, "springyield", _YIELD),
        Row(_OUT, "userdata", _NUMBERS),
        Row(_IDLE, "align", "it is of how MuJoCo computes"),
    ),
    "geom": (
        Row(_EXACT, f"{_POSE} fromto size priority friction mass density typeinertia fitscale rgba hfieldname"),
        Row(_ABOUT, "type", "an ellipsoid becomes a convex mesh; a plane on a body is left out"),
        Row(_ABOUT, "meshname", "what collides is the convex hull of the mesh, of at most 64 corners"),
        Row(_ABOUT, "material", "its colour"),
        Row(_EXACT, "condim solimp margin gap solmix", "as the compliance of its contacts"),
        Row(_ABOUT, "contype conaffinity", "pairs of bodies of the model; it meets all that is not of it"),
        Row(_ABOUT, "solref", _MIXED),
        Row(_OUT, "fluid_ellipsoid fluid_coefs", _FLUID),
        Row(_OUT, "surfacevel", "surfaces do not move by themselves"),
        Row(_OUT, "adhesion", "surfaces do not stick"),
        Row(_OUT, "castshadow", "shadows are the engine's: all shapes cast them, or none"),
        Row(_OUT, "userdata", _NUMBERS),
        Row(_OUT, "plugin", "it is MuJoCo's alone"),
    ),
    "site": (
        Row(_EXACT, f"{_POSE} fromto"),
        Row(_OUT, "userdata", _NUMBERS),
        Row(_IDLE, "type size rgba material meshname", "it is of how a frame is drawn"),
    ),
    "mesh": (
        Row(
            _EXACT,
            "file content_type inertia refpos refquat scale userface userfacenormal userfacetexcoord "
            "usernode usernormal usertet usertexcoord uservert",
            "MuJoCo reads it; `visual_error` bounds how far what is only seen may be off",
        ),
        Row(_IDLE, "maxhullvert", "hulls have at most 64 corners"),
        Row(
            _IDLE,
            "smoothnormal material needsdf octree_maxdepth",
            "it is of how a mesh is drawn, or of distance fields",
        ),
        Row(_OUT, "plugin", "it is MuJoCo's alone"),
    ),
    "hfield": (Row(_EXACT, "file content_type ncol nrow size userdata"),),
    "material": (
        Row(_EXACT, "rgba"),
        Row(_OUT, "emission metallic reflectance roughness shininess specular", "surfaces have plain colours"),
        Row(_IDLE, "texrepeat texuniform textures", "textures are left out with a note of their own"),
    ),
    "tendon": (
        Row(_EXACT, "path springlength range limited frictionloss armature"),
        Row(_ABOUT, "stiffness damping", "the linear part of a polynomial"),
        Row(_EXACT, "solimp_limit margin solimp_friction", "as the compliance of a limit and of dry friction"),
        Row(_ABOUT, "solref_limit solref_friction", _MIXED),
        Row(_OUT, "actfrclimited actfrcrange", "each drive has a limit of its own"),
        Row(_OUT, "springyield", _YIELD),
        Row(_OUT, "userdata", _NUMBERS),
        Row(_IDLE, "material rgba width", "it is of how a tendon is drawn"),
    ),
    "equality": (
        Row(_EXACT, "name1 name2"),
        Row(_EXACT, "data solimp"),
        Row(_ABOUT, "type objtype", "those of joints and of tendons of two joints become mimic joints"),
        Row(_ABOUT, "active", "one that is not is left out"),
        Row(_ABOUT, "solref", _MIXED),
    ),
    "actuator": (
        Row(_EXACT, "target forcelimited ctrllimited actdim actlimited actrange velrange ctrlspec gear"),
        Row(_ABOUT, "type trntype dyntype dynprm gaintype gainprm biastype biasprm", _LAWS),
        Row(_ABOUT, "forcerange", "the larger end limits both"),
        Row(_ABOUT, "ctrlrange", "that of a motor limits its effort; a target has the limits of its joint"),
        Row(_OUT, "armature damping", "those of a joint are the joint's"),
        Row(_OUT, "delay nsample interp", "`delay` of a controller has it"),
        Row(_OUT, "actearly ffrange", "drives have no states of their own"),
        Row(_OUT, "userdata", _NUMBERS),
        Row(_OUT, "plugin", "it is MuJoCo's alone"),
        Row(_IDLE, "lengthrange inheritrange cranklength refsite slidersite", "it is of drives that are left out"),
    ),
    "key": (
        Row(_ABOUT, "qpos", "the one that is called `home`"),
        Row(_OUT, "qvel", "everything begins at rest"),
        Row(_OUT, "act ctrl", "commands are a task's"),
        Row(_OUT, "plastic", _YIELD),
        Row(_ABOUT, "mpos mquat", "those of the one that is called `home`, in a scene; a world places an asset"),
        Row(_IDLE, "time", "an episode begins at 0"),
    ),
    "option": (
        Row(_OUT, "timestep gravity cone impratio", _WORLD),
        Row(_OUT, "density viscosity wind", "`engine.options` of MuJoCo has them: a fluid is its alone"),
        Row(_OUT, "magnetic", "there is no magnetic field"),
        Row(_OUT, "disableflags enableflags", "they are MuJoCo's alone"),
        Row(_OUT, "disableactuator", "drives have no groups"),
        Row(_OUT, "o_friction o_margin o_solimp o_solref", "they override contacts in MuJoCo alone"),
        Row(
            _OUT,
            "integrator solver jacobian iterations tolerance ls_iterations ls_tolerance noslip_iterations "
            "noslip_tolerance ccd_iterations ccd_tolerance sdf_initpoints sdf_iterations sleep_tolerance",
            "solvers are the engine's; `engine.options` has those of MuJoCo",
        ),
    ),
}
"""The fields that an element can have, by its kind."""

_ALONE, _OWN = "MuJoCo itself makes nothing of them", "those of a world are its own"
WHOLE: Mapping[str, Row] = {
    "default include frame replicate attach model config composite freejoint inertial": Row(
        _EXACT, "", "MuJoCo unfolds it before the importer reads"
    ),
    "compiler lengthrange": Row(
        _EXACT, "", "MuJoCo heeds it; bodies are not fused and lengths of muscles not simulated"
    ),
    "exclude": Row(_ABOUT, "", "pairs of bodies, after those without a joint are joined to what carries them"),
    "ball": Row(_NOT, "", "as the `type` of a joint: there are hinges and slides"),
    "connect weld": Row(_EXACT, "", "one of a model that floats to the world is refused"),
    "flex flexvert flexstrain flexcomp edge elasticity contact pin": Row(_NOT, "", "flexes: bodies are rigid"),
    "fixed": Row(_EXACT, "", "one that only measures does nothing, and is left out"),
    "spatial pulley": Row(
        _EXACT, "", "one of a model that floats to the world is refused; one that only measures is left out"
    ),
    "general motor position velocity": Row(_ABOUT, "", _LAWS),
    "intvelocity orientation pid damper cylinder muscle adhesion dcmotor": Row(_OUT, "", _LAWS),
    "texture layer": Row(_OUT, "", "surfaces have plain colours"),
    "skin bone": Row(_OUT, "", "bodies are drawn by their geoms"),
    "camera": Row(_OUT, "", _OWN),
    "light": Row(_OUT, "", _OWN),
    "pair": Row(_ABOUT, "", "geoms meet by their masks, with what both have; the report names pairs that differ"),
    "numeric": Row(_OUT, "", _ALONE),
    "text": Row(_OUT, "", _ALONE),
    "tuple element": Row(_OUT, "", _ALONE),
    "plugin extension instance": Row(_OUT, "", "they are MuJoCo's alone"),
    "flag": Row(_OUT, "", "they are MuJoCo's alone"),
    "size": Row(_IDLE, "", "memory is the engine's"),
    "visual global quality headlight map scale rgba statistic": Row(_IDLE, "", "it is of MuJoCo's own viewer"),
    "mujoco worldbody asset tendon equality actuator keyframe custom deformable sensor user": Row(
        _IDLE, "", "it holds others"
    ),
}
"""The elements that have one fate as a whole."""

_STATE, _FRAMES = "the state has it; `joints` reads that of a robot", "`tracking` has quaternions in the world's axes"
SENSORS: Mapping[str, Row] = {
    "accelerometer gyro": Row(_ABOUT, "", "an `imu`: averages over its period"),
    "force torque": Row(_ABOUT, "", "a `force_torque`: averages over its period, of a body that a joint carries"),
    "touch": Row(_ABOUT, "", "a `touch`; an ellipsoid is left out, and contacts of what is rigidly joined count too"),
    "rangefinder": Row(_ABOUT, "", "a `lidar` of one ray, which reads its far end where MuJoCo has -1"),
    "framepos framequat framelinvel frameangvel": Row(
        _ABOUT, "", "a `tracking`, exact; one with `reftype`, or of an inertial frame or a geom, is left out"
    ),
    "jointpos jointvel jointactuatorfrc ballquat ballangvel actuatorpos actuatorvel actuatorfrc": Row(_OUT, "", _STATE),
    "jointlimitpos jointlimitvel jointlimitfrc tendonlimitpos tendonlimitvel tendonlimitfrc": Row(
        _OUT, "", "engines do not tell of their limits"
    ),
    "tendonpos tendonvel tendonactuatorfrc": Row(_OUT, "", "no sensor reads tendons"),
    "velocimeter framexaxis frameyaxis framezaxis": Row(_OUT, "", _FRAMES),
    "framelinacc frameangacc": Row(_OUT, "", "`imu` has averages over its period"),
    "subtreecom subtreelinvel subtreeangmom e_potential e_kinetic": Row(_OUT, "", "it follows from the state"),
    "clock": Row(_OUT, "", "every reading has its time"),
    "magnetometer": Row(_OUT, "", "there is no magnetic field"),
    "camprojection": Row(_OUT, "", "it follows from the camera and the state"),
    "insidesite distance normal fromto contact tactile": Row(_OUT, "", "no sensor of worlds reads it"),
    "user plugin": Row(_OUT, "", "it is a program's own"),
}
"""What is below <sensor>. Beside it, `cutoff` of what is no rangefinder, `noise`, which MuJoCo itself does not add,
`delay`, `nsample`, `interp`, `interval` and `user` are left out."""

BOOKKEEPING = frozenset(
    "id info signature compiler name classname parent frame childclass group element authored "
    "bodies cameras frames geoms joints lights sites".split()
)
"""What every element has for MuJoCo's own use; `group` is a switch of its viewer."""

ATTRIBUTES: Mapping[str, str] = MappingProxyType(
    {
        "alt": "axisangle xyaxes zaxis euler",
        "body.ipos": "inertial/pos",
        "body.iquat": "inertial/quat",
        "body.ialt": "inertial/axisangle inertial/xyaxes inertial/zaxis inertial/euler",
        "body.mass": "inertial/mass",
        "body.inertia": "inertial/diaginertia",
        "body.fullinertia": "inertial/fullinertia",
        "body.explicitinertial": "inertial",
        "solref_limit": "solreflimit",
        "solimp_limit": "solimplimit",
        "solref_friction": "solreffriction",
        "solimp_friction": "solimpfriction",
        "actfrcrange": "actuatorfrcrange",
        "actfrclimited": "actuatorfrclimited",
        "actgravcomp": "actuatorgravcomp",
        "typeinertia": "shellinertia",
        "hfieldname": "hfield",
        "meshname": "mesh",
        "fluid_ellipsoid": "fluidshape",
        "fluid_coefs": "fluidcoef",
        "userdata": "user",
        "hfield.userdata": "elevation",
        "uservert": "vertex",
        "userface": "face",
        "usernormal": "normal",
        "usertexcoord": "texcoord",
        "userfacenormal": "",
        "userfacetexcoord": "",
        "usernode": "builtin params",
        "usertet": "",
        "needsdf": "",
        "textures": "texture",
        "tendon.path": "fixed/joint fixed/coef spatial/site spatial/geom spatial/sidesite pulley/divisor",
        "equality.name1": "joint1 name class",
        "equality.name2": "joint2",
        "equality.objtype": "",
        "equality.type": "",
        "equality.data": "polycoef torquescale",
        "actuator.target": "joint jointinparent tendon site body cranksite",
        "actuator.type": "",
        "actuator.trntype": "",
        "actuator.ctrlspec": "input",
        "actuator.gainprm": "gainprm kp",
        "actuator.biasprm": "biasprm kv dampratio",
        "actuator.dynprm": "dynprm timeconst",
        "disableactuator": "actuatorgroupdisable",
        "disableflags": "flag",
        "enableflags": "",
    }
)
"""The attributes of a file by the field they set, `KIND.FIELD` before `FIELD`; what is not here is called the same."""


def fate(kind: str, field: str) -> Row | None:
    """The row of a field of MuJoCo's elements; None for one that the table does not know, which is left out."""
    return _BY_FIELD.get((kind, field))


def whole(tag: str) -> Row | None:
    """The row of an element that has one fate as a whole."""
    return _BY_TAG.get(tag)


def sensor_row(tag: str) -> Row | None:
    """The row of an element below <sensor>."""
    return _BY_SENSOR.get(tag)


def attributes(kind: str, field: str) -> list[str]:
    """The attributes of a file that set a field."""
    return ATTRIBUTES.get(f"{kind}.{field}", ATTRIBUTES.get(field, field)).split()


def rows() -> Iterator[tuple[str, str, Fate, str]]:
    """The table for readers: element, its attributes, what becomes of them, and how or why."""
    for kind, own in FIELDS.items():
        for row in own:
            names = [name for field in row.names.split() for name in attributes(kind, field)]
            yield kind, " ".join(names), row.fate, row.text
    for tags, row in WHOLE.items():
        yield tags, "", row.fate, row.text
    for tags, row in SENSORS.items():
        yield " ".join(f"sensor/{tag}" for tag in tags.split()), "", row.fate, row.text


_BY_FIELD = {(kind, name): row for kind, own in FIELDS.items() for row in own for name in row.names.split()}
_BY_TAG = {tag: row for tags, row in WHOLE.items() for tag in tags.split()}
_BY_SENSOR = {tag: row for tags, row in SENSORS.items() for tag in tags.split()}
