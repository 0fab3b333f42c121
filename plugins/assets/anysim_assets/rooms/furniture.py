"""Furniture from primitives, in many sizes and colours.

A piece stands on the floor about the origin of its frame: x along its width, y towards its front. What it looks like
is drawn from a generator; a piece with the same draws is the same piece.
"""

from collections.abc import Callable, Mapping
from math import pi
from typing import NamedTuple

import numpy as np

from anysim.model.world import Box, Cylinder, Shape, Sphere, Vec3

Rgb = tuple[float, float, float]

WOODS: tuple[Rgb, ...] = ((0.55, 0.37, 0.22), (0.72, 0.54, 0.34), (0.40, 0.26, 0.16), (0.82, 0.70, 0.52))
PAINTS: tuple[Rgb, ...] = ((0.90, 0.89, 0.86), (0.62, 0.68, 0.66), (0.33, 0.39, 0.42), (0.75, 0.80, 0.83))
CLOTHS: tuple[Rgb, ...] = ((0.34, 0.42, 0.52), (0.55, 0.35, 0.30), (0.42, 0.48, 0.36), (0.62, 0.58, 0.52))
SPINES: tuple[Rgb, ...] = ((0.50, 0.20, 0.18), (0.20, 0.32, 0.44), (0.24, 0.40, 0.28), (0.70, 0.62, 0.44))
WHITE: Rgb = (0.93, 0.92, 0.89)
METAL: Rgb = (0.55, 0.56, 0.58)
STONE: Rgb = (0.32, 0.32, 0.34)
LEAF: Rgb = (0.24, 0.42, 0.20)
CLAY: Rgb = (0.66, 0.38, 0.26)


class Part(NamedTuple):
    """A primitive of a piece; `main` ones share the colour that may be drawn; small ones are only seen."""

    shape: Shape
    position: Vec3
    color: Rgb
    main: bool = False
    collides: bool = True


class Piece(NamedTuple):
    """Half sizes of the footprint along x and y, height [m], and the parts."""

    half: tuple[float, float]
    height: float
    parts: tuple[Part, ...]


class _Maker:
    """Collects boxes; sizes are full extents, places are of the middle and of the lower side."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.parts: list[Part] = []

    def size(self, low: float, high: float) -> float:
        """A length in whole centimetres."""
        return round(float(self.rng.uniform(low, high)), 2)

    def one_of(self, colors: tuple[Rgb, ...]) -> Rgb:
        """A colour, a little lighter or darker."""
        r, g, b = np.clip(np.array(colors[int(self.rng.integers(len(colors)))]) * self.rng.uniform(0.9, 1.1), 0, 1)
        return (float(r), float(g), float(b))

    def box(
        self, size: Vec3, x: float, y: float, low: float, color: Rgb, *, main: bool = False, collides: bool = True
    ) -> None:
        """A box on the height `low`."""
        shape = Box((size[0] / 2, size[1] / 2, size[2] / 2))
        self.parts.append(Part(shape, (x, y, low + size[2] / 2), color, main, collides))

    def tube(
        self, radius: float, length: float, x: float, y: float, low: float, color: Rgb, main: bool = False
    ) -> None:
        """An upright cylinder on the height `low`."""
        self.parts.append(Part(Cylinder(radius, length / 2), (x, y, low + length / 2), color, main))

    def legs(self, w: float, d: float, height: float, thick: float, color: Rgb, inset: float = 0.0) -> None:
        """Four of them, `inset` from the corners of a w by d top."""
        for sx in (-1, 1):
            for sy in (-1, 1):
                x, y = (sx * (w / 2 - thick / 2 - inset), sy * (d / 2 - thick / 2 - inset))
                self.box((thick, thick, height), x, y, 0.0, color, main=True)

    def made(self, w: float, d: float, height: float) -> Piece:
        """The piece, w wide and d deep."""
        return Piece((w / 2, d / 2), height, tuple(self.parts))


def _table(m: _Maker) -> Piece:
    w, d, h, color = m.size(1.0, 1.6), m.size(0.7, 0.9), m.size(0.72, 0.76), m.one_of(WOODS)
    m.box((w, d, 0.04), 0, 0, h - 0.04, color, main=True)
    m.box((w - 0.16, d - 0.16, 0.08), 0, 0, h - 0.12, color, main=True)
    m.legs(w, d, h - 0.04, 0.06, color, 0.03)
    return m.made(w, d, h)


def _desk(m: _Maker) -> Piece:
    w, d, h, color = m.size(1.1, 1.5), m.size(0.6, 0.7), 0.74, m.one_of(WOODS + PAINTS)
    side = -1 if m.rng.random() < 0.5 else 1
    m.box((w, d, 0.03), 0, 0, h - 0.03, color, main=True)
    m.box((0.03, d - 0.04, h - 0.03), -side * (w / 2 - 0.015), 0, 0.0, color, main=True)
    m.box((0.4, d - 0.04, h - 0.03), side * (w / 2 - 0.2), 0, 0.0, color, main=True)
    m.box((w - 0.06, 0.02, 0.4), 0, -d / 2 + 0.04, h - 0.45, color, main=True)
    for k in range(3):
        m.box((0.36, 0.012, 0.2), side * (w / 2 - 0.2), d / 2 - 0.02, 0.05 + 0.22 * k, WHITE, collides=False)
        m.box((0.12, 0.01, 0.015), side * (w / 2 - 0.2), d / 2 - 0.01, 0.15 + 0.22 * k, METAL, collides=False)
    m.box((0.5, 0.03, 0.3), -side * 0.1, -d / 2 + 0.15, h + 0.08, (0.12, 0.12, 0.13))  # a screen
    m.box((0.05, 0.03, 0.08), -side * 0.1, -d / 2 + 0.15, h, (0.12, 0.12, 0.13))
    return m.made(w, d, h + 0.38)


def _chair(m: _Maker) -> Piece:
    w, d, seat, color = m.size(0.40, 0.46), m.size(0.42, 0.48), m.size(0.44, 0.47), m.one_of(WOODS)
    m.box((w, d, 0.035), 0, 0, seat - 0.035, color, main=True)
    m.legs(w, d, seat - 0.035, 0.035, color, 0.005)
    if m.rng.random() < 0.5:
        m.box((w - 0.04, d - 0.04, 0.03), 0, 0, seat, m.one_of(CLOTHS), collides=False)
    top = seat + m.size(0.38, 0.46)
    for sx in (-1, 1):
        m.box((0.035, 0.035, top - seat), sx * (w / 2 - 0.0225), -d / 2 + 0.0225, seat, color, main=True)
    for k in range(3):
        m.box((w - 0.08, 0.02, 0.06), 0, -d / 2 + 0.0225, top - 0.08 - 0.11 * k, color, main=True)
    return m.made(w, d, top)


def _sofa(m: _Maker) -> Piece:
    seats = 2 if m.rng.random() < 0.5 else 3
    w, d, color = round(0.36 + 0.62 * seats, 2), m.size(0.85, 0.95), m.one_of(CLOTHS)
    m.box((w, d, 0.3), 0, 0, 0.08, color, main=True)
    m.box((w, 0.2, 0.47), 0, -d / 2 + 0.1, 0.38, color, main=True)
    for sx in (-1, 1):
        m.box((0.18, d, 0.24), sx * (w / 2 - 0.09), 0, 0.38, color, main=True)
    r, g, b = (min(1.0, 1.15 * c) for c in color)
    for k in range(seats):
        x = -w / 2 + 0.18 + 0.62 * (k + 0.5)
        m.box((0.60, d - 0.22, 0.12), x, 0.1, 0.38, (r, g, b))
        m.box((0.58, 0.14, 0.32), x, -d / 2 + 0.27, 0.5, (r, g, b))
    m.legs(w, d, 0.08, 0.06, (0.2, 0.15, 0.1), 0.04)
    return m.made(w, d, 0.85)


def _bed(m: _Maker) -> Piece:
    w = (0.95, 1.45, 1.65)[int(m.rng.integers(3))]
    d, color, cloth = 2.08, m.one_of(WOODS), m.one_of(CLOTHS)
    m.box((w, 0.06, m.size(0.85, 1.1)), 0, -d / 2 + 0.03, 0.0, color, main=True)
    m.box((w, d - 0.06, 0.22), 0, 0.03, 0.08, color, main=True)
    m.legs(w, d, 0.08, 0.07, color, 0.03)
    m.box((w - 0.06, d - 0.14, 0.2), 0, 0.03, 0.30, WHITE)
    m.box((w - 0.02, 0.66 * d, 0.05), 0, d / 2 - 0.33 * d - 0.02, 0.47, cloth, collides=False)
    count = 1 if w < 1.2 else 2
    for k in range(count):
        x = 0.0 if count == 1 else (k - 0.5) * w / 2
        m.box((0.55, 0.36, 0.11), x, -d / 2 + 0.32, 0.50, (0.97, 0.96, 0.94), collides=False)
    return m.made(w, d, 1.0)


def _nightstand(m: _Maker) -> Piece:
    w, d, h, color = m.size(0.4, 0.5), m.size(0.36, 0.42), m.size(0.45, 0.55), m.one_of(WOODS)
    m.box((w, d, h - 0.1), 0, 0, 0.1, color, main=True)
    m.legs(w, d, 0.1, 0.04, color)
    for k in range(2):
        m.box((w - 0.06, 0.01, 0.13), 0, d / 2 - 0.004, 0.14 + k * (h - 0.14) / 2, WHITE, collides=False)
    return m.made(w, d, h)


def _shelf(m: _Maker) -> Piece:
    w, d, h, color = m.size(0.8, 1.2), m.size(0.28, 0.34), m.size(1.5, 2.0), m.one_of(WOODS + PAINTS)
    boards = int(m.rng.integers(4, 7))
    for sx in (-1, 1):
        m.box((0.025, d, h), sx * (w / 2 - 0.0125), 0, 0.0, color, main=True)
    m.box((w - 0.05, 0.015, h), 0, -d / 2 + 0.0075, 0.0, color, main=True)
    pitch = (h - 0.03) / (boards - 1)
    for k in range(boards):
        m.box((w - 0.05, d - 0.015, 0.025), 0, 0.0075, k * pitch, color, main=True)
        if k == boards - 1:
            break
        at = -w / 2 + 0.04
        while at < w / 2 - 0.16 and m.rng.random() < 0.8:  # rows of books
            run = min(m.size(0.1, 0.3), w / 2 - 0.04 - at)
            tall = min(m.size(0.16, 0.28), pitch - 0.05)
            m.box((run, 0.18, tall), at + run / 2, -d / 2 + 0.12, k * pitch + 0.025, m.one_of(SPINES), collides=False)
            at += run + m.size(0.0, 0.15)
    return m.made(w, d, h)


def _wardrobe(m: _Maker) -> Piece:
    doors = int(m.rng.integers(2, 4))
    w, d, h, color = round(0.5 * doors, 2), m.size(0.56, 0.62), m.size(1.9, 2.15), m.one_of(WOODS + PAINTS)
    m.box((w, d - 0.02, h), 0, -0.01, 0.0, color, main=True)
    for k in range(doors):
        x = -w / 2 + 0.5 * (k + 0.5)
        m.box((0.48, 0.018, h - 0.1), x, d / 2 - 0.011, 0.07, color, main=True, collides=False)
        m.box((0.015, 0.02, 0.16), x + (0.2 if k % 2 == 0 else -0.2), d / 2 - 0.005, h / 2, METAL, collides=False)
    return m.made(w, d, h)


def _counter(m: _Maker) -> Piece:
    units = int(m.rng.integers(2, 5))
    w, d, h, color = round(0.5 * units, 2), 0.62, 0.9, m.one_of(PAINTS + WOODS)
    m.box((w, d - 0.1, 0.1), 0, -0.05, 0.0, STONE)
    m.box((w, d - 0.04, h - 0.14), 0, -0.02, 0.1, color, main=True)
    m.box((w, d, 0.04), 0, 0, h - 0.04, STONE)
    for k in range(units):
        x = -w / 2 + 0.5 * (k + 0.5)
        m.box((0.47, 0.016, h - 0.2), x, d / 2 - 0.033, 0.13, color, main=True, collides=False)
        m.box((0.2, 0.015, 0.015), x, d / 2 - 0.02, h - 0.14, METAL, collides=False)
    m.box((0.4, 0.36, 0.01), -w / 2 + 0.3, 0, h - 0.004, METAL, collides=False)  # a sink
    m.tube(0.012, 0.22, -w / 2 + 0.3, -0.22, h, METAL)
    return m.made(w, d, h + 0.22)


def _lamp(m: _Maker) -> Piece:
    h, r = m.size(1.35, 1.7), m.size(0.16, 0.22)
    m.tube(0.14, 0.03, 0, 0, 0.0, METAL)
    m.tube(0.014, h - 0.25, 0, 0, 0.03, METAL)
    m.tube(r, 0.25, 0, 0, h - 0.25, m.one_of(((0.95, 0.90, 0.75), (0.85, 0.62, 0.42))), main=True)
    return m.made(2 * r, 2 * r, h)


def _plant(m: _Maker) -> Piece:
    r, pot = m.size(0.2, 0.3), m.size(0.25, 0.35)
    m.tube(0.6 * r, pot, 0, 0, 0.0, m.one_of((CLAY, *PAINTS)), main=True)
    m.tube(0.02, 0.4, 0, 0, pot, (0.35, 0.25, 0.15))
    for k in range(5):
        turn, size = 2 * pi * k / 5 + m.size(0.0, 0.6), m.size(0.10, 0.13)
        reach = r - size
        x, y = float(reach * np.cos(turn)), float(reach * np.sin(turn))
        m.parts.append(Part(Sphere(size), (x, y, pot + 0.2 + 0.09 * k), m.one_of((LEAF,))))
    return m.made(2 * r, 2 * r, pot + 0.7)


MAKERS: Mapping[str, Callable[[_Maker], Piece]] = {
    "bed": _bed, "wardrobe": _wardrobe, "counter": _counter, "sofa": _sofa, "shelf": _shelf, "desk": _desk,
    "table": _table, "nightstand": _nightstand, "chair": _chair, "lamp": _lamp, "plant": _plant,
}  # fmt: skip
"""By kind, in the order in which they look for a place."""


def piece(kind: str, rng: np.random.Generator) -> Piece:
    """A piece of furniture of a kind."""
    return MAKERS[kind](_Maker(rng))
