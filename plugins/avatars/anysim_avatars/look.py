"""The look `body` of avatars: limbs, trunk and head as smooth closed surfaces; what touches things stays capsules.

Every surface is a loft: ellipses across a bone, joined, rounded off at both ends. Shapes are drawn here and follow the
proportions of each avatar; no model of a body is read. Limbs are rigid, and end in balls within one another, so that
joints stay closed as they bend.
"""

from typing import NamedTuple

import numpy as np

from anysim import cache
from anysim.conventions import Array
from anysim.model.parts import Geom
from anysim.model.shapes import Capsule, Mesh, MeshShape, Sphere
from anysim.model.world import Vec3
from anysim_avatars.bodies import BONES, Proportions, lengths

AROUND = 20
"""Points of an ellipse."""
_SHOE: Vec3 = (0.15, 0.13, 0.12)
_EYE = (0.08, 0.06, 0.05, 1.0)
_HAIR: tuple[Vec3, ...] = ((0.10, 0.08, 0.07), (0.26, 0.17, 0.10), (0.45, 0.33, 0.18), (0.55, 0.54, 0.52))


class Ring(NamedTuple):
    """An ellipse across a bone: place along it [m], half widths along x and y [m], and its middle along x [m]."""

    z: float
    x: float
    y: float
    middle: float = 0.0


def loft(rings: list[Ring]) -> tuple[Array, Array]:
    """Vertices (V, 3) [m] and faces (F, 3), outwards, of a closed surface through ellipses in order of z."""
    first, last = rings[0], rings[-1]
    all_rings = [*_cap(first, -1.0)[::-1], *rings, *_cap(last, 1.0)]
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    body = [np.column_stack([around * (r.x, r.y) + (r.middle, 0.0), np.full(AROUND, r.z)]) for r in all_rings]
    ends = [[r.middle, 0.0, r.z + sign * 0.6 * min(r.x, r.y)] for r, sign in ((first, -1.0), (last, 1.0))]
    vertices = np.concatenate([*body, ends])
    here = np.arange(AROUND)
    there = np.roll(here, -1)
    faces: list[Array] = []
    for row in range(len(all_rings) - 1):
        low, high = row * AROUND, (row + 1) * AROUND
        faces += [
            np.column_stack([low + here, low + there, high + there]),
            np.column_stack([low + here, high + there, high + here]),
        ]
    bottom, top = len(vertices) - 2, len(vertices) - 1
    high = (len(all_rings) - 1) * AROUND
    faces += [
        np.column_stack([there, here, np.full(AROUND, bottom)]),
        np.column_stack([high + here, high + there, np.full(AROUND, top)]),
    ]
    return vertices, np.concatenate(faces).astype(np.int32)


def _cap(ring: Ring, sign: float) -> list[Ring]:
    """Smaller ellipses beyond an end, which round it off."""
    rise = 0.6 * min(ring.x, ring.y)
    angles = (0.25 * np.pi, 0.42 * np.pi)
    return [
        Ring(ring.z + sign * rise * float(np.sin(a)), ring.x * float(np.cos(a)), ring.y * float(np.cos(a)), ring.middle)
        for a in angles
    ]


def surfaces(one: Proportions) -> dict[str, tuple[int, list[Ring]]]:
    """The bone and the rings of each surface, by name."""
    slim = one.height * one.girth / 1.75
    size = lengths(one)
    tall = one.height / 1.75

    def along(bone: int, *profile: tuple[float, float, float, float]) -> list[Ring]:
        """Rings from shares of a bone's length from its middle, and sizes of an adult of 1.75 m."""
        return [Ring(float(share * size[bone]), x * slim, y * slim, m * slim) for share, x, y, m in profile]

    wide = one.shoulder / slim  # the trunk is as wide as the arms are apart
    hip = one.hip / slim
    found = {
        "pelvis": (
            0,
            along(0, (-0.9, 0.085, hip + 0.055, 0.0), (0.0, 0.108, hip + 0.07, -0.005), (0.9, 0.1, 0.14, 0.0)),
        ),
        "torso": (
            1,
            along(
                1,
                (-0.5, 0.096, 0.132, 0.0),
                (-0.3, 0.094, 0.13, 0.002),
                (-0.05, 0.107, 0.148, 0.006),
                (0.18, 0.114, wide - 0.02, 0.008),
                (0.34, 0.1, wide - 0.008, 0.002),
                (0.43, 0.076, wide - 0.016, -0.004),
                (0.475, 0.06, wide - 0.07, -0.008),
                (0.5, 0.052, 0.062, -0.01),
            ),
        ),
        "neck": (
            2,
            [Ring(-0.03 * tall, 0.056 * slim, 0.06 * slim, -0.008), Ring(0.1 * tall, 0.05 * slim, 0.052 * slim)],
        ),
    }
    middle, top = float(size[2]), 0.065 * one.height
    skull = [  # shares of the head's half height, and half widths [m]
        (-0.92, 0.035, 0.032, 0.035),
        (-0.7, 0.062, 0.054, 0.026),
        (-0.35, 0.085, 0.068, 0.012),
        (0.0, 0.097, 0.076, 0.004),
        (0.4, 0.098, 0.078, -0.004),
        (0.7, 0.082, 0.066, -0.006),
        (0.88, 0.055, 0.046, -0.006),
    ]
    found["head"] = (2, [Ring(middle + top * z, x * tall, y * tall, m * tall) for z, x, y, m in skull])
    hair = [(0.42, 0.104, 0.084, -0.016), (0.72, 0.09, 0.074, -0.014), (0.93, 0.06, 0.052, -0.01)]
    found["hair"] = (2, [Ring(middle + top * z, x * tall, y * tall, m * tall) for z, x, y, m in hair])
    for side in (0, 1):
        name = ("left", "right")[side]
        limbs = {
            3: (
                (-0.42, 0.05, 0.05, 0.0),
                (-0.1, 0.05, 0.048, 0.004),
                (0.25, 0.044, 0.042, 0.0),
                (0.5, 0.038, 0.04, 0.0),
            ),
            5: (
                (-0.5, 0.038, 0.04, 0.0),
                (-0.25, 0.042, 0.044, 0.0),
                (0.2, 0.034, 0.034, 0.0),
                (0.5, 0.024, 0.029, 0.0),
            ),
            7: (
                (-0.42, 0.02, 0.03, 0.0),
                (0.0, 0.017, 0.044, 0.0),
                (0.3, 0.014, 0.04, 0.002),
                (0.5, 0.01, 0.028, 0.004),
            ),
            9: (
                (-0.45, 0.086, 0.082, 0.0),
                (-0.2, 0.084, 0.08, 0.0),
                (0.2, 0.066, 0.064, 0.0),
                (0.5, 0.053, 0.054, 0.0),
            ),
            11: (
                (-0.5, 0.053, 0.054, 0.0),
                (-0.25, 0.06, 0.056, 0.012),
                (0.2, 0.044, 0.042, 0.004),
                (0.5, 0.034, 0.034, 0.0),
            ),
            13: (
                (-0.42, 0.04, 0.034, -0.002),
                (-0.2, 0.05, 0.04, -0.01),
                (0.1, 0.034, 0.046, 0.006),
                (0.32, 0.024, 0.048, 0.016),
                (0.44, 0.019, 0.04, 0.02),
            ),
        }
        for bone, profile in limbs.items():
            found[f"{name}_{BONES[bone].partition('_')[2]}"] = (bone + side, along(bone + side, *profile))
    return found


def shapes(one: Proportions) -> tuple[tuple[Mesh, ...], tuple[Geom, ...]]:
    """The meshes, and what is drawn of them: nothing of it collides. The colours of the hair follow from the skin's."""
    skin, shirt, trousers = one.colors
    color = {"hair": _HAIR[round(1000 * sum(one.colors[1])) % len(_HAIR)], "pelvis": trousers, "torso": shirt}
    color |= {"thigh": trousers, "shin": trousers, "foot": _SHOE, "arm": shirt, "forearm": skin}
    meshes: list[Mesh] = []
    geoms: list[Geom] = []
    for name, (bone, rings) in surfaces(one).items():
        vertices, faces = loft(rings)
        part = name.rpartition("_")[2]
        made_of = cache.digest("avatar look 1", *(f"{value:.10g}" for ring in rings for value in ring))
        meshes.append(Mesh(f"{name}_skin", vertices, faces, made_of))
        shown = (*color.get(part, skin), 1.0)
        geoms.append(Geom(f"{name}_skin", bone, MeshShape(f"{name}_skin"), color=shown, collides=False))
    tall = one.height / 1.75
    height = float(lengths(one)[2])
    bridge = (0.1 * tall, 0.0, height - 0.012 * tall)
    geoms.append(Geom("nose_skin", 2, Capsule(0.011 * tall, 0.012 * tall), bridge, color=(*skin, 1.0), collides=False))
    for side, y in (("left", 0.03 * tall), ("right", -0.03 * tall)):
        place = (0.088 * tall, y, height + 0.008 * tall)
        geoms.append(Geom(f"{side}_eye_skin", 2, Sphere(0.009 * tall), place, color=_EYE, collides=False))
    return tuple(meshes), tuple(geoms)
