"""Banks of the cube of `pick_cube` and of a drawer's handle, written by hand."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from anysim.api import compile_world
from anysim.math import pose as P
from anysim.model.affordance_lookup import asset_hash
from anysim.model.frames import find_frame
from anysim.skills.bank import Bank

DOWN = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
"""At the cube's middle, from above."""


def tilted(pose: np.ndarray, angle: float) -> np.ndarray:
    """A tool pose turned about its own y, along which fingers close."""
    return np.concatenate(
        [pose[:3], P.multiply(pose[3:], P.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(angle)))]
    )


def shifted(pose: np.ndarray, *offset: float) -> np.ndarray:
    """A tool pose elsewhere [m]."""
    return pose + np.array([*offset, 0.0, 0.0, 0.0, 0.0])


def cube_bank(*poses: np.ndarray, asset: str = "", stroke: float = 0.08) -> Bank:
    """These grasps of the cube, of falling margins."""
    world = compile_world("pick_cube")
    cube = world.entities[world.entity_numbers["cube"]]
    return _bank("cube", "body", asset or asset_hash(world, cube, cube.root), poses, 0.04, {"stroke": stroke})


def handle_bank(*poses: np.ndarray, part: str = "drawer_1") -> Bank:
    """Grasps of the handle of a part of the cabinet of `open_drawer`, in its handle's frame, of falling margins."""
    world = compile_world("open_drawer")
    cabinet = world.entities[world.entity_numbers["cabinet"]]
    body = next(b for b, one in enumerate(world.bodies) if one.name == f"cabinet.{part}")
    frame = find_frame(world, f"cabinet.{part}.handle")
    at = np.array([*frame.position, *frame.quaternion])
    about = {"stroke": 0.08, "link": body - cabinet.body_start}
    placed = [P.compose(at, pose) for pose in poses]
    return _bank("cabinet", f"{part}.handle", asset_hash(world, cabinet, body), placed, 0.016, about)


def _bank(asset: str, affordance: str, own: str, poses: Sequence[np.ndarray], width: float, about: Any) -> Bank:
    n = len(poses)
    passed = {e: np.ones(n, dtype=bool) for e in ("mujoco 3", "pybullet 3", "sapien 3")}
    margin, kind = np.arange(n, 0, -1.0) + 1.0, ("box",) * n
    return Bank(asset, affordance, "hand", own, "g", np.stack(poses), np.full(n, width), kind, margin, passed, about)


def written(folder: Path, bank: Bank, name: str = "bank.json") -> Path:
    """Its file."""
    path = folder / name
    path.write_text(json.dumps(bank.document()))
    return path


def task(folder: Path, of: str = "pick_cube", **expert: str) -> Path:
    """A file in this folder with a task, whose expert is given these parameters from line 4 on."""
    lines = [f"extends: task:{of}", "task:", "  expert:", *(f"    {key}: {value}" for key, value in expert.items())]
    path = folder / f"{of}.yaml"
    path.write_text("\n".join([*lines, ""]))
    return path


def badly_chosen() -> Bank:
    """Eight grasps that close 6 cm over the cube, then the same at its middle: as of a shape whose origin was moved."""
    good = [tilted(DOWN, angle) for angle in np.linspace(-0.35, 0.35, 8)]
    return replace(cube_bank(*(shifted(pose, 0.0, 0.0, 0.06) for pose in good), *good), margin=np.repeat([4.0, 3.0], 8))


if __name__ == "__main__":
    written(Path(__file__).parent / "worlds", badly_chosen(), "bad_grasps.json")
