"""Worlds in which families other than particles are measured: one of each, `matter`, with a ball that it meets."""

from typing import Any

BALL = {"source": {"sphere": 0.05}, "mass": 0.2}
OBJECTS: dict[str, dict[str, Any]] = {
    "rigid": {"source": {"box": [0.1, 0.1, 0.1]}},
    "articulation": {"source": {"procedural": "hinge_box"}},
    "rigid_instancer": {"source": {"sphere": 0.02}, "family": "rigid_instancer", "count": 100, "grid": [10, 10]},
}
"""What engines hold by themselves; the rest of the world is then the ball."""
FAMILIES: dict[str, dict[str, Any]] = {
    "deformable": {"box": [0.2, 0.2, 0.2], "points": [8, 8, 8]},
    "fem_cloth": {"size": [0.6, 0.6], "points": [20, 20], "position": [0.0, 0.0, 0.01]},
    "garment": {"towel": [0.3, 0.3], "spacing": 0.03, "position": [0.0, 0.0, 0.01]},
    "inflatable": {"radius": 0.1, "subdivisions": 2, "position": [0.0, 0.0, 0.005]},
    "rope": {"path": [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], "position": [0.0, 0.0, 0.01]},
    "magnet": {"dipoles": {"one": {"body": "ball", "moment": [0, 0, 0.2]}, "two": {"moment": [0, 0, 0.9]}}},
    "fire": {},
    "flow": {"speed": 1.0, "emission": 1e-3, "drag": {"ball": {"area": 0.008}}, "position": [-1.0, 0.0, 0.1]},
    "avatar": {"do": [{"path": [[2.0, 0.0], [2.0, 2.0]]}], "again": True, "x": 2.0},
}
"""What moves beside them."""
HEIGHTS = {"deformable": 0.26, "rope": 0.09, "fem_cloth": 0.08, "garment": 0.08, "inflatable": 0.28}
"""[m] of the ball's middle, by family; it lies on the ground beside others."""


def case_of(kind: str) -> dict[str, Any]:
    """The world with this family as `matter`."""
    place = [0.0, 0.0, HEIGHTS[kind]] if kind in HEIGHTS else [0.5, 0.0, 0.05]
    world: dict[str, Any] = {"objects": {"ball": BALL}, "layout": {"ball": {"position": place}}, "families": {}}
    if kind in OBJECTS:
        return {
            **world,
            "objects": {"ball": BALL, "matter": OBJECTS[kind]},
            "layout": {**world["layout"], "matter": {"position": [0.0, 0.0, 0.05]}},
        }
    return {**world, "families": {"matter": {"kind": kind, **FAMILIES[kind]}}}
