"""Bodies of avatars: bones by stature, capsules around them, and the seed that makes each its own."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind, Capsule, Geom, Inertial, Mesh, Quat, Site, Surface, Vec3

BONES = (
    "pelvis",
    "torso",
    "head",
    "left_upper_arm",
    "right_upper_arm",
    "left_forearm",
    "right_forearm",
    "left_hand",
    "right_hand",
    "left_thigh",
    "right_thigh",
    "left_shin",
    "right_shin",
    "left_foot",
    "right_foot",
)
"""The links of an avatar, in the order of its bodies; the pelvis is the root."""
PARENTS = (-1, 0, 1, 1, 1, 3, 4, 5, 6, 0, 0, 9, 10, 11, 12)
MASS = 1e5
"""[kg] of a body that is driven: what it meets changes its velocity by a millionth and not where it goes."""
CHIN, WRIST = 0.05, 0.03
"""[m] of a mouth below the middle of a head; of `forearm_top` from the middle of a forearm."""
OVER = 0.045
"""[m] above a palm what is put into it may be held."""
BITE = 0.045
"""[m] before a mouth is the middle of a spoon that it eats from."""
_SKIN = ((0.94, 0.78, 0.66), (0.80, 0.60, 0.46), (0.55, 0.38, 0.27), (0.36, 0.24, 0.17))
_CLOTHES = (
    (0.17, 0.32, 0.56),
    (0.62, 0.20, 0.20),
    (0.22, 0.45, 0.30),
    (0.85, 0.66, 0.25),
    (0.45, 0.33, 0.55),
    (0.25, 0.26, 0.30),
    (0.78, 0.78, 0.76),
)


Look = tuple[tuple[Mesh, ...], tuple[Geom, ...]]
"""Meshes, and what is drawn of them on the links."""


class Proportions(NamedTuple):
    """Lengths [m] of one avatar; radii of its capsules are `girth` times those of a slim adult of its height."""

    height: float
    thigh: float
    shin: float
    ankle: float
    hip: float  # from the middle to a hip
    waist: float  # from the hips to the waist
    torso: float
    shoulder: float  # from the middle to a shoulder
    upper_arm: float
    forearm: float
    hand: float
    neck: float  # from the neck's base to the middle of the head
    girth: float
    colors: tuple[Vec3, Vec3, Vec3]

    @property
    def leg(self) -> float:
        """The length of a straight leg, hip to ankle."""
        return self.thigh + self.shin

    @property
    def arm(self) -> float:
        """The length of a straight arm, shoulder to palm."""
        return self.upper_arm + self.forearm + 0.5 * self.hand


def proportions(height: float, rng: np.random.Generator) -> Proportions:
    """Those of an adult of a height: legs, arms and girth vary by some percent."""
    leg, arm = (height * float(rng.uniform(0.97, 1.03)) for _ in range(2))
    girth, wide = float(rng.uniform(0.92, 1.2)), float(rng.uniform(0.95, 1.08))
    thigh, shin, ankle = 0.243 * leg, 0.240 * leg, 0.048 * height
    neck = 0.095 * height
    waist, head_top = 0.055 * height, 0.065 * height
    torso = height - (thigh + shin + ankle + waist + neck + head_top)
    skin, shirt, trousers = (palette[int(rng.integers(len(palette)))] for palette in (_SKIN, _CLOTHES, _CLOTHES))
    return Proportions(
        height,
        thigh,
        shin,
        ankle,
        0.052 * height * wide,
        waist,
        torso,
        0.112 * height * wide,
        0.165 * arm,
        0.15 * arm,
        0.10 * arm,
        neck,
        girth,
        (skin, shirt, trousers),
    )


def lengths(one: Proportions) -> Array:
    """(15,) [m] of the bones, in the order of BONES, from their joint to their end."""
    pairs = (one.upper_arm, one.forearm, one.hand, one.thigh, one.shin, 0.145 * one.height)
    return np.array([one.waist, one.torso, one.neck, *(x for x in pairs for _ in (0, 1))])


def capsules(one: Proportions) -> list[tuple[float, float, Vec3, Quat]]:
    """Radius, half length, place and rotation in the link's frame (z along the bone, in its middle), of each link."""
    slim = one.height * one.girth / 1.75
    size: list[float] = lengths(one).tolist()  # numbers of Python: engines write them into files as they are
    along: Quat = (0.0, 0.0, 0.0, 1.0)
    across: Quat = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))  # its axis along y
    radii = (0.115, 0.125, 0.105, 0.048, 0.048, 0.040, 0.040, 0.036, 0.036, 0.075, 0.075, 0.052, 0.052, 0.042, 0.042)
    found: list[tuple[float, float, Vec3, Quat]] = []
    for bone, (name, radius) in enumerate(zip(BONES, radii, strict=True)):
        r, half = radius * slim, max(size[bone] / 2 - (radius * slim if name == "torso" else 0.0), 0.02)
        if name == "pelvis":
            found.append((r, one.hip * 0.8, (0.0, 0.0, 0.0), across))
        elif name == "head":
            half = 0.028 * slim
            found.append((r, half, (0.0, 0.0, size[bone] + 0.065 * one.height - half - r), along))  # up to its height
        else:
            found.append((r, half, (0.0, 0.0, 0.0), along))
    return found


def segments(one: Proportions) -> tuple[Array, Array]:
    """The ends (2, 15, 3) of the axes of the capsules in the frames of their links, and their radii (15,) [m]."""
    found = capsules(one)
    half = np.array([half for _, half, _, _ in found])
    axis = np.stack([P.rotate(np.array(turn), np.array([0.0, 0.0, 1.0])) for *_, turn in found])
    place = np.array([place for *_, place, _ in found])
    return np.stack([place - half[:, None] * axis, place + half[:, None] * axis]), np.array([r for r, *_ in found])


def sites(one: Proportions) -> tuple[Site, ...]:
    """Frames: `mouth`, x out of the face; `left_palm` and its kin, z out of the skin and x towards the fingers.

    `bite` is BITE before the mouth, where the middle of what it is fed from is brought.

    `left_over_palm` is OVER above it, where what is offered to a hand is brought; `left_forearm_top` is nearer to the
    wrist than to the elbow.
    """
    found = capsules(one)
    radii, half, middle = [capsule[0] for capsule in found], found[2][1], found[2][2][2]
    outwards: Quat = (sqrt(0.5), 0.0, sqrt(0.5), 0.0)
    face = sqrt(radii[2] ** 2 - max(CHIN - half, 0.0) ** 2)
    sites = [Site(name, 2, (face + ahead, 0.0, middle - CHIN)) for name, ahead in (("mouth", 0.0), ("bite", BITE))]
    for name, bones, above, along in (
        ("palm", (7, 8), 0.0, 0.0),
        ("over_palm", (7, 8), OVER, 0.0),
        ("forearm_top", (5, 6), 0.0, WRIST),
    ):
        for side, bone in zip(("left", "right"), bones, strict=True):
            sites.append(Site(f"{side}_{name}", bone, (radii[bone] + above, 0.0, along), outwards))
    return tuple(sites)


def model(name: str, one: Proportions, poses: Array, look: Look | None = None) -> ImportedModel:
    """The bodies of an avatar, at poses (15, 7) of its links; a `look` is drawn in place of the capsules."""
    skin, shirt, trousers = one.colors
    color = {"head": skin, "hand": skin, "forearm": skin, "torso": shirt, "arm": shirt, "foot": (0.15, 0.13, 0.12)}
    bodies: list[Body] = []
    geoms: list[Geom] = []
    moment = 0.05 * MASS
    inertial = Inertial(MASS, inertia=(moment, moment, moment, 0.0, 0.0, 0.0))  # a ball's: it turns on as it turns
    for bone, (radius, half, place, turn) in enumerate(capsules(one)):
        x, y, z, *q = poses[bone].tolist()
        bodies.append(
            Body(
                BONES[bone] if bone else "",
                BodyKind.FREE,
                position=(x, y, z),
                quaternion=(q[0], q[1], q[2], q[3]),
                inertial=inertial,
                gravity_compensation=True,
            )
        )
        shown = next((c for part, c in color.items() if BONES[bone].endswith(part)), trousers)
        touch = Surface(friction=0.7)
        seen = look is None
        geoms.append(Geom(BONES[bone], bone, Capsule(radius, half), place, turn, (*shown, 1.0), touch, visible=seen))
        if bone == 2 and seen:
            nose = Capsule(0.018, 0.012)
            front = (float(radius), 0.0, place[2])
            geoms.append(Geom("nose", bone, nose, front, color=(*skin, 1.0), collides=False))
    meshes, skin_of = ((), ()) if look is None else look
    geoms += skin_of
    links = {"": 0} | {bone: i for i, bone in enumerate(BONES) if i}
    return ImportedModel(
        name,
        tuple(bodies),
        geoms=tuple(geoms),
        geom_links=tuple(BONES[g.body] if g.body else "" for g in geoms),
        meshes=meshes,
        sites=sites(one),
        links=links,
    )
