"""Joints with several axes as chains of hinges and slides, which the neutral model has.

| type | becomes | what differs |
|---|---|---|
| `planar` | slides along two directions across its axis, and a turn about it | nothing |
| `floating` of an empty root | a root that floats | nothing; where it stands is the world's |
| `floating` elsewhere | three slides and three hinges | at a pitch of 90 degrees a turn is lost |
| `spherical`, `ball` | three hinges | the same |

The links between are bodies without mass of their own; limits of such a joint have no one meaning and are left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from anysim.assets.model import ImportNote
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim_urdf.xml import JointElement, LinkElement, ModelElements

_SLIDES = (
    ("x", "prismatic", (1.0, 0.0, 0.0)),
    ("y", "prismatic", (0.0, 1.0, 0.0)),
    ("z", "prismatic", (0.0, 0.0, 1.0)),
)
_TURNS = (("roll", "continuous", (1.0, 0.0, 0.0)), ("pitch", "continuous", (0.0, 1.0, 0.0)))
_YAW = ("yaw", "continuous", (0.0, 0.0, 1.0))
_AXES = {"spherical": (*_TURNS, _YAW), "ball": (*_TURNS, _YAW), "floating": (*_SLIDES, *_TURNS, _YAW)}
KINDS = (*_AXES, "planar")
_IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Unfolded:
    """Links and joints of one axis each; `floats` tells whether a floating joint tied the model to its root."""

    links: Mapping[str, LinkElement]
    joints: tuple[JointElement, ...]
    notes: tuple[ImportNote, ...]
    floats: bool


def unfolded(file: ModelElements) -> Unfolded:
    """The links and joints of a file, where each joint has one axis at most.

    Raises:
        AssetError: a joint of several axes follows another.
    """
    links, notes = dict(file.links), list[ImportNote]()
    floats = _floats(file)
    joints: list[JointElement] = []
    for joint in file.joints:
        if joint is floats:
            del links[joint.parent]
            text = f"ties '{joint.child}' to '{joint.parent}', which is nothing but the world: the model floats"
            notes.append(ImportNote("info", file.where("joint", joint.name), text))
        elif joint.type in KINDS:
            joints += _chain(file, joint, links)
            notes.append(_note(file, joint))
        else:
            joints.append(joint)
    return Unfolded(links, tuple(joints), tuple(notes), floats is not None)


def _floats(file: ModelElements) -> JointElement | None:
    """The floating joint that is all that an empty root link is for."""
    for joint in file.joints:
        root = file.links.get(joint.parent)
        if joint.type != "floating" or root is None or root.visuals or root.collisions or root.inertial is not None:
            continue
        others = [other for other in file.joints if joint.parent in (other.parent, other.child)]
        if others == [joint]:
            return joint
    return None


def _chain(file: ModelElements, joint: JointElement, links: dict[str, LinkElement]) -> list[JointElement]:
    if joint.mimic is not None:
        where = file.where("joint", joint.name)
        raise AssetError(
            f"{where} has several axes ({joint.type}) and follows '{joint.mimic.joint}': one joint follows one"
        )
    axes = _AXES.get(joint.type) or _plane(file, joint)
    parent, origin, made = joint.parent, joint.origin, list[JointElement]()
    for i, (suffix, kind, axis) in enumerate(axes):
        name = f"{joint.name}.{suffix}"
        child = name if i < len(axes) - 1 else joint.child
        if child != joint.child:
            if name in links or any(other.name == name for other in file.joints):
                raise AssetError(
                    f"{file.where('joint', joint.name)} becomes a chain, in which '{name}' is a name twice"
                )
            links[name] = LinkElement(name, None, (), ())
        one = joint._replace(name=name, type=kind, parent=parent, child=child, origin=origin, axis=np.array(axis))
        made.append(one._replace(lower=None, upper=None))
        parent, origin = child, _IDENTITY
    return made


def _plane(file: ModelElements, joint: JointElement) -> tuple[tuple[str, str, Array], ...]:
    """Two directions across the axis of a planar joint, x and y where it is z, and the axis."""
    length = float(np.linalg.norm(joint.axis))
    if not length > 1e-9:
        raise AssetError(f"{file.where('joint', joint.name)} has an axis of length {length:g}")
    normal = joint.axis / length
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - normal * (first @ normal)
    first = first / np.linalg.norm(first)
    return ("x", "prismatic", first), ("y", "prismatic", np.cross(normal, first)), ("yaw", "continuous", normal)


def _note(file: ModelElements, joint: JointElement) -> ImportNote:
    names = ", ".join(f"{joint.name}.{suffix}" for suffix, *_ in (_AXES.get(joint.type) or _plane(file, joint)))
    text = f"is {joint.type}, and becomes a chain of joints of one axis: {names}"
    if joint.type != "planar":
        text += "; with the pitch at 90 degrees it loses a direction"
    if joint.lower is not None or joint.upper is not None:
        text += "; its limits are left out"
    return ImportNote("info", file.where("joint", joint.name), text)
