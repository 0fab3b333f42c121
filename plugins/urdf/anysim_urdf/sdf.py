"""The importer of SDF files: their links and joints, frames resolved, as the importer of URDF takes them.

What SDF leaves out has its defaults: a link without <inertial> has 1 kg and 1 kg m^2, a joint turns about z. Root links
float, unless their model is static or a joint ties them to the world.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import Fate, ImportedModel, ImportNote
from anysim.assets.scene import PART
from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.math import pose as P
from anysim.model.world import BodyKind, Vec3
from anysim_urdf.load import imported
from anysim_urdf.sdf_coverage import ROWS, notes_of
from anysim_urdf.sdf_file import chosen, document
from anysim_urdf.sdf_frames import IDENTITY, MODEL, WORLD, Frame, Frames, numbers, pose_of
from anysim_urdf.xml import InertialElement, JointElement, LinkElement, MimicElement, Rgba, Shape

_SHAPES = {"box": (("size", 3),), "sphere": (("radius", 1),), "cylinder": (("radius", 1), ("length", 1))}
_SHAPES["capsule"] = _SHAPES["cylinder"]
_PASSED = frozenset(
    row.path.rpartition("/")[2] for row in ROWS if "/geometry/" in row.path and row.fate is Fate.LEFT_OUT
)
_MOVING = ("revolute", "continuous", "prismatic")


def import_sdf(
    path: Path,
    *,
    root: Path,
    scale: float = 1.0,
    visual_error: float = VISUAL_ERROR,
    body: str = "",
    packages: Mapping[str, Path] = MappingProxyType({}),
) -> ImportedModel:
    """Read a model of an SDF file; `body` is `MODEL`, `MODEL::LINK` or `LINK`, see `sdf_file.chosen`.

    Raises:
        AssetError: a missing or damaged file or mesh, or something the neutral model cannot say.
    """
    read = document(path, root, packages)
    element, link = chosen(read, body.removeprefix(PART))
    file = SdfModel(path, element, read.version, link)
    model = imported(file, root=root, scale=scale, packages=packages, visual_error=visual_error)
    bodies = [
        replace(body, gravity_compensation=True) if body.name in file.weightless else body for body in model.bodies
    ]
    if not file.fixed:
        bodies[0] = replace(bodies[0], kind=BodyKind.FREE)
    return replace(model, bodies=tuple(bodies))


class SdfModel:
    """One tree of a <model>, or with `root` None all that are in it: see `anysim_urdf.xml.ModelElements`.

    `fixed` tells whether its root stands still, `static` whether all of it does; no joint carries one of `roots`.
    """

    def __init__(self, path: Path, element: Any, version: tuple[int, int], root: str | None) -> None:
        self.path, self._version = path, version
        self.name: str = element.get("name")
        self.instead = "its <model> holds none"
        self.unheld = notes_of(element)
        self._lines: dict[tuple[str, str], int] = {}
        self._frames: dict[str, Frame] = {}
        self._attached: dict[str, str] = {}
        self._links: dict[str, Any] = {}
        self._joints: dict[str, tuple[Any, str]] = {}
        self.static = self._tied = False
        self._collect(element, "")
        self.frames = Frames(str(path), self._frames)
        self.weightless = {
            name for name, link in self._links.items() if link.findtext("gravity", "").strip() in ("false", "0")
        }
        self.links = {name: self._link(name, link) for name, link in self._links.items()}
        self.joints = [self._joint(name, joint, scope) for name, (joint, scope) in self._joints.items()]
        self.fixed = self.static or self._tied
        moved = {joint.child for joint in self.joints}
        self.roots = [name for name in self.links if name not in moved]
        if root is not None:
            self._choose(root)

    def names(self) -> list[str]:
        """The frames in it, but for its own."""
        return [name for name in self._frames if name != MODEL]

    def where(self, kind: str, name: str) -> str:
        """`joint 'wrist' (arm.sdf:48)`."""
        line = self._lines.get((kind, name))
        return f"{kind} '{name}' ({self.path.name}{'' if line is None else f':{line}'})"

    # ------------------------------------------------------------------ names and frames

    def _collect(self, model: Any, scope: str) -> None:
        """Links, joints and frames of a model and of those in it, by their names in the outermost."""
        self.static = self.static or model.findtext("static", "").strip() in ("true", "1")
        links = [part.get("name") for part in model.findall("link") if part.get("name")]
        canonical = model.get("canonical_link") or next(iter(links), "")
        inner = [part.get("name") for part in model.findall("model") if part.get("name")]
        self._attached[scope + MODEL] = scope + (canonical or (f"{inner[0]}::{MODEL}" if inner else ""))
        for part in model:
            if part.tag not in ("link", "joint", "frame", "model"):
                continue
            name = part.get("name")
            if not name or "::" in name or name == MODEL or (name == WORLD and part.tag != "link"):
                raise AssetError(f"{self.path}:{part.sourceline}: a <{part.tag}> has the name '{name or ''}'")
            full = scope + name
            if full in self._frames:
                raise AssetError(
                    f"{self.path}:{part.sourceline}: two parts have the name '{full}'; names must be unique"
                )
            pose, relative = pose_of(part, str(self.path))
            if part.tag == "link":
                self._links[full], self._attached[full] = part, full
                otherwise = MODEL
            elif part.tag == "joint":
                child = self._text(part, "child")
                self._joints[full], self._attached[full] = (part, scope), scope + child
                otherwise = child
            elif part.tag == "frame":
                otherwise = part.get("attached_to") or MODEL
                self._attached[full] = scope + otherwise
            else:
                self._collect(part, f"{full}::")
                if placed := part.get("placement_frame"):
                    own = {key: f for key, f in self._frames.items() if key.startswith(f"{full}::")}
                    own[f"{full}::{MODEL}"] = Frame(IDENTITY, MODEL, part)
                    pose = P.compose(pose, P.inverse(Frames(str(self.path), own).of(f"{full}::{placed}")))
                inside = f"{full}::{MODEL}"  # the name of a model stands for its frame
                self._frames[full], self._attached[full] = Frame(IDENTITY, inside, part), inside
                full, otherwise = inside, MODEL
            self._frames[full] = Frame(pose, scope + (relative or otherwise), part)
            self._lines[part.tag, full] = part.sourceline

    def _link_of(self, name: str, where: str) -> str:
        """The link that a frame is fixed to; `world` for that of the world."""
        seen: set[str] = set()
        while name not in self._links:
            if name.rpartition("::")[2] == WORLD:
                return WORLD
            if name in seen or name not in self._attached:
                raise AssetError(f"{where} refers to the link '{name}', which does not exist")
            seen.add(name)
            name = self._attached[name]
        return name

    def _choose(self, root: str) -> None:
        """Keep the tree below a root: the only one, or the one that is named."""
        children: dict[str, list[str]] = {}
        for joint in self.joints:
            children.setdefault(joint.parent, []).append(joint.child)
        roots = self.roots
        if not root:
            if len(roots) > 1:
                raise AssetError(
                    f"{self.path}: the model '{self.name}' has {len(roots)} links that no joint carries, "
                    f"{listing(roots, 6)}; name the one that is meant: {self.path.name}#{self.name}::{roots[0]}"
                )
            return
        if root not in roots:
            raise AssetError(
                f"{self.path}: no joint may carry the link '{root}' that is meant (such are {listing(roots, 8)})"
            )
        kept: set[str] = set()
        waiting = [root]
        while waiting:
            one = waiting.pop()
            if one not in kept:
                kept.add(one)
                waiting += children.get(one, [])
        self.links = {name: link for name, link in self.links.items() if name in kept}
        self.joints = [joint for joint in self.joints if joint.child in kept]
        self.name = root
        self.fixed = self.static or (self._tied and root == WORLD)

    # ------------------------------------------------------------------ elements

    def _link(self, name: str, element: Any) -> LinkElement:
        inertial = element.find("inertial")
        if inertial is None and not self.static:
            text = "has no <inertial>; SDF gives it 1 kg and 1 kg m^2"
            self.unheld.append(ImportNote("info", self.where("link", name), text))
        own = None if inertial is None and self.static else self._inertial(name, inertial)
        shapes = {
            tag: tuple(s for part in element.findall(tag) if (s := self._shape(name, part)) is not None)
            for tag in ("visual", "collision")
        }
        return LinkElement(name, own, shapes["visual"], shapes["collision"])

    def _inertial(self, link: str, element: Any) -> InertialElement:
        if element is None:
            return InertialElement(1.0, IDENTITY, np.eye(3))
        if element.get("auto") in ("true", "1"):
            raise AssetError(
                f"{self.path}:{element.sourceline}: <inertial auto=\"true\"> of link '{link}': masses are not computed "
                "of shapes; write <mass> and <inertia>"
            )
        matrix, tensor = np.eye(3), element.find("inertia")
        for i, j, key in ((0, 0, "ixx"), (1, 1, "iyy"), (2, 2, "izz"), (0, 1, "ixy"), (0, 2, "ixz"), (1, 2, "iyz")):
            if tensor is not None and tensor.find(key) is not None:
                matrix[i, j] = matrix[j, i] = numbers(tensor.find(key), str(self.path), (1,))[0]
        origin, relative = pose_of(element, str(self.path))
        if relative:
            self._lacks_frames(element)
        return InertialElement(self._number(element, "mass", 1.0), origin, matrix)

    def _shape(self, link: str, element: Any) -> Shape | None:
        geometry = element.find("geometry")
        if geometry is None or len(geometry) == 0:
            raise AssetError(f"{self.path}:{element.sourceline}: a <{element.tag}> of link '{link}' has no geometry")
        shape = geometry[0]
        if shape.tag in _PASSED or shape.tag == "empty":
            return None
        pose, relative = pose_of(element, str(self.path))
        if relative:
            here = self.frames.of(link)
            scope = link.rpartition("::")[0]
            pose = P.compose(
                P.compose(P.inverse(here), self.frames.of(f"{scope}::{relative}" if scope else relative)), pose
            )
        filename = ""
        if shape.tag == "mesh":
            filename = self._text(shape, "uri")
            scale = shape.find("scale")
            size = (1.0, 1.0, 1.0) if scale is None else numbers(scale, str(self.path), (3,))
        elif shape.tag in _SHAPES:
            size = ()
            for key, count in _SHAPES[shape.tag]:
                part = shape.find(key)
                if part is None:
                    raise AssetError(f"{self.path}:{shape.sourceline}: <{shape.tag}> of link '{link}' lacks <{key}>")
                size += numbers(part, str(self.path), (count,))
        else:
            raise AssetError(f"{self.path}:{shape.sourceline}: <geometry> of link '{link}' has a <{shape.tag}>")
        if 0.0 in size or (min(size) < 0 and shape.tag != "mesh"):
            raise AssetError(
                f"{self.path}:{shape.sourceline}: <{shape.tag}> of link '{link}' has the size {list(size)}"
            )
        return Shape(shape.tag, size, filename, pose, self._color(element))

    def _color(self, visual: Any) -> Rgba | None:
        diffuse = visual.find("material/diffuse")
        if diffuse is None:
            return None
        red, green, blue, *more = (min(1.0, max(0.0, v)) for v in numbers(diffuse, str(self.path), (3, 4)))
        clear = min(1.0, max(0.0, self._number(visual, "transparency", 0.0)))
        return (red, green, blue, (more[0] if more else 1.0) * (1.0 - clear))

    def _joint(self, full: str, element: Any, scope: str) -> JointElement:
        where = self.where("joint", full)
        kind = element.get("type") or ""
        child = self._link_of(scope + self._text(element, "child"), where)
        parent = self._link_of(scope + self._text(element, "parent"), where)
        if WORLD == child:
            raise AssetError(f"{where} carries the world")
        if parent == WORLD:
            self.links.setdefault(WORLD, LinkElement(WORLD, None, (), ()))
            self._tied = True
        here, at = self.frames.of(child), self.frames.of(full)
        there = IDENTITY if parent == WORLD else self.frames.of(parent)
        axis, turned = np.array([0.0, 0.0, 1.0]), at
        element_axis = element.find("axis")
        limits: dict[str, float | None] = dict.fromkeys(("lower", "upper", "effort", "velocity"))
        passive = dict.fromkeys(("damping", "friction", "spring_stiffness", "spring_reference"), 0.0)
        mimic = None
        if element_axis is not None and kind in _MOVING:
            xyz = element_axis.find("xyz")
            if xyz is not None:
                axis = np.array(numbers(xyz, str(self.path), (3,)))
                turned = self._axis_frame(element_axis, xyz, scope, at)
            limit, dynamics = element_axis.find("limit"), element_axis.find("dynamics")
            if limit is not None:
                limits = {key: self._number(limit, key, None) for key in limits}
                if limits["lower"] is not None or limits["upper"] is not None:
                    limits["lower"] = -1e16 if limits["lower"] is None else limits["lower"]
                    limits["upper"] = 1e16 if limits["upper"] is None else limits["upper"]
            if dynamics is not None:
                passive = {key: self._number(dynamics, key, 0.0) or 0.0 for key in passive}
            mimic = self._mimic(element_axis.find("mimic"), scope)
        anchor = P.compose(P.inverse(here), at)[:3]
        moving: Vec3 = (float(anchor[0]), float(anchor[1]), float(anchor[2]))
        return JointElement(
            full,
            kind,
            parent,
            child,
            P.compose(P.inverse(there), here),
            P.rotate_inverse(here[3:], P.rotate(turned[3:], axis)),
            limits["lower"],
            limits["upper"],
            limits["effort"],
            limits["velocity"],
            passive["damping"],
            passive["friction"],
            mimic,
            passive["spring_stiffness"],
            passive["spring_reference"],
            moving,
        )

    def _axis_frame(self, axis: Any, xyz: Any, scope: str, joint: Array) -> Array:
        """The frame in which the direction of an axis is written."""
        flag = axis.findtext("use_parent_model_frame", "").strip()
        if (named := xyz.get("expressed_in")) is not None and named:
            return self.frames.of(scope + named)
        of_model = flag in ("true", "1") or (not flag and self._version < (1, 5))
        return self.frames.of(scope + MODEL) if of_model else joint

    def _mimic(self, element: Any, scope: str) -> MimicElement | None:
        if element is None:
            return None
        multiplier, offset = self._number(element, "multiplier", 1.0), self._number(element, "offset", 0.0)
        reference = self._number(element, "reference", 0.0)
        return MimicElement(scope + (element.get("joint") or ""), multiplier, offset - multiplier * reference)

    def _number(self, element: Any, tag: str, default: Any) -> Any:
        found = element.find(tag)
        if found is not None and (found.text or "").strip().lstrip("+-").lower() in ("inf", "infinity"):
            return -1e16 if (found.text or "").strip().startswith("-") else 1e16
        return default if found is None else numbers(found, str(self.path), (1,))[0]

    def _text(self, element: Any, tag: str) -> str:
        text = (element.findtext(tag) or "").strip()
        if not text:
            raise AssetError(f"{self.path}:{element.sourceline}: a <{element.tag}> lacks <{tag}>")
        return text

    def _lacks_frames(self, element: Any) -> None:
        raise AssetError(f"{self.path}:{element.sourceline}: the <pose> of an <inertial> is relative to its link alone")
