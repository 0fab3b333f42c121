"""Table of what becomes of each element and attribute of URDF: the importer asks it, and docs/importing.md shows it.

The elements are those of ROS, of URDF 1.2, of Gazebo and of PyBullet, by their path below <robot>.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from anysim.assets.model import Fate


class Row(NamedTuple):
    """The fate of attributes of an element, or of the whole element where it names none; `text` says how or why."""

    path: str
    fate: Fate
    attributes: str = ""
    text: str = ""


_EXACT, _ABOUT, _NOT, _OUT, _IDLE = Fate
_LINK, _JOINT = "robot/link", "robot/joint"
_GEOMETRY = (
    ("", _EXACT, "", ""),
    ("/box", _EXACT, "size", ""),
    ("/cylinder", _EXACT, "radius length", ""),
    ("/sphere", _EXACT, "radius", ""),
    ("/mesh", _ABOUT, "filename scale", "what collides is its convex hull, of at most 64 corners"),
    ("/capsule", _EXACT, "radius length", "its length is that of the cylinder between the caps"),
    ("/plane", _NOT, "", "the ground is the world's"),
)


def _shapes(of: str) -> Iterator[Row]:
    yield Row(of, _IDLE, "name")
    yield Row(f"{of}/origin", _EXACT, "xyz rpy")
    yield Row(f"{of}/origin", _OUT, "quat_xyzw", "`rpy` is read")
    for below, fate, attributes, text in _GEOMETRY:
        yield Row(f"{of}/geometry{below}", fate, attributes, text)
    yield from _looks(of, _IDLE if of.endswith("collision") else _EXACT)


def _looks(of: str, fate: Fate = _EXACT) -> Iterator[Row]:
    yield Row(f"{of}/material", fate, "name")
    yield Row(f"{of}/material/color", fate, "rgba")
    yield Row(f"{of}/material/texture", _OUT, "", "surfaces have plain colours")


ROWS: tuple[Row, ...] = (
    Row("robot", _IDLE, "name version"),
    Row(_LINK, _EXACT, "name"),
    Row(_LINK, _OUT, "type", "it is no part of what is simulated"),
    Row(f"{_LINK}/inertial", _EXACT),
    Row(f"{_LINK}/inertial/origin", _EXACT, "xyz rpy"),
    Row(f"{_LINK}/inertial/origin", _OUT, "quat_xyzw", "`rpy` is read"),
    Row(f"{_LINK}/inertial/mass", _EXACT, "value"),
    Row(f"{_LINK}/inertial/inertia", _EXACT, "ixx iyy izz ixy ixz iyz"),
    *_shapes(f"{_LINK}/visual"),
    *_shapes(f"{_LINK}/collision"),
    Row(f"{_LINK}/collision", _OUT, "group concave", "PyBullet's masks and meshes"),
    Row(f"{_LINK}/collision/verbose", _OUT, "", "it is a planner's"),
    Row(f"{_LINK}/collision_checking", _OUT, "", "it is a planner's"),
    Row(
        f"{_LINK}/contact",
        _OUT,
        "",
        "PyBullet's surfaces and stiffness; the world's `contact` and `surfaces` have them",
    ),
    Row(_JOINT, _EXACT, "name"),
    Row(
        _JOINT,
        _ABOUT,
        "type",
        "planar, floating and spherical ones become chains of joints of one axis; unknown ones are refused",
    ),
    Row(f"{_JOINT}/origin", _EXACT, "xyz rpy"),
    Row(f"{_JOINT}/origin", _OUT, "quat_xyzw", "`rpy` is read"),
    Row(f"{_JOINT}/parent", _EXACT, "link"),
    Row(f"{_JOINT}/child", _EXACT, "link"),
    Row(f"{_JOINT}/axis", _EXACT, "xyz"),
    Row(f"{_JOINT}/limit", _EXACT, "lower upper effort velocity", "an effort or a velocity of 0 counts as not given"),
    Row(f"{_JOINT}/limit", _OUT, "acceleration deceleration jerk", "a planner's limits are its own"),
    Row(f"{_JOINT}/dynamics", _EXACT, "damping friction"),
    Row(f"{_JOINT}/mimic", _EXACT, "joint multiplier offset"),
    Row(f"{_JOINT}/safety_controller", _OUT, "", "limits are those of <limit>"),
    Row(f"{_JOINT}/calibration", _OUT, "", "it is of the real robot's encoders"),
    *_looks("robot"),
    Row("robot/transmission", _OUT, "", "gears and drives are those of the catalogue's entry"),
    Row("robot/gazebo", _OUT, "", "what it says of friction, sensors and plugins is Gazebo's alone"),
    Row("robot/gazebo/springStiffness", _EXACT, "", "of the joint that `reference` names"),
    Row("robot/gazebo/springReference", _EXACT, "", "of the joint that `reference` names"),
    Row("robot/sensor", _OUT, "", "those of a world are its own"),
)
"""An element that is not here is left out with a note, and so is an attribute."""

SEVERAL = frozenset({"link", "joint", "visual", "collision"})
"""What there may be several of in one parent, besides materials of a robot; of all else the first is read."""


def element(path: str) -> Row | None:
    """The row that an element has as a whole; None where its attributes have rows, or where it is not known."""
    return next((row for row in _BY_PATH.get(path, ()) if not row.attributes), None)


def attribute(path: str, name: str) -> Row | None:
    """The row of an attribute; None where the table does not know it."""
    return next((row for row in _BY_PATH.get(path, ()) if name in row.attributes.split()), None)


def known(path: str) -> bool:
    """Whether the table has the element and leaves it in."""
    return any(row.attributes or row.fate is not Fate.LEFT_OUT for row in _BY_PATH.get(path, ()))


def rows() -> Iterator[tuple[str, str, Fate, str]]:
    """The table for readers: element, its attributes, what becomes of them, and how or why."""
    for row in ROWS:
        yield row.path.removeprefix("robot/"), row.attributes, row.fate, row.text


_BY_PATH: Mapping[str, list[Row]] = {path: [r for r in ROWS if r.path == path] for path in {row.path for row in ROWS}}
