"""Avatars on every engine: what a control step costs with them, and a page of pictures of each engine.

    OMP_NUM_THREADS=1 python benchmarks/avatars.py [--engines mujoco,sapien] [--envs 16] [--pictures FOLDER]

Costs are processor time of one control step of 20 ms (5 physics steps) with 0, 1 and 5 avatars that walk; the
share of the family itself is about what the engine without physics takes.
Compare with nothing that was measured on another machine.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import anysim

STEPS = 100
TASK = {"observations": {"policy": ["last_action"]}, "horizon": 2000}
CAMERAS = {"front": [4.2, -3.2, 2.2], "side": [0.9, -5.0, 1.3]}
MOMENTS = (40, 90, 120)
"""Control steps at which pictures are taken."""


def box(size: list[float], **more: Any) -> dict[str, Any]:
    return {"source": {"box": size}, **more}


SCENE: dict[str, Any] = {
    "objects": {
        "box": box([0.3, 0.3, 0.3], mass=3.0, color="red"),
        "seat": box([0.4, 0.5, 0.45], fixed=True, color="brown"),
        "table": box([0.5, 0.5, 0.8], fixed=True, color="gray"),
        "cup": {"source": {"cylinder": [0.05, 0.12]}, "color": "blue"},
    },
    "layout": {
        "box": {"position": [1.5, 0.0, 0.15]},
        "seat": {"position": [-0.36, 1.4, 0.225]},
        "table": {"position": [0.75, -1.3, 0.4]},
        "cup": {"position": [0.7, -1.45, 0.86]},
    },
    "families": {
        "walker": {"kind": "avatar", "look": "body", "seed": 3, "do": [{"path": [[2.5, 0.0]], "gaze": "box"}]},
        "sitter": {
            "kind": "avatar",
            "look": "body",
            "seed": 5,
            "y": 1.4,
            "do": [{"clip": "sit", "gaze": "walker.head"}],
        },
        "reacher": {
            "kind": "avatar",
            "seed": 8,
            "y": -1.3,
            "do": [{"clip": "idle", "reach": [0.6, -1.45, 1.0], "gaze": "cup", "bend": 0.3}],
        },
        "talker": {
            "kind": "avatar",
            "seed": 11,
            "x": 1.6,
            "y": 1.5,
            "yaw": -2.6,
            "do": [{"clip": "talk", "gaze": "sitter.head"}],
            "look": "body",
        },
        "waver": {"kind": "avatar", "seed": 21, "x": 2.6, "y": -1.2, "yaw": 2.6, "do": ["wave"]},
    },
    "cameras": {
        name: {"from": place, "look_at": [0.9, 0.1, 0.8], "size": [480, 330], "channels": ["rgb"], "fov": 50}
        for name, place in CAMERAS.items()
    },
}


def run(engine: str, envs: int, world: dict[str, Any]) -> dict[str, Any]:
    steps = {"dt": 0.004, "control_dt": 0.02}
    return {"engine": engine, "num_envs": envs, "physics": steps, "world": world, "task": TASK}


def cost(engine: str, envs: int, people: int) -> float:
    """[ms] of processor time for a control step of all envs."""
    walk = {"kind": "avatar", "count": people, "do": [{"path": [[4.0, 0.0], [4.0, 4.0]]}]}
    with anysim.make(run(engine, envs, {"families": {"p": walk}} if people else {})) as env:
        env.reset(seed=0)
        action = np.zeros((envs, env.action_dim))
        for _ in range(20):
            env.step(action)
        began = time.process_time()
        for _ in range(STEPS):
            env.step(action)
        return (time.process_time() - began) / STEPS * 1e3


def page(engine: str) -> Image.Image:
    """Two views at each of the moments."""
    rows: list[Image.Image] = []
    with anysim.make(run(engine, 1, SCENE)) as env:
        env.reset(seed=0)
        for step in range(1, max(MOMENTS) + 1):
            env.step(np.zeros((1, env.action_dim)))
            if step in MOMENTS:
                rows.append(Image.fromarray(np.concatenate([env.engine.render(c)["rgb"][0] for c in CAMERAS], axis=1)))
    sheet = Image.new("RGB", (rows[0].width, sum(row.height for row in rows)))
    for number, row in enumerate(rows):
        sheet.paste(row, (0, number * row.height))
    return sheet


def main() -> None:
    parser = argparse.ArgumentParser(description="What avatars cost, and what they look like.")
    parser.add_argument("--engines", default="null,mujoco,pybullet,sapien")
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--pictures", type=Path, help="write avatars_ENGINE.jpg here instead of measuring")
    given = parser.parse_args()
    for engine in given.engines.split(","):
        if given.pictures is not None and engine == "null":  # it draws nothing
            continue
        if given.pictures is not None:
            page(engine).save(given.pictures / f"avatars_{engine}.jpg", quality=82)
        else:
            told = ", ".join(f"{people}: {cost(engine, given.envs, people):.1f} ms" for people in (0, 1, 5))
            print(f"{engine}, {given.envs} envs, a control step with avatars {told}", flush=True)


if __name__ == "__main__":
    main()
