"""Frames of an SDF model: poses relative to each other by name, resolved to poses in the model's own frame."""

from collections.abc import Mapping
from math import isfinite, pi
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError, listing, suggest
from anysim.math import pose as P

IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
MODEL, WORLD = "__model__", "world"


class Frame(NamedTuple):
    """A frame by its pose (7,) in another, or in the model's own; `element` is what says it."""

    pose: Array
    relative_to: str
    element: Any


def numbers(element: Any, where: str, counts: tuple[int, ...]) -> tuple[float, ...]:
    """The finite numbers in an element's text.

    Raises:
        AssetError: other ones, or so many.
    """
    text = (element.text or "").strip()
    try:
        values = tuple(float(part) for part in text.split())
    except ValueError:
        values = ()
    if len(values) not in counts or not all(isfinite(value) for value in values):
        wanted = " or ".join(map(str, counts))
        raise AssetError(
            f"{where}:{element.sourceline}: <{element.tag}> is '{text[:60]}'; expected {wanted} finite numbers"
        )
    return values


def pose_of(owner: Any, where: str) -> tuple[Array, str]:
    """The <pose> of an element (7,), and the frame that it is relative to; the identity where it has none."""
    element = owner.find("pose")
    if element is None or not (element.text or "").strip():
        return IDENTITY, "" if element is None else element.get("relative_to") or element.get("frame") or ""
    relative = element.get("relative_to") or element.get("frame") or ""
    if element.get("rotation_format") == "quat_xyzw":
        values = numbers(element, where, (7,))
        turn = np.array(values[3:])
        if not np.linalg.norm(turn) > 1e-6:
            raise AssetError(f"{where}:{element.sourceline}: <pose> has a quaternion of length 0")
        return P.pose(values[:3], turn / np.linalg.norm(turn)), relative
    values = numbers(element, where, (6,))
    unit = pi / 180 if element.get("degrees") in ("true", "1") else 1.0
    return P.pose(values[:3], P.from_roll_pitch_yaw(unit * np.array(values[3:]))), relative


class Frames:
    """The frames of one model with all that is in it; names of nested ones are `NAME::FRAME`."""

    def __init__(self, where: str, frames: Mapping[str, Frame]) -> None:
        self._where, self._frames = where, frames
        self._known: dict[str, Array] = {MODEL: IDENTITY}

    def of(self, name: str) -> Array:
        """The pose (7,) of a frame in the model's own.

        Raises:
            AssetError: there is no such frame, or it is relative to itself.
        """
        chain: list[str] = []
        while name not in self._known:
            if name in chain or len(chain) > 1000:
                raise AssetError(f"{self._where}: the frame '{name}' is relative to itself")
            if name not in self._frames:
                raise AssetError(
                    f"{self._where}: there is no frame '{name}'{suggest(name, list(self._frames))} "
                    f"(frames: {listing(self._frames, 8)})"
                )
            chain.append(name)
            name = self._frames[name].relative_to
        for one in reversed(chain):
            self._known[one] = P.compose(self._known[self._frames[one].relative_to], self._frames[one].pose)
        return self._known[chain[0]] if chain else self._known[name]
