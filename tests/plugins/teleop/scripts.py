"""Scripts that solve pick_cube: from where things are after a reset, as a person would see it."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

import anysim
from anysim.math import pose as P
from anysim.task.env import TaskEnv

SPEED = 0.2
CONTROL_DT = 0.02


def pick_moves(env: TaskEnv) -> list[dict[str, Any]]:
    """Over the cube, down, close, and with it to the goal."""
    tool, cube = env.scene.frame("panda.tool").pose[0], env.scene.frame("cube").pose[0]
    goal = env.scene.frame("goal").pose[0]
    moves: list[dict[str, Any]] = []

    def go(way: np.ndarray, angle: float = 0.0) -> None:
        steps = int(np.ceil(max(np.linalg.norm(way) / SPEED, abs(angle)) / CONTROL_DT))
        seconds = steps * CONTROL_DT
        moves.append(
            {"for": seconds, "linear": [float(x) for x in way / seconds], "angular": [0.0, 0.0, float(angle / seconds)]}
        )

    facing = P.rotate(tool[None, 3:], np.array([[0.0, 1.0, 0.0]]))[0]
    side = P.rotate(cube[None, 3:], np.array([[1.0, 0.0, 0.0]]))[0]
    angle = np.arctan2(side[1], side[0]) - np.arctan2(facing[1], facing[0])
    angle = (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4  # a cube has four sides
    above = cube[:3] + np.array([0.0, 0.0, 0.1])
    go(above - tool[:3], angle)
    moves.append({"for": 0.3})
    go(cube[:3] - above)
    moves.append({"for": 0.3})
    moves.append({"for": 0.6, "gripper": "close"})
    go(goal[:3] - cube[:3])
    moves.append({"for": 1.0})
    return moves


def write_pick(path: Path, engine: str = "mujoco", seed: int = 0, cut: int | None = None) -> Path:
    """The script for episode 0 of a seed; `cut` keeps its first moves only."""
    with anysim.make("pick_cube", engine=engine, num_envs=1) as env:
        env.reset(seed=seed)
        env.scene.look(None)
        path.write_text(yaml.safe_dump({"moves": pick_moves(env)[:cut]}, sort_keys=False))
    return path
