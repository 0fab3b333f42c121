"""Costs of soft matter: on the ground, with a ball on top."""

from collections.abc import Callable
from typing import Any

import mujoco

from anysim.task.env import TaskEnv
from anysim_soft.family import Soft

MATTER: dict[str, dict[str, Any]] = {
    "block": {"kind": "deformable", "box": [0.2, 0.2, 0.2], "points": [8, 8, 8]},
    "block of 27 cells": {"kind": "deformable", "box": [0.2, 0.2, 0.2], "points": [8, 8, 8], "cells": [3, 3, 3]},
    "rope": {"kind": "rope", "path": [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], "position": [0.0, 0.0, 0.01]},
    "towel 11x11": {"kind": "garment", "towel": [0.3, 0.3], "spacing": 0.03, "position": [0.0, 0.0, 0.01]},
    "towel 20x20": {"kind": "garment", "towel": [0.57, 0.57], "spacing": 0.03, "position": [0.0, 0.0, 0.01]},
    "cloth 20x20": {"kind": "fem_cloth", "size": [0.6, 0.6], "points": [20, 20], "position": [0.0, 0.0, 0.01]},
}
"""What is measured, by what it is called."""
HEIGHTS = {"deformable": 0.26, "rope": 0.09, "fem_cloth": 0.08, "garment": 0.08}
"""[m] of the ball's middle, by family."""


def world_of(called: str) -> dict[str, Any]:
    """Matter on the ground, and a ball that rests on it."""
    matter = MATTER[called]
    return {
        "objects": {"ball": {"source": {"sphere": 0.05}, "mass": 0.2}},
        "layout": {"ball": {"position": [0.0, 0.0, HEIGHTS[matter["kind"]]]}},
        "families": {"matter": matter},
    }


def solver_of(env: TaskEnv) -> Callable[[], object]:
    """What makes one physics step of MuJoCo alone, from what matter is like in the first env."""
    assert env.families is not None
    it = env.families.family("matter")
    assert isinstance(it, Soft)
    sub = it.sub_world(0)
    sub.load(it.state_row[0])
    return lambda: mujoco.mj_step(sub.model, sub.data, nstep=it.soft.substeps)
