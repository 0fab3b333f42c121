"""Pictures of soft matter, docs/images/soft.jpg on three engines and docs/images/soft_physics.png against formulas.

`python scripts/soft_picture.py` writes them and prints the figures of docs/soft.md.
"""

from pathlib import Path
from typing import Any

import numpy as np
from pictures import begun, side_by_side
from PIL import Image, ImageDraw

IMAGES = Path(__file__).parents[1] / "docs" / "images"
STEPS = 25


def world() -> dict[str, Any]:
    """A ball on a block, a rope over a bar, and a cloth with a ball in it, hung from its corners."""
    ball = {"source": {"sphere": 0.04}, "mass": 0.3}
    bar = {"source": {"box": [0.03, 0.2, 0.03]}, "fixed": True}
    corners = ["-x-y", "-x+y", "+x-y", "+x+y"]
    cloth = {"kind": "fem_cloth", "size": [0.26, 0.26], "young": 1e6, "fixed": corners, "position": [0.3, 0, 0.2]}
    rope = {"kind": "rope", "path": [[-0.25, 0, 0], [0.2, 0, 0]], "radius": 0.008, "position": [0.0, 0.2, 0.26]}
    return {
        "objects": {"heavy": {**ball, "color": "red"}, "light": {**ball, "mass": 0.1, "color": "yellow"}, "bar": bar},
        "layout": {
            "heavy": {"position": [0.0, 0.0, 0.2]},
            "light": {"position": [0.3, 0.0, 0.25]},
            "bar": {"position": [0.0, 0.2, 0.22]},
        },
        "cameras": {"eye": {"look_at": [0.15, 0.08, 0.1], "from": [0.2, -0.6, 0.4], "size": [400, 320]}},
        "families": {
            "block": {"kind": "deformable", "box": [0.16, 0.16, 0.1], "young": 1e4, "points": [9, 9, 5]},
            "rope": rope,
            "cloth": cloth,
        },
    }


def beam(steps: int = 50) -> tuple[Any, Any, str]:
    """The line of a beam that is held at one end, that of Euler and Bernoulli, and what they say of its tip."""
    young, length, wide = 1e7, 0.5, 0.05
    matter = {"kind": "deformable", "box": [length, wide, wide], "position": [0.0, 0.0, 0.5], "young": young}
    matter |= {"damping": 0.05, "poisson": 0.0, "cells": [4, 1, 1], "points": [17, 3, 3], "fixed": ["-x"]}
    with begun("mujoco", {"families": {"it": matter}}) as env:
        for _ in range(steps):
            env.step([[]])
        assert env.families is not None
        x = env.families.state("it").points[0].reshape(17, 9, 3).mean(axis=1)
    x[:, 0] += length / 2
    a = np.linspace(0, length, 17)
    fall = 1000 * 9.81 * wide**2 * a**2 * (6 * length**2 - 4 * length * a + a**2) / (24 * young * wide**4 / 12)
    found, told = 0.525 - x[-1, 2], fall[-1]
    words = f"beam: tip {1e3 * found:.2f} mm, Euler-Bernoulli {1e3 * told:.2f} mm ({100 * (found / told - 1):+.1f} %)"
    return np.stack([x[:, 0], x[:, 2] - 0.525], 1), np.stack([a, -fall], 1), words


def chain(steps: int = 150) -> tuple[Any, Any, str]:
    """The line of a rope between two points, a catenary of its length, and their sags."""
    rope = {"kind": "rope", "path": [[-0.4, 0, 0], [0, 0, -0.3], [0.4, 0, 0]], "position": [0, 0, 1], "drag": 2.0}
    with begun("mujoco", {"families": {"it": {**rope, "fixed": ["start", "end"]}}}) as env:
        for _ in range(steps):
            env.step([[]])
        assert env.families is not None
        x = env.families.state("it").points[0]
    low, high = 0.01, 10.0
    for _ in range(100):
        a = 0.5 * (low + high)
        low, high = (a, high) if 2 * a * np.sinh(0.4 / a) > 1.0 else (low, a)
    s = np.linspace(-0.4, 0.4, 81)
    line = a * (np.cosh(s / a) - np.cosh(0.4 / a))
    found, told = 1.0 - x[:, 2].min(), -line.min()
    words = f"rope: sag {1e3 * found:.2f} mm, catenary {1e3 * told:.2f} mm ({100 * (found / told - 1):+.2f} %)"
    return np.stack([x[:, 0], x[:, 2] - 1.0], 1), np.stack([s, line], 1), words


def plot(curves: list[tuple[Any, Any, str]], size: tuple[int, int] = (480, 300)) -> Image.Image:
    """Dots as found on lines of formulas, a panel for each, of equal scale along both axes."""
    picture = Image.new("RGB", (size[0] * len(curves), size[1]), "white")
    draw = ImageDraw.Draw(picture)
    for panel, (found, told, words) in enumerate(curves):
        every = np.concatenate([found, told])
        scale = min((size[0] - 60) / np.ptp(every[:, 0]), (size[1] - 90) / np.ptp(every[:, 1]))
        place = [panel * size[0] + 30, 55] - scale * np.array([every[:, 0].min(), -every[:, 1].max()])
        draw.line([tuple(place + scale * p * [1, -1]) for p in told], fill=(60, 90, 160), width=2)
        for p in found:
            u, v = place + scale * p * [1, -1]
            draw.ellipse([u - 3, v - 3, u + 3, v + 3], outline=(200, 70, 40), width=2)
        draw.text((panel * size[0] + 30, 15), words, fill="black")
    return picture


if __name__ == "__main__":
    side_by_side(world(), "eye", STEPS).save(IMAGES / "soft.jpg", quality=85)
    curves = [beam(), chain()]
    plot(curves).save(IMAGES / "soft_physics.png", optimize=True)
    for _, _, words in curves:
        print(words)
