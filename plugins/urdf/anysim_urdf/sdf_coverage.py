"""Table of what becomes of each element and attribute of SDF 1.4 to 1.12: the reader asks it.

Paths are below <sdf>; those of a <model> hold in a <world>, in another <model> and in what is included.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from anysim.assets.model import Fate, ImportNote
from anysim.errors import listing
from anysim_urdf.coverage import Row

_EXACT, _ABOUT, _NOT, _OUT, _IDLE = Fate
_LINK, _JOINT = "model/link", "model/joint"
_HULL = "what collides is its convex hull, of at most 64 corners"
_NO_SHAPE = "the neutral model has no such shape"


def _poses(*owners: str) -> Iterator[Row]:
    for owner in owners:
        yield Row(f"{owner}/pose", _EXACT, "relative_to degrees rotation_format")


def _shapes(of: str) -> Iterator[Row]:
    yield Row(of, _IDLE, "name")
    yield Row(f"{of}/geometry", _EXACT)
    for shape, parts in (("box", "size"), ("sphere", "radius"), ("cylinder", "radius length")):
        yield Row(f"{of}/geometry/{shape}", _EXACT)
        for part in parts.split():
            yield Row(f"{of}/geometry/{shape}/{part}", _EXACT)
    yield Row(f"{of}/geometry/capsule", _EXACT, "", "its length is that of the cylinder between the caps")
    for part in ("radius", "length"):
        yield Row(f"{of}/geometry/capsule/{part}", _EXACT)
    yield Row(f"{of}/geometry/mesh", _ABOUT, "", _HULL)
    for part in ("uri", "scale"):
        yield Row(f"{of}/geometry/mesh/{part}", _EXACT)
    for part in ("submesh", "convex_decomposition"):
        yield Row(f"{of}/geometry/mesh/{part}", _OUT, "", "the whole mesh is read")
    yield Row(f"{of}/geometry/plane", _OUT, "", "the ground is the world's")
    yield Row(f"{of}/geometry/empty", _IDLE)
    for shape in ("ellipsoid", "cone", "heightmap", "image", "polyline"):
        yield Row(f"{of}/geometry/{shape}", _OUT, "", _NO_SHAPE)


_WORLD = "world"
WORLD_ROWS: tuple[Row, ...] = (
    Row(_WORLD, _EXACT, "name"),
    Row(f"{_WORLD}/model", _EXACT, "", "each of its trees is an object; a level plane at height 0 is the ground"),
    Row(f"{_WORLD}/include", _EXACT),
    Row(f"{_WORLD}/frame", _EXACT, "name attached_to"),
    Row(f"{_WORLD}/frame/pose", _EXACT, "relative_to degrees rotation_format"),
    Row(f"{_WORLD}/gravity", _EXACT),
    Row(f"{_WORLD}/physics", _IDLE, "name default type"),
    Row(f"{_WORLD}/physics/max_step_size", _EXACT),
    *(Row(f"{_WORLD}/physics/{key}", _IDLE) for key in ("real_time_factor", "real_time_update_rate")),
    Row(f"{_WORLD}/physics/max_contacts", _IDLE),
    *(
        Row(f"{_WORLD}/physics/{key}", _OUT, "", "solvers are the engine's")
        for key in ("ode", "bullet", "simbody", "dart")
    ),
    Row(f"{_WORLD}/light", _EXACT, "name type"),
    Row(f"{_WORLD}/light/pose", _EXACT, "relative_to degrees rotation_format"),
    *(Row(f"{_WORLD}/light/{key}", _EXACT) for key in ("diffuse", "direction", "intensity", "light_on")),
    Row(f"{_WORLD}/light/spot", _OUT, "", "lights are no cones"),
    Row(f"{_WORLD}/light/attenuation", _OUT, "", "lights reach everywhere"),
    Row(f"{_WORLD}/light/visualize", _IDLE),
    Row(f"{_WORLD}/light/cast_shadows", _OUT, "", "the world's `scenery` has it"),
    Row(f"{_WORLD}/light/specular", _OUT, "", "highlights are the materials'"),
    Row(f"{_WORLD}/scene", _IDLE),
    Row(f"{_WORLD}/scene/ambient", _EXACT),
    Row(f"{_WORLD}/scene/background", _EXACT),
    Row(f"{_WORLD}/scene/shadows", _EXACT),
    *(Row(f"{_WORLD}/scene/{key}", _IDLE) for key in ("grid", "origin_visual")),
    *(Row(f"{_WORLD}/scene/{key}", _OUT, "", "it is Gazebo's alone") for key in ("fog", "sky")),
    Row(f"{_WORLD}/joint", _OUT, "", "models are not joined to each other"),
    Row(f"{_WORLD}/gui", _IDLE),
    *(
        Row(f"{_WORLD}/{key}", _OUT, "", "it is Gazebo's alone")
        for key in ("plugin", "audio", "actor", "road", "population", "state")
    ),
    *(
        Row(f"{_WORLD}/{key}", _OUT, "", "there is no such field")
        for key in ("wind", "magnetic_field", "atmosphere", "spherical_coordinates")
    ),
)
"""Of a file that is a world: of one that is an asset, all this is left to the world that it is put into."""

ROWS: tuple[Row, ...] = (
    Row("model", _EXACT, "name canonical_link placement_frame"),
    *_poses("model", "model/frame", _LINK, f"{_LINK}/visual", f"{_LINK}/collision", _JOINT),
    *_poses("model/include"),
    Row(f"{_LINK}/inertial/pose", _EXACT, "degrees rotation_format"),
    Row(f"{_LINK}/inertial/pose", _NOT, "relative_to", "it is relative to its link alone"),
    Row("model/static", _EXACT),
    Row("model/frame", _EXACT, "name attached_to"),
    Row("model/include", _EXACT, "", "a file of a package, or of the file's own folder"),
    *(Row(f"model/include/{part}", _EXACT) for part in ("uri", "name", "static", "placement_frame")),
    Row("model/include", _OUT, "merge", "what is included has its own names, NAME::LINK"),
    Row("model/self_collide", _OUT, "", "`self_collision` of the catalogue's entry has it"),
    Row("model/allow_auto_disable", _IDLE),
    Row("model/enable_wind", _OUT, "", "there is no wind"),
    Row("model/plugin", _OUT, "", "plugins are Gazebo's alone"),
    Row("model/gripper", _OUT, "", "a channel `eef` of the catalogue's entry has it"),
    Row(_LINK, _EXACT, "name"),
    Row(f"{_LINK}/gravity", _EXACT, "", "of a link that is joined rigidly to another, that of the other"),
    Row(f"{_LINK}/enable_wind", _OUT, "", "there is no wind"),
    Row(f"{_LINK}/self_collide", _OUT, "", "`self_collision` of the catalogue's entry has it"),
    Row(f"{_LINK}/kinematic", _OUT, "", "bodies move by forces"),
    Row(f"{_LINK}/must_be_base_link", _IDLE),
    Row(f"{_LINK}/velocity_decay", _OUT, "", "`dynamics` of an object has its damping"),
    Row(f"{_LINK}/sensor", _OUT, "", "those of a world are its own"),
    Row(f"{_LINK}/light", _OUT, "", "those of a world are its own"),
    *(
        Row(f"{_LINK}/{part}", _OUT, "", "it is Gazebo's alone")
        for part in ("projector", "audio_sink", "audio_source", "battery", "particle_emitter")
    ),
    Row(f"{_LINK}/inertial", _EXACT),
    Row(f"{_LINK}/inertial", _NOT, "auto", "masses are not computed of shapes"),
    Row(f"{_LINK}/inertial/mass", _EXACT),
    Row(f"{_LINK}/inertial/inertia", _EXACT),
    *(Row(f"{_LINK}/inertial/inertia/{key}", _EXACT) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
    Row(f"{_LINK}/inertial/fluid_added_mass", _OUT, "", "there is no fluid"),
    *_shapes(f"{_LINK}/visual"),
    *_shapes(f"{_LINK}/collision"),
    Row(f"{_LINK}/visual/material", _EXACT),
    Row(f"{_LINK}/visual/material/diffuse", _EXACT),
    *(Row(f"{_LINK}/visual/material/{key}", _IDLE) for key in ("ambient", "specular", "lighting", "render_order")),
    *(
        Row(f"{_LINK}/visual/material/{key}", _OUT, "", "surfaces have plain colours")
        for key in ("emissive", "script", "shader", "pbr", "double_sided", "shininess")
    ),
    Row(f"{_LINK}/visual/transparency", _EXACT),
    *(Row(f"{_LINK}/visual/{key}", _IDLE) for key in ("cast_shadows", "visibility_flags", "meta", "laser_retro")),
    Row(f"{_LINK}/visual/plugin", _OUT, "", "plugins are Gazebo's alone"),
    Row(f"{_LINK}/collision/surface", _OUT, "", "`surfaces` of the entry, and `contact` of an object, have it"),
    Row(f"{_LINK}/collision/density", _OUT, "", "masses are not computed of shapes"),
    *(Row(f"{_LINK}/collision/{key}", _IDLE) for key in ("max_contacts", "laser_retro")),
    Row(_JOINT, _EXACT, "name"),
    Row(
        _JOINT,
        _ABOUT,
        "type",
        "ball joints become chains of joints of one axis; universal, screw and others are refused",
    ),
    Row(f"{_JOINT}/parent", _EXACT),
    Row(f"{_JOINT}/child", _EXACT),
    Row(f"{_JOINT}/axis", _EXACT),
    Row(f"{_JOINT}/axis/xyz", _EXACT, "expressed_in"),
    Row(f"{_JOINT}/axis/use_parent_model_frame", _EXACT),
    Row(f"{_JOINT}/axis/initial_position", _OUT, "", "`home` of the catalogue's entry has it"),
    Row(f"{_JOINT}/axis/limit", _EXACT),
    *(Row(f"{_JOINT}/axis/limit/{key}", _EXACT) for key in ("lower", "upper", "effort", "velocity")),
    *(
        Row(f"{_JOINT}/axis/limit/{key}", _OUT, "", "limits are as stiff as the engine has them")
        for key in ("stiffness", "dissipation")
    ),
    Row(f"{_JOINT}/axis/dynamics", _EXACT),
    *(
        Row(f"{_JOINT}/axis/dynamics/{key}", _EXACT)
        for key in "damping friction spring_stiffness spring_reference".split()
    ),
    Row(f"{_JOINT}/axis/mimic", _EXACT, "joint"),
    Row(f"{_JOINT}/axis/mimic", _IDLE, "axis", "joints have one axis"),
    *(Row(f"{_JOINT}/axis/mimic/{key}", _EXACT) for key in ("multiplier", "offset", "reference")),
    Row(f"{_JOINT}/axis2", _OUT, "", "joints have one axis"),
    Row(f"{_JOINT}/physics", _OUT, "", "solvers are the engine's"),
    Row(f"{_JOINT}/sensor", _OUT, "", "those of a world are its own"),
    *(
        Row(f"{_JOINT}/{key}", _OUT, "", "it is of joints that are refused")
        for key in ("thread_pitch", "gearbox_ratio")
    ),
)
"""An element that is not here is left out with a note, and so is an attribute."""

_ALL = (*ROWS, *WORLD_ROWS)
_BY_PATH: Mapping[str, list[Row]] = {path: [r for r in _ALL if r.path == path] for path in {row.path for row in _ALL}}
_EVERYWHERE = frozenset({"name", "version"})


def rows() -> Iterator[tuple[str, str, Fate, str]]:
    """The table for readers: element, its attributes, what becomes of them, and how or why."""
    for row in _ALL:
        yield row.path, row.attributes, row.fate, row.text


def notes_of(model: Any) -> list[ImportNote]:
    """A note for each kind of element and attribute of a <model> or <world> that is there in vain, how often and where.

    Of a world these are what it says beside its models.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for what, why, owner in _unread(model, model.tag, f"{model.tag} '{model.get('name')}'"):
        found.setdefault((what, why), []).append(owner)
    return [
        ImportNote("dropped", what, f"{why} ({len(owners)}: {listing(dict.fromkeys(owners), 3)})")
        for (what, why), owners in found.items()
    ]


def _unread(node: Any, path: str, owner: str) -> Iterator[tuple[str, str, str]]:
    if node.tag in ("link", "joint", "model"):
        owner = f"{node.tag} '{node.get('name')}'"
    for key in node.attrib:
        row = next((row for row in _BY_PATH.get(path, ()) if key in row.attributes.split()), None)
        if key not in _EVERYWHERE and (row is None or row.fate is Fate.LEFT_OUT):
            yield f"<{node.tag} {key}>", _left_out(row), owner
    for child in node:
        if path == _WORLD and child.tag in ("model", "include"):
            continue
        below = "model" if child.tag == "model" else f"{path}/{child.tag}"
        own = _BY_PATH.get(below, [])
        whole = next((row for row in own if not row.attributes), None)
        if not own or (whole is not None and whole.fate is Fate.LEFT_OUT):
            yield f"<{child.tag}>", _left_out(whole), owner
            continue
        yield from _unread(child, below, owner)


def _left_out(row: Row | None) -> str:
    return f"is left out: {row.text}" if row is not None and row.text else "is left out"
