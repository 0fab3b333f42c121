"""A light task with everything that the runtime deals with: real engines run thousands of its steps in seconds.

A planar arm of two joints pushes a sliding block and a ball on the ground. Fields are drawn by every kind of value,
gated and shared ones among them, in layout, scene, robot, command and events of both kinds.
"""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

import anysim
from anysim.assets.catalogue import CatalogueEntry
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_schemas.load import load
from anysim_schemas.robot_model import RobotModelSpec

HERE = Path(__file__).parent
ARM = {
    "name": "two_link",
    "description": "a planar arm for tests",
    "source": f"file:{HERE / 'two_link.urdf'}",
    "license": "Apache-2.0",
    "license_source": "written for the tests",
    "category": "arm",
    "channels": {"arm": {"joints": ["shoulder", "elbow"], "gains": {"kp": 40, "kd": 4, "armature": 0.01}}},
    "tools": {"tool": {"link": "paddle", "position": [0.2, 0, 0]}},
}
SLIDE: dict[str, Any] = {
    "physics": {"dt": 0.005, "control_dt": 0.02},
    "world": {
        "name": "slide",
        "robots": {
            "arm": {
                "robot": "two_link", "position": [0, 0, 0.05], "home_noise": {"range": [0.0, 0.05]},
                "actions": {"arm": "joint_delta_position"},
            },
        },
        "objects": {
            "block": {
                "source": {"box": [0.08, 0.08, 0.08]},
                "mass": {"log_uniform": [0.1, 1.0]},
                "friction": {"range": [0.2, 1.0], "ratio": 0.7, "otherwise": 0.5},
                "color": {"choice": ["red", "green", "blue"]},
            },
            "ball": {
                "source": {"sphere": 0.04},
                "density": {"normal": {"mean": 800.0, "std": 200.0, "low": 200.0}},
                "friction": {"range": [0.3, 0.9], "shared": "slick"},
            },
        },
        "layout": {
            "block": {
                "on": "terrain", "x": {"range": [0.3, 0.4]}, "y": {"range": [0.08, 0.2]}, "yaw": {"range": [-3, 3]},
                "checked": False,  # a place that is taken is drawn again: that would tie it to what else is drawn
            },
            "ball": {"on": "terrain", "x": {"range": [0.3, 0.5]}, "y": {"range": [-0.3, -0.1]}, "clearance": 0.01},
        },
    },
    "task": {
        "horizon": 9,
        "command": {"goal": {"term": "goal_at", "position": {"range": [[0.3, 0.2, 0.04], [0.5, 0.4, 0.04]]}}},
        "observations": {
            "policy": ["joint_pos", "joint_vel", {"term": "frame_pose", "frame": "block"}, "last_action",
                       {"term": "goal_position", "goal": "goal"}],
            "privileged": [{"term": "frame_twist", "frame": "block"}, {"term": "frame_twist", "frame": "ball"}],
        },
        "rewards": {"close": {"term": "distance", "a": "block", "b": "goal", "weight": -1.0}, "smooth": "action_rate"},
        "success": {"there": {"term": "near", "a": "block", "b": "goal", "tolerance": 0.05}},
        "failure": {"fell": {"term": "below", "frame": "block", "height": -0.5}},
        "events": {
            "shove": {"term": "push", "object": "ball", "every": 3, "when": "step",
                      "force": {"normal": {"mean": [0.5, 0, 0], "std": [0.3, 0.3, 0]}}},
            "polish": {"term": "set_friction", "object": "ball", "friction": {"range": [0.2, 0.4], "shared": "slick"}},
        },
    },
}  # fmt: skip
BLOCKS_ONLY: dict[str, Any] = {
    **SLIDE,
    "world": {key: value for key, value in SLIDE["world"].items() if key != "robots"} | {"name": "blocks_only"},
    "task": SLIDE["task"]
    | {
        "horizon": 5,
        "on_success": "continue",
        "observations": {
            "policy": [{"term": "frame_pose", "frame": "block"}, {"term": "frame_twist", "frame": "ball"}]
        },
        "rewards": {"close": {"term": "distance", "a": "block", "b": "goal", "weight": -1.0}},
        "events": {"polish": SLIDE["task"]["events"]["polish"]},
    },
}
"""Without robots and actions."""

MIXED: dict[str, Any] = {
    **SLIDE,
    "physics": {**SLIDE["physics"], "gravity": {"range": [[0, 0, -12], [0, 0, -8]]}},
    "world": {
        **SLIDE["world"],
        "name": "mixed",
        "robots": {
            "arm": {
                **SLIDE["world"]["robots"]["arm"],
                "dynamics": {"kp_scale": {"range": [0.8, 1.2]}},
                "actions": {
                    "arm": {"controller": "joint_delta_position", "noise": {"normal": {"mean": 0.0, "std": 0.05}},
                            "delay": {"choice": [0, 1, 2]}},
                },
            },
        },
        "objects": {
            **SLIDE["world"]["objects"],
            "block": {
                **SLIDE["world"]["objects"]["block"],
                "source": {"choice": [{"box": [0.08, 0.08, 0.08]}, {"cylinder": [0.04, 0.06]}], "weights": [2, 1]},
            },
            "toy": {
                "source": {"choice": [{"sphere": 0.03}, {"box": [0.05, 0.05, 0.05]}]},
                "scale": {"choice": [0.8, 1.0]},
                "count": {"range": [0, 2]},
                "damping": {"linear": {"range": [0.0, 0.5]}},
            },
        },
        "layout": {
            **SLIDE["world"]["layout"],
            "toy": {"on": "terrain", "region": {"rectangle": [[-0.6, -0.6], [-0.2, 0.6]]}, "checked": False},
        },
    },
    "task": {
        **SLIDE["task"],
        "observations": {
            "policy": [*SLIDE["task"]["observations"]["policy"], {"term": "category_pose", "category": "toy"},
                       {"term": "joint_pos", "noise": {"normal": {"mean": 0.0, "std": 0.01}}, "delay": 1}],
            "privileged": [{"term": "category_present", "category": "toy"}],
        },
    },
}  # fmt: skip
"""Envs with different things in them: kinds, sizes and numbers, and a robot whose commands come late and rough."""

_RUB = {"term": "set_friction", "object": "block", "when": "step", "friction": {"range": [0.2, 0.9]}}
SPECS: Mapping[str, dict[str, Any]] = {"slide": SLIDE, "blocks_only": BLOCKS_ONLY, "mixed": MIXED}
"""Specs on which the properties of the runtime are tested; a new one is held to all of them."""
REAL = ("mujoco", "pybullet", "sapien")
ENGINES = ["null", *(pytest.param(name, marks=pytest.mark.slow) for name in REAL)]
"""The kinematic engine in every run, the real ones in the slow one."""


def changed(spec: Mapping[str, Any], *removed: str, **values: Any) -> dict[str, Any]:
    """A copy without the keys at some dotted paths, and with other values at others (`__` for a dot)."""
    tree = copy.deepcopy(dict(spec))
    for path, value in [*((path, None) for path in removed), *((p.replace("__", "."), v) for p, v in values.items())]:
        *way, last = path.split(".")
        holder = tree
        for key in way:
            holder = holder[key]
        if value is None:
            holder.pop(last)
        else:
            holder[last] = value
    return tree


def make(engine: str, num_envs: int, spec: Mapping[str, Any] = SLIDE, *, shards: int = 1) -> TaskEnv:
    """An env of a spec on an engine, whose robot need not be installed."""
    require_engine(engine)
    events = spec["task"]["events"]
    if engine == "null" and "shove" in events:  # nothing can be pushed there
        spec = {**spec, "task": spec["task"] | {"events": events | {"shove": _RUB}}}
    entry = CatalogueEntry(load(RobotModelSpec, dict(ARM)).spec, HERE / "two_link.yaml")
    with mock.patch("anysim.compile.robot.load_robot", return_value=entry):
        return anysim.make({**spec, "engine": {"name": engine, "shards": shards}}, num_envs=num_envs)
