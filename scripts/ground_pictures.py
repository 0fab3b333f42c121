"""Draw the pictures of ground and rooms: `python scripts/ground_pictures.py [FOLDER]`, docs/images where none is said.

`terrains.png` has the generators at three difficulties, `tiles.jpg` tiles of ten kinds and four levels, `rooms.png`
sixteen rooms of four styles, all drawn by MuJoCo.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from anysim.compile.world import compile_world
from anysim.conventions import Array
from anysim.engine.factory import create_simulation
from anysim_schemas.run import WorldSpec
from anysim_schemas.terrain import GENERATED

DIFFICULTIES = (0.1, 0.5, 1.0)
SIZE, CELL = [8.0, 8.0], 0.05
COLUMNS: list[Any] = ["rough", {"kind": "slopes", "amplitude": 0.04}, {"kind": "slopes", "down": True}, "stairs"]
COLUMNS += [{"kind": "stairs", "down": True}, "waves", "obstacles", "stepping_stones", "gaps", "pits"]
TILE = 6.0
ROOMS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("living_room", {"size": [5.0, 4.2], "furniture": {"nightstand": 0}}),
    ("bedroom", {"size": [4.8, 4.2]}),
    ("kitchen", {"size": [4.6, 3.8]}),
    ("office", {"plan": [[-2.7, -2.1], [2.7, -2.1], [2.7, 0.6], [0.9, 2.3], [-2.7, 2.3]]}),
)
FLOORS = ((0.62, 0.50, 0.38), (0.72, 0.63, 0.52), (0.60, 0.60, 0.58), (0.46, 0.36, 0.28))
WALLS = ((0.87, 0.85, 0.80), (0.80, 0.84, 0.86), (0.90, 0.86, 0.76), (0.82, 0.85, 0.78))


def piece(kind: str, difficulty: float) -> Array:
    """An image (H, W, 3) of generated ground from above, at an angle."""
    # a light from the side shows small steps
    spec = {
        "terrain": {"kind": kind, "difficulty": difficulty, "size": SIZE, "cell": CELL, "seed": 1,
                    "color": [0.66, 0.58, 0.46]},
        "cameras": {"above": {"from": [0.0, -8.4, 7.2], "look_at": [0, -0.4, -0.3], "fov": 47.0, "size": [280, 220]}},
        "lights": {"low": {"direction": [0.8, 0.25, -0.6], "intensity": 0.75},
                   "sky": {"direction": [-0.2, 0.3, -1.0], "intensity": 0.3}},
    }  # fmt: skip
    with create_simulation("mujoco").create_world(compile_world(WorldSpec.model_validate(spec))) as engine:
        return engine.render("above")["rgb"][0]


def terrains(path: Path) -> None:
    """One column a generator, one row a difficulty."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1.75 * len(GENERATED), 1.45 * len(DIFFICULTIES)), layout="constrained")
    axes = figure.subplots(len(DIFFICULTIES), len(GENERATED))
    for k, kind in enumerate(GENERATED):
        for i, difficulty in enumerate(DIFFICULTIES):
            axes[i, k].imshow(piece(kind, difficulty))
            axes[i, k].set_xticks([])
            axes[i, k].set_yticks([])
        axes[0, k].set_title(kind, fontsize=9)
    for i, difficulty in enumerate(DIFFICULTIES):
        axes[i, 0].set_ylabel(f"difficulty {difficulty:g}", fontsize=9)
    figure.savefig(path, dpi=90)


def tiles(path: Path) -> None:
    """A column a kind, a row a level; the hardest row is at the back."""
    from PIL import Image

    grid = {"rows": 4, "size": TILE, "border": 1.0, "columns": COLUMNS, "difficulty": [0.1, 1.0]}
    ground = {"kind": "tiles", "color": [0.66, 0.58, 0.46], "seed": 1, "tiles": grid}
    height = {
        (t.row, t.column): t.origin[2] for t in compile_world(WorldSpec.model_validate({"terrain": ground})).tiles
    }
    middle, seen = 0.5 * TILE * (len(COLUMNS) - 1), {"size": [1280, 430], "far": 200.0}
    spec = {
        "terrain": ground,
        "robots": {
            f"dog{k}": {"robot": "unitree_b1", "position": [TILE * (row := k * 3 % 4), TILE * k, height[row, k]]}
            for k in range(len(COLUMNS))
        },
        "cameras": {"above": {"from": [-47.0, middle, 38.0], "look_at": [7.2, middle, 0.0], "fov": 20.5} | seen},
        "lights": {
            "low": {"direction": [0.5, 0.7, -0.45], "intensity": 0.75},
            "sky": {"direction": [-0.2, 0.3, -1.0], "intensity": 0.3},
        },
    }
    with create_simulation("mujoco").create_world(compile_world(WorldSpec.model_validate(spec))) as engine:
        Image.fromarray(engine.render("above")["rgb"][0]).save(path, quality=72, optimize=True)


def room(style: str, more: dict[str, Any], seed: int) -> Array:
    """An image (H, W, 3) of a room from above, at an angle."""
    walls = [1, 2, 4] if "plan" in more else ["east", "north", "west"]
    fields: dict[str, Any] = {
        "style": style, "seed": seed, "height": 2.3, "floor_color": FLOORS[seed % 4],
        "wall_color": WALLS[seed // 4 % 4],
        "doors": [{"wall": 0 if "plan" in more else "south", "at": 0.3 + 0.1 * (seed % 5), "height": 2.0}],
        "windows": [{"wall": wall} for wall in walls[: 1 + seed % 2]],
    }  # fmt: skip
    camera = {"from": [1.3, -4.2, 8.4], "look_at": [0.05, 0.1, 0.3], "fov": 40.0, "size": [400, 320]}
    lights = {
        "sun": {"direction": [-0.25, 0.35, -1.0], "intensity": 0.75},
        "sky": {"direction": [0.4, 0.5, -0.6], "intensity": 0.35},
    }
    spec = {"room": {**fields, **more}, "cameras": {"above": camera}, "lights": lights}
    with create_simulation("mujoco").create_world(compile_world(WorldSpec.model_validate(spec))) as engine:
        return engine.render("above")["rgb"][0]


def rooms(path: Path) -> None:
    """A row for each style, four seeds a row."""
    from PIL import Image

    rows = [
        np.concatenate([room(style, more, seed) for seed in range(4 * i, 4 * i + 4)], axis=1)
        for i, (style, more) in enumerate(ROOMS)
    ]
    picture = Image.fromarray(np.concatenate(rows)).resize((1120, 896), Image.Resampling.LANCZOS)
    picture.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    """Draw all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("docs") / "images")
    folder: Path = parser.parse_args().folder
    terrains(folder / "terrains.png")
    tiles(folder / "tiles.jpg")
    rooms(folder / "rooms.png")


if __name__ == "__main__":
    main()
