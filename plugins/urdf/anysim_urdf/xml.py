"""URDF files as typed records, read safely; every complaint names the file and the line.

Read directly from XML: the general URDF packages import a mesh library and its dependencies (seconds of start-up for a
file that needs none of it), guess where an attribute is missing (an absent ixx counts as 1 kg m^2), and pass over
damage.
"""

from collections import Counter
from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from anysim.assets.bounded_files import xml_root
from anysim.assets.model import ImportNote
from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.math import pose as P
from anysim.model.world import Vec3
from anysim_urdf.unheld import notes_of

Rgba = tuple[float, float, float, float]
_GEOMETRY = ("box", "sphere", "cylinder", "capsule", "mesh")


class Shape(NamedTuple):
    """`kind` is box (size: edge lengths), sphere (radius), cylinder, capsule (radius, length) or mesh (size: scale)."""

    kind: str
    size: tuple[float, ...]
    filename: str
    origin: Array  # pose (7,) in the link's frame
    color: Rgba | None


class InertialElement(NamedTuple):
    """Mass [kg], and the inertia [kg m^2] about the origin's position in the origin's axes, unchecked."""

    mass: float
    origin: Array  # pose (7,)
    inertia: Array  # (3, 3), axes of the origin


class LinkElement(NamedTuple):
    """A link with its shapes, in the order of the file."""

    name: str
    inertial: InertialElement | None
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]


class MimicElement(NamedTuple):
    """Follows `joint`: position = multiplier * that of the joint + offset."""

    joint: str
    multiplier: float
    offset: float


class JointElement(NamedTuple):
    """Limits are None where the file does not give them."""

    name: str
    type: str
    parent: str
    child: str
    origin: Array  # pose (7,) of the child in the parent at zero
    axis: Array  # (3,) as written
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    damping: float
    friction: float
    mimic: MimicElement | None
    stiffness: float = 0.0  # of a spring, and where it rests
    spring_rest: float = 0.0
    anchor: Vec3 = (0.0, 0.0, 0.0)  # in the child's frame; a URDF has it at the origin


class ModelElements(Protocol):
    """The links and joints of a file, and how its parts are called in a sentence."""

    path: Path
    name: str
    unheld: list[ImportNote]
    instead: str
    links: dict[str, LinkElement]
    joints: list[JointElement]

    def where(self, kind: str, name: str) -> str:
        """A part with its place in the file."""
        ...


class UrdfFile:
    """The links and joints of a URDF file, in its order.

    Of a xacro file `expanded` is what xacro made of it: lines are those of that.
    """

    def __init__(self, path: Path, expanded: Path | None = None) -> None:
        self.path = path
        root = self._tree(expanded or path)
        self._lines: dict[tuple[str, str], int] = {}
        self._materials: dict[str, Rgba] = {}
        self._expanded(root)
        for kind in ("link", "joint"):
            self._named_once(kind, root.findall(kind))
        self.name: str = root.get("name") or path.stem
        for material in root.iter("material"):  # also where they are first used
            color = material.find("color")
            if color is not None and color.get("rgba") and material.get("name"):
                self._materials.setdefault(material.get("name"), self._rgba(color))
        self.unheld = notes_of(root)
        self.instead = _instead([str(element.tag) for element in root])
        self._springs = {
            element.get("reference"): (self._text(element, "springStiffness"), self._text(element, "springReference"))
            for element in root.findall("gazebo")
            if element.find("springStiffness") is not None
        }
        self.links = {element.get("name"): self._link(element) for element in root.findall("link")}
        self.joints = [self._joint(element) for element in root.findall("joint")]

    def where(self, kind: str, name: str) -> str:
        """`joint 'wrist' (arm.urdf:48)`."""
        line = self._lines.get((kind, name))
        return f"{kind} '{name}' ({self.path.name}{'' if line is None else f':{line}'})"

    # ------------------------------------------------------------------ the file

    def _tree(self, read: Path) -> Any:
        root, _ = xml_root(read)
        if root.tag != "robot":
            raise AssetError(f"{self.path}: a URDF has the root element <robot>, this one has <{root.tag}>")
        return root

    def _expanded(self, root: Any) -> None:
        for element in root.iter("*"):
            for key, value in element.attrib.items():
                if "$(" in value or "${" in value:
                    text = f'<{element.tag} {key}="{value}"> is an expression of xacro or roslaunch'
                    raise self._error(element, f"{text} that was not expanded; name the .xacro file itself")

    def _named_once(self, kind: str, elements: list[Any]) -> None:
        for element in elements:
            if not element.get("name"):
                raise self._error(element, f"a <{kind}> has no name")
            self._lines[kind, element.get("name")] = element.sourceline
        twice = [name for name, count in Counter(e.get("name") for e in elements).items() if count > 1]
        if twice:
            raise AssetError(f"{self.path}: two {kind}s have the name '{twice[0]}'; names must be unique")

    # ------------------------------------------------------------------ elements

    def _link(self, element: Any) -> LinkElement:
        shapes = {
            tag: tuple(s for part in element.findall(tag) if (s := self._shape(part)) is not None)
            for tag in ("visual", "collision")
        }
        inertial = element.find("inertial")
        own = None if inertial is None else self._inertial(inertial)
        return LinkElement(element.get("name"), own, shapes["visual"], shapes["collision"])

    def _inertial(self, element: Any) -> InertialElement:
        mass, tensor = element.find("mass"), element.find("inertia")
        matrix = np.zeros((3, 3))
        if tensor is not None:
            for i, j, key in ((0, 0, "ixx"), (1, 1, "iyy"), (2, 2, "izz"), (0, 1, "ixy"), (0, 2, "ixz"), (1, 2, "iyz")):
                matrix[i, j] = matrix[j, i] = self._number(tensor, key, None if i == j else 0.0)
        weight = 0.0 if mass is None else self._number(mass, "value", None)
        return InertialElement(weight, self._origin(element), matrix)

    def _shape(self, element: Any) -> Shape | None:
        geometry = element.find("geometry")
        if geometry is None or len(geometry) == 0:
            raise self._error(element, f"a <{element.tag}> of {self._owner(element)} has no geometry")
        shape = geometry[0]
        if shape.tag not in _GEOMETRY:
            raise self._error(shape, f"{self._owner(element)} has a <{shape.tag}>; a URDF knows {', '.join(_GEOMETRY)}")
        if shape.tag == "box":
            size = self._numbers(shape, "size", (3,), None)
        elif shape.tag == "mesh":
            size = self._numbers(shape, "scale", (1, 3), (1.0, 1.0, 1.0))
            size = size * 3 if len(size) == 1 else size
        else:
            keys = ("radius", "length") if shape.tag in ("cylinder", "capsule") else ("radius",)
            size = tuple(self._number(shape, key, None) for key in keys)
        if shape.tag != "mesh" and (not any(size) or (shape.tag != "box" and size[0] == 0.0)):
            where = self.where("link", element.getparent().get("name"))
            self.unheld.append(ImportNote("dropped", where, f"has a <{shape.tag}> of size 0, which nothing can touch"))
            return None
        if 0.0 in size or (min(size) < 0 and shape.tag != "mesh"):  # a negative scale of a mesh mirrors
            raise self._error(shape, f"<{shape.tag}> of {self._owner(element)} has the size {list(size)}")
        filename = shape.get("filename") or ""
        if shape.tag == "mesh" and not filename:
            raise self._error(shape, f"<mesh> of {self._owner(element)} lacks filename")
        return Shape(shape.tag, size, filename, self._origin(element), self._color(element.find("material")))

    def _color(self, material: Any) -> Rgba | None:
        if material is None:
            return None
        color = material.find("color")
        own = color is not None and color.get("rgba")
        return self._rgba(color) if own else self._materials.get(material.get("name") or "")

    def _rgba(self, color: Any) -> Rgba:
        values = [min(1.0, max(0.0, v)) for v in self._numbers(color, "rgba", (3, 4), None)]
        return (values[0], values[1], values[2], values[3] if len(values) == 4 else 1.0)

    def _joint(self, element: Any) -> JointElement:
        ends: list[str] = []
        for end in ("parent", "child"):
            found = element.find(end)
            if found is None or not found.get("link"):
                raise self._error(element, f"joint '{element.get('name')}' names no {end} link")
            ends.append(found.get("link"))
        axis, limit, dynamics, mimic = (element.find(tag) for tag in ("axis", "limit", "dynamics", "mimic"))
        optional: Callable[[str], float | None] = lambda key: (  # noqa: E731
            None if limit is None or limit.get(key) is None else self._number(limit, key, None)
        )
        follows = None
        if mimic is not None:
            multiplier, offset = self._number(mimic, "multiplier", 1.0), self._number(mimic, "offset", 0.0)
            follows = MimicElement(mimic.get("joint") or "", multiplier, offset)
        stiffness, rest = self._springs.get(element.get("name"), (0.0, 0.0))
        return JointElement(
            element.get("name"),
            element.get("type") or "",
            ends[0],
            ends[1],
            self._origin(element),
            np.array((1.0, 0.0, 0.0) if axis is None else self._numbers(axis, "xyz", (3,), (1.0, 0.0, 0.0))),
            optional("lower"),
            optional("upper"),
            optional("effort"),
            optional("velocity"),
            0.0 if dynamics is None else self._number(dynamics, "damping", 0.0),
            0.0 if dynamics is None else self._number(dynamics, "friction", 0.0),
            follows,
            stiffness,
            rest,
        )

    def _origin(self, element: Any) -> Array:
        origin = element.find("origin")
        if origin is None:
            return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        xyz, rpy = (self._numbers(origin, key, (3,), (0.0, 0.0, 0.0)) for key in ("xyz", "rpy"))
        return P.pose(xyz, P.from_roll_pitch_yaw(np.array(rpy)))

    # ------------------------------------------------------------------ numbers and complaints

    def _number(self, element: Any, key: str, default: float | None) -> float:
        return self._numbers(element, key, (1,), None if default is None else (default,))[0]

    def _numbers(
        self, element: Any, key: str, counts: tuple[int, ...], default: tuple[float, ...] | None
    ) -> tuple[float, ...]:
        text = element.get(key)
        if text is None:
            if default is None:
                raise self._error(element, f"<{element.tag}> of {self._owner(element)} lacks {key}")
            return default
        try:
            values = tuple(float(part) for part in text.replace(",", " ").split())
        except ValueError:
            values = ()
        if len(values) not in counts or not all(isfinite(value) for value in values):
            wanted = " or ".join(map(str, counts)) + (" finite number" if counts == (1,) else " finite numbers")
            raise self._error(element, f'<{element.tag} {key}="{text}"> of {self._owner(element)}: expected {wanted}')
        return values

    def _text(self, element: Any, tag: str) -> float:
        """The number in a child of an element; 0 without the child."""
        text = element.findtext(tag)
        try:
            value = 0.0 if text is None else float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise self._error(element, f"<{tag}> holds '{text}': expected a finite number")
        return value

    def _owner(self, element: Any) -> str:
        """The link or joint that an element belongs to."""
        while element is not None and element.tag not in ("link", "joint"):
            element = element.getparent()
        return "the robot" if element is None else f"{element.tag} '{element.get('name')}'"

    def _error(self, element: Any, message: str) -> AssetError:
        return AssetError(f"{self.path}:{element.sourceline}: {message}")


def _instead(tags: list[str]) -> str:
    """What a file without links is."""
    if "deformable" in tags:
        return "it is a deformable body of PyBullet, and the neutral model has rigid ones"
    if any("xacro" in tag for tag in tags):
        return "it is a xacro source: call the file NAME.xacro"
    return f"it holds {listing(dict.fromkeys(f'<{tag}>' for tag in tags), 6)}"
