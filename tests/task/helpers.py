"""Small worlds and tasks for tests of the runtime: they run on the kinematic engine in milliseconds."""

from typing import Any

import anysim
from anysim.task.env import TaskEnv

BLOCKS: dict[str, Any] = {
    "engine": "null",
    "world": {
        "name": "blocks",
        "objects": {
            "table": {"source": {"box": [1.0, 1.0, 0.4]}, "fixed": True},
            "red": {
                "source": {"box": [0.05, 0.05, 0.05]},
                "mass": {"range": [0.1, 0.4]},
                "friction": {"normal": {"mean": 0.8, "std": 0.1, "low": 0.2}},
                "color": {"choice": ["red", "blue"]},
            },
            "ball": {"source": {"sphere": 0.03}, "mass": 0.2},
        },
        "layout": {
            "table": {"position": [0.0, 0.0, 0.2]},
            "red": {
                "on": "table",
                "x": {"range": [-0.4, 0.4]},
                "y": {"range": [-0.4, 0.4]},
                "yaw": {"range": [-3.0, 3.0]},
            },
            "ball": {"on": "table", "x": {"range": [-0.4, 0.4]}, "y": {"range": [-0.4, 0.4]}, "clearance": 0.05},
        },
        "cameras": {"eye": {"from": [1.0, 1.0, 1.5], "look_at": "red", "channels": []}},
    },
    "task": {
        "horizon": 8,
        "command": {"goal": {"term": "goal_above", "surface": "table", "height": {"range": [0.1, 0.3]}}},
        "observations": {
            "policy": [{"term": "frame_pose", "frame": "red"}, {"term": "goal_position", "goal": "goal"}],
            "privileged": [{"term": "offset", "a": "red", "b": "ball"}],
        },
        "rewards": {"close": {"term": "distance", "a": "red", "b": "goal", "weight": -1.0}},
        "success": {"there": {"term": "near", "a": "red", "b": "goal", "tolerance": 0.02}},
        "failure": {"fell": {"term": "below", "frame": "red", "height": 0.1}},
    },
}


BLIND = ("record.cameras=[]", "world.cameras.front.channels=[]", "world.cameras.wrist.channels=[]")
"""The kinematic engine does not draw."""


def blocks(num_envs: int = 1, *overrides: str) -> TaskEnv:
    """The blocks task on the kinematic engine. Without robots its action has no components."""
    return anysim.make(BLOCKS, num_envs=num_envs, overrides=overrides, curriculum=True)


def arm(num_envs: int = 1, *overrides: str, engine: str = "null") -> TaskEnv:
    """pick_cube without cameras, by default on the kinematic engine."""
    return anysim.make("pick_cube", engine=engine, num_envs=num_envs, overrides=[*BLIND, *overrides], curriculum=True)
