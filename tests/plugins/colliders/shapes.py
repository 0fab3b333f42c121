"""Mesh files whose volumes are known: a part in the form of an L, a drum, a pipe that is open."""

from math import pi
from pathlib import Path

import numpy as np

WIDE, HIGH, THICK, DEEP = 0.1, 0.1, 0.02, 0.04
"""[m] of the L: its floor along x, its wall along y, how thick both are, and how deep it is along z."""
L_VOLUME = (WIDE + HIGH - THICK) * THICK * DEEP
L_HULL = L_VOLUME + (WIDE - THICK) * (HIGH - THICK) / 2 * DEEP
SIDES, RADIUS, HEIGHT = 32, 0.03, 0.1
DRUM_VOLUME = SIDES / 2 * np.sin(2 * pi / SIDES) * RADIUS**2 * HEIGHT


def l_part(folder: Path) -> Path:
    """An L whose corner is the origin, `l.obj`."""
    outline = [(0.0, 0.0), (WIDE, 0.0), (WIDE, THICK), (THICK, THICK), (THICK, HIGH), (0.0, HIGH)]
    return prism(folder / "l.obj", outline, DEEP)


def drum(folder: Path, *, closed: bool = True) -> Path:
    """A drum along z, `drum.obj`, with or without a lid and a floor."""
    turn = np.arange(SIDES) * (2 * pi / SIDES)
    outline = [(float(x), float(y)) for x, y in zip(RADIUS * np.cos(turn), RADIUS * np.sin(turn), strict=True)]
    return prism(folder / "drum.obj", outline, HEIGHT, caps=closed)


def prism(file: Path, outline: list[tuple[float, float]], height: float, *, caps: bool = True) -> Path:
    """What a counter-clockwise outline, seen from its first corner, makes from z = 0 up to a height."""
    n = len(outline)
    corners = [(x, y, z) for z in (0.0, height) for x, y in outline]
    faces = [side for i in range(n) for side in ((i, (i + 1) % n, (i + 1) % n + n), (i, (i + 1) % n + n, i + n))]
    for i in range(1, n - 1) if caps else ():
        faces += [(0, i + 1, i), (n, n + i, n + i + 1)]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    file.write_text("\n".join(lines) + "\n")
    return file
