"""Pictures of fields: docs/images/fields.png on three engines, and docs/images/fields_physics.png against laws.

`python scripts/fields_picture.py` writes them and prints how far dots are off the lines.
"""

from pathlib import Path
from typing import Any

import numpy as np
from pictures import ENGINES, side_by_side
from PIL import Image, ImageDraw

import anysim

IMAGES = Path(__file__).parents[1] / "docs" / "images"
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


def pulls(engine: str, moment: float = 2.0, mass: float = 0.1) -> Any:
    """(D, 2) distances [m] of a magnet over another, and the force [N] that the engine's acceleration of it tells."""
    rows = []
    for away in (0.06, 0.08, 0.1, 0.14, 0.2):
        dipoles = {"low": {"body": "a", "moment": [0, 0, moment]}}
        dipoles["high"] = {"position": [0, 0, 1.0 + away], "moment": [0, 0, moment]}
        world = {
            "objects": {"a": {"source": {"sphere": 0.02}, "mass": mass}},
            "layout": {"a": {"position": [0, 0, 1.0]}},
            "families": {"it": {"kind": "magnet", "dipoles": dipoles}},
        }
        physics = {"dt": 0.001, "control_dt": 0.001, "gravity": [0.0, 0.0, 0.0]}
        task = {"observations": {"policy": ["last_action"]}}
        with anysim.make({"engine": engine, "physics": physics, "world": world, "task": task}) as env:
            env.reset(seed=0)
            env.step([[]])
            root = env.engine.world.entities[env.engine.world.entity_numbers["a"]].root
            rows.append((away, mass * env.engine.get_state().body_twist[0, root, 2] / 0.001))
    return np.array(rows)


def carried(engine: str, wind: float = 4.0, area: float = 0.0012, mass: float = 0.004) -> Any:
    """(T, 2) times [s] and speeds [m/s] of a ball in wind, without weight."""
    flow = {"kind": "flow", "wind": [wind, 0, 0], "emission": 0.0, "drag": {"a": {"area": area}}}
    world = {
        "objects": {"a": {"source": {"sphere": 0.02}, "mass": mass}},
        "layout": {"a": {"position": [0, 0, 1.0]}},
        "families": {"it": flow},
    }
    physics = {"dt": 0.004, "control_dt": 0.02, "gravity": [0.0, 0.0, 0.0]}
    task = {"observations": {"policy": ["last_action"]}, "horizon": 1000}
    rows = []
    with anysim.make({"engine": engine, "physics": physics, "world": world, "task": task}) as env:
        env.reset(seed=0)
        root = env.engine.world.entities[env.engine.world.entity_numbers["a"]].root
        for step in range(1, 101):
            env.step([[]])
            if step % 10 == 0:
                rows.append((0.02 * step, env.engine.get_state().body_twist[0, root, 0]))
    return np.array(rows)


def panel(found: dict[str, Any], line: Any, words: str, marks: tuple[str, str], *, log: bool) -> Image.Image:
    """Dots of each engine on the line of a law, with the numbers at the ends of both axes."""
    wide, high, edge = 480, 320, 50
    picture = Image.new("RGB", (wide, high), "white")
    draw = ImageDraw.Draw(picture)
    low, top = line.min(axis=0), line.max(axis=0)
    scaled = np.log if log else np.asarray

    def at(point: Any) -> tuple[float, float]:
        u, v = (scaled(point) - scaled(low)) / (scaled(top) - scaled(low))
        return edge + u * (wide - 2 * edge), high - edge - v * (high - 2 * edge)

    draw.line([at(p) for p in line], fill=(60, 90, 160), width=2)
    colors = {"mujoco": (200, 70, 40), "pybullet": (40, 140, 60), "sapien": (150, 60, 170)}
    for number, (engine, points) in enumerate(found.items()):
        size = 3 + 2 * number
        for p in points:
            u, v = at(p)
            draw.ellipse([u - size, v - size, u + size, v + size], outline=colors[engine], width=2)
        draw.text((edge + 10 + 80 * number, high - 18), engine, fill=colors[engine])
    draw.text((edge, 12), words, fill="black")
    draw.text((edge - 20, high - edge + 8), f"{low[0]:.2g} {marks[0]}", fill="black")
    draw.text((wide - edge - 30, high - edge + 8), f"{top[0]:.2g} {marks[0]}", fill="black")
    draw.text((2, high - edge - 6), f"{low[1]:.2g}", fill="black")
    draw.text((2, edge - 16), f"{top[1]:.2g} {marks[1]}", fill="black")
    return picture


def physics() -> Image.Image:
    """Both panels; prints how far dots are off."""
    pulled, speeds = {e: pulls(e) for e in ENGINES}, {e: carried(e) for e in ENGINES}
    r, t = np.geomspace(0.06, 0.2, 50), np.linspace(0.0, 2.0, 50)
    law = lambda r: 3 * 1.25663706127e-6 * 2.0**2 / (2 * np.pi * r**4)  # noqa: E731
    k = 1.2 * 0.47 * 0.0012 / (2 * 0.004)
    drag = lambda t: 4.0 * k * 4.0 * t / (1 + k * 4.0 * t)  # noqa: E731
    for engine in ENGINES:
        off = [
            np.abs(rows[engine][:, 1] / told(rows[engine][:, 0]) - 1).max()
            for rows, told in ((pulled, law), (speeds, drag))
        ]
        print(f"{engine}: force off by {off[0]:.1e}, speed by {off[1]:.1e}")
    left = panel(pulled, np.stack([r, law(r)], 1), "two magnets on an axis, log-log", ("m", "N"), log=True)
    right = panel(speeds, np.stack([t, drag(t)], 1), "a ball of 4 g in wind of 4 m/s", ("s", "m/s"), log=False)
    return Image.fromarray(np.concatenate([np.array(left), np.array(right)], axis=1))


if __name__ == "__main__":
    physics().save(IMAGES / "fields_physics.png", optimize=True)
    side_by_side(world(), "eye", STEPS).save(IMAGES / "fields.png", optimize=True)
