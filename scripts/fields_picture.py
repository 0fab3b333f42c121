"""A picture of a magnet, fire, smoke and wind on three engines, docs/images/fields.png.

`python scripts/fields_picture.py` writes it.
"""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import anysim

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "fields.png"
ENGINES = ("mujoco", "pybullet", "sapien")
STEPS = 150


def world() -> dict[str, Any]:
    """A fire behind a post, smoke in the wind, steam over a pot, and iron balls that hang at a magnet."""
    ball = {"source": {"sphere": 0.03}, "mass": 0.02, "color": [0.75, 0.76, 0.78]}
    objects = {name: ball for name in ("one", "two", "three")}
    layout = {"one": [-0.85, 0.0, 0.728], "two": [-0.85, 0.0, 0.667], "three": [-0.85, 0.0, 0.606]}
    objects |= {
        "post": {"source": {"box": [0.05, 0.05, 1.1]}, "fixed": True, "color": [0.3, 0.45, 0.6]},
        "bar": {"source": {"box": [0.08, 0.08, 0.12]}, "fixed": True, "color": "red"},
        "pot": {"source": {"cylinder": [0.12, 0.15]}, "fixed": True, "color": [0.5, 0.5, 0.55]},
    }
    layout |= {"post": [0.12, -0.25, 0.55], "bar": [-0.85, 0.0, 0.82], "pot": [0.75, 0.0, 0.075]}
    iron = {name: {"body": name, "radius": 0.03, "permeability": 1000} for name in ("one", "two", "three")}
    magnet = {"kind": "magnet", "dipoles": {"bar": {"body": "bar", "moment": [0, 0, 110], "radius": 0.06}, **iron}}
    smoke = {"kind": "flow", "position": [-0.5, 0.1, 0.05], "speed": 1.0, "radius": 0.03, "emission": 2e-5}
    steam = {"kind": "flow", "look": "steam", "position": [0.75, 0, 0.16], "heat": 400, "radius": 0.08}
    return {
        "objects": objects,
        "layout": {name: {"position": place} for name, place in layout.items()},
        "cameras": {"eye": {"look_at": [0.0, 0.0, 0.5], "from": [0.2, -2.2, 1.0], "size": [400, 300]}},
        "families": {
            "magnets": magnet,
            "smoke": smoke,
            "fire": {"kind": "fire", "power": 30e3, "radius": 0.15},
            "steam": {**steam, "emission": 4e-4, "wind": [0.15, 0, 0], "lifetime": 3.0},
        },
    }


def seen(engine: str) -> Any:
    """(H, W, 3) uint8."""
    run = {"engine": engine, "physics": {"dt": 0.004, "control_dt": 0.02}, "world": world()}
    with anysim.make({**run, "task": {"observations": {"policy": ["last_action"]}}}) as env:
        env.reset(seed=0)
        for _ in range(STEPS):
            env.step([[]])
        return env.engine.render("eye")["rgb"][0]


if __name__ == "__main__":
    Image.fromarray(np.concatenate([seen(engine) for engine in ENGINES], axis=1)).save(PICTURE, optimize=True)
