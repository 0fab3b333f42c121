"""Recorded and streamed motion: rotations of all links over time, fitted to avatars of any size; a reader of BVH files.

Bones keep the avatar's lengths: a motion gives directions, and the way of the hips in lengths of a leg.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.math import pose as P
from anysim_avatars import frames
from anysim_avatars.bodies import BONES


class Stance(NamedTuple):
    """How avatars stand at a moment, in the frame that they stood in when it began (x forward, y left, z up).

    Attributes:
        hips: (m, 3) of the hips' middle, in lengths of a leg: from where it began, and above the ground.
        rotation: (m, 15, 4) xyzw of the links, in the order of BONES, z along the bone.
    """

    hips: Array
    rotation: Array


Provider = Callable[[Array, Array], Stance]
"""Stances at times (m,) [s] since it was set or its clip began, of avatars by number (m,)."""


class Motion(NamedTuple):
    """A recording: (T, 3) and (T, 15, 4) as in `Stance`, a frame each `period` [s]."""

    hips: Array
    rotation: Array
    period: float

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return (len(self.hips) - 1) * self.period

    def __call__(self, time: Array, number: Array) -> Stance:
        """A `Provider`: between two frames, in proportion; after the last, the last."""
        at = np.clip(time / self.period, 0.0, len(self.hips) - 1.0)
        low = np.minimum(at.astype(np.int64), max(len(self.hips) - 2, 0))
        high, share = np.minimum(low + 1, len(self.hips) - 1), at - low
        hips = self.hips[low] + share[:, None] * (self.hips[high] - self.hips[low])
        return Stance(hips, between(self.rotation[low], self.rotation[high], share[:, None, None]))


def between(a: Array, b: Array, share: Array) -> Array:
    """Quaternions (…, 4) from a to b, the short way."""
    near = np.where(P.dot(a, b)[..., None] < 0, -b, b)
    mixed = a + share * (near - a)
    return mixed / P.norm(mixed)[..., None]


# ---------------------------------------------------------------------- BVH

_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From a BVH's axes (y up, z forward) to ours."""
_NAMES: dict[str, tuple[str, ...]] = {
    "pelvis": ("hips", "hip", "pelvis", "root"),
    "torso": ("spine2", "spine3", "spine1", "chest", "spine", "torso", "abdomen"),
    "head": ("head", "neck"),
    "upper_arm": ("arm", "upperarm", "shldr", "uparm"),
    "forearm": ("forearm", "lowerarm", "elbow"),
    "hand": ("hand", "wrist"),
    "thigh": ("upleg", "thigh", "upperleg", "hip"),
    "shin": ("leg", "shin", "lowerleg", "knee", "calf"),
    "foot": ("foot", "ankle"),
}
"""Names of joints in files of several origins, without their side, in lower case and letters alone; the first wins."""


class _Joint:
    def __init__(self, name: str, parent: int) -> None:
        self.name, self.parent = name, parent
        self.offset = np.zeros(3)
        self.channels: tuple[str, ...] = ()


def read_motion(path: Path) -> Motion:
    """A BVH file with the joints of a person.

    Raises:
        AssetError: it is no BVH file, or a limb is missing; says which and what joints there are.
    """
    try:
        words = iter(path.read_text(encoding="utf-8", errors="replace").split())
        joints = _hierarchy(words)
        rows, period = _frames(words, sum(len(joint.channels) for joint in joints))
    except (StopIteration, ValueError, OSError) as error:
        raise AssetError(f"{path.name} is no BVH file that can be read: {str(error) or 'it ends too early'}") from error
    found = _limbs(joints, path)
    rest = np.zeros((len(joints), 3))
    turn = np.tile(np.eye(3), (len(rows), len(joints), 1, 1))
    place = np.zeros((len(rows), len(joints), 3))
    column = 0
    for number, joint in enumerate(joints):
        local, shift = np.tile(np.eye(3), (len(rows), 1, 1)), np.tile(joint.offset, (len(rows), 1))
        for channel in joint.channels:
            values, axis = rows[:, column], "XYZ".index(channel[0])
            column += 1
            if channel.endswith("position"):
                shift[:, axis] = values if joint.parent < 0 else shift[:, axis] + values
            else:
                local = local @ _about(axis, np.radians(values))
        up = joint.parent
        rest[number] = joint.offset + (rest[up] if up >= 0 else 0.0)
        turn[:, number] = local if up < 0 else turn[:, up] @ local
        place[:, number] = shift if up < 0 else place[:, up] + frames.apply(turn[:, up], shift)
    return _fitted(found, rest @ _UP.T, _UP @ turn @ _UP.T, place @ _UP.T, period)


def _hierarchy(words: Iterator[str]) -> list[_Joint]:
    if next(words) != "HIERARCHY":
        raise ValueError("it does not begin with HIERARCHY")
    joints: list[_Joint] = []
    stack: list[int] = []
    for word in words:
        if word in ("ROOT", "JOINT"):
            joints.append(_Joint(next(words), stack[-1] if stack else -1))
        elif word == "End":
            joints.append(_Joint(f"{joints[stack[-1]].name}_end{next(words)}", stack[-1]))
        elif word == "{":
            stack.append(len(joints) - 1)
        elif word == "}":
            stack.pop()
        elif word == "OFFSET":
            joints[-1].offset = np.array([float(next(words)) for _ in range(3)])
        elif word == "CHANNELS":
            joints[-1].channels = tuple([next(words) for _ in range(int(next(words)))])
        elif word == "MOTION":
            return joints
        else:
            raise ValueError(f"'{word}' is not expected in its hierarchy")
    raise ValueError("it has no MOTION")


def _frames(words: Iterator[str], columns: int) -> tuple[Array, float]:
    if next(words) != "Frames:":
        raise ValueError("'Frames:' is expected after MOTION")
    count = int(next(words))
    if (next(words), next(words)) != ("Frame", "Time:"):
        raise ValueError("'Frame Time:' is expected after the number of frames")
    period = float(next(words))
    numbers = np.array([float(word) for word in words])
    if count < 2 or period <= 0 or numbers.size != count * columns or not np.isfinite(numbers).all():
        raise ValueError(f"{count} frames of {columns} numbers are announced, and {numbers.size} are there")
    return numbers.reshape(count, columns), period


def _about(axis: int, angle: Array) -> Array:
    """Rotations (T, 3, 3) about an axis."""
    c, s, found = np.cos(angle), np.sin(angle), np.zeros((len(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1.0
    found[:, i, i], found[:, j, j], found[:, j, i], found[:, i, j] = c, c, s, -s
    return found


def _limbs(joints: Sequence[_Joint], path: Path) -> list[tuple[int, int]]:
    """For each of BONES its joint, and the one that its direction goes to."""
    plain = ["".join(c for c in joint.name.rpartition(":")[2].lower() if c.isalnum()) for joint in joints]
    found: list[tuple[int, int]] = []
    for bone in BONES:
        side, _, limb = bone.partition("_") if bone.startswith(("left_", "right_")) else ("", "", bone)
        wanted = [
            name for base in _NAMES[limb] for name in ((f"{side}{base}", f"{side[:1]}{base}") if side else (base,))
        ]
        match = next((plain.index(name) for name in wanted if name in plain), None)
        if match is None:
            raise AssetError(
                f"{path.name} has no joint for the {bone.replace('_', ' ')} (it has: {listing(plain, 40)})"
            )
        child = next((i for i, joint in enumerate(joints) if joint.parent == match and joint.offset.any()), match)
        found.append((match, child))
    return found


def _fitted(limbs: Sequence[tuple[int, int]], rest: Array, turn: Array, place: Array, period: float) -> Motion:
    """A motion of our links from rotations (T, J, 3, 3) and places (T, J, 3) of joints, and their rest (J, 3)."""
    rotation = np.empty((len(turn), len(BONES), 3, 3))
    for number, (bone, (joint, child)) in enumerate(zip(BONES, limbs, strict=True)):
        upright = bone in ("pelvis", "torso", "head")
        direction = np.array([0.0, 0.0, 1.0]) if upright or joint == child else rest[child] - rest[joint]
        beside = np.array([1.0, 0.0, 0.0]) if "arm" in bone or "hand" in bone else np.array([0.0, 1.0, 0.0])
        rotation[:, number] = turn[:, joint] @ frames.along(direction, beside)
    hips, shins, feet = (limbs[BONES.index(b)][0] for b in ("left_thigh", "left_shin", "left_foot"))
    leg = float(np.linalg.norm(rest[shins] - rest[hips]) + np.linalg.norm(rest[feet] - rest[shins]))
    first = rotation[0, 0] @ np.array([1.0, 0.0, 0.0])
    level = frames.turned(np.array(-np.arctan2(first[1], first[0])), np.array(0.0))
    ways = place[:, limbs[0][0]].copy()
    low = min(float(place[:, limbs[BONES.index(f"{side}_foot")][0], 2].min()) for side in ("left", "right"))
    ways -= np.array([ways[0, 0], ways[0, 1], low])
    return Motion(ways @ level.T / leg, frames.quaternions(level @ rotation), period)
