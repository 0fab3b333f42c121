"""Costs of soft matter: on the ground, with a ball on top."""

from typing import Any

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
