"""Elements of XML with numbers that are read back as they are."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from lxml import etree

from anysim.conventions import Array
from anysim.math import matrix as M, pose as P


def number(value: float) -> str:
    """A number of which every digit counts."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float]) -> str:
    """Numbers with spaces between them."""
    return " ".join(number(value) for value in values)


def sub(parent: Any, tag: str, **attributes: str | None) -> Any:
    """A child with the attributes that are given."""
    return etree.SubElement(parent, tag, {key: text for key, text in attributes.items() if text is not None})


def named(root: str, **attributes: str) -> Any:
    """A root element."""
    return etree.Element(root, attributes)


def document(root: Any) -> bytes:
    """The file of a root element."""
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="utf-8")


def roll_pitch_yaw(quaternion: Iterable[float]) -> Array:
    """Fixed-axis roll, pitch and yaw (3,) of a unit quaternion, to rounding also where the pitch is a right angle.

    Each angle is taken of what the others leave: an error of one is made good by the next.
    """
    left = P.to_matrix(np.array(tuple(quaternion)))
    flat = float(np.hypot(left[0, 0], left[1, 0]))
    yaw = float(np.arctan2(left[1, 0], left[0, 0])) if flat > 1e-9 else 0.0
    left = M.product(_about(2, -yaw), left)
    pitch = float(np.arctan2(-left[2, 0], left[0, 0]))
    left = M.product(_about(1, -pitch), left)
    return np.array([float(np.arctan2(left[2, 1], left[1, 1])), pitch, yaw])


def _about(axis: int, angle: float) -> Array:
    turn = np.eye(3)
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turn[one, one] = turn[other, other] = np.cos(angle)
    turn[other, one], turn[one, other] = np.sin(angle), -np.sin(angle)
    return turn
