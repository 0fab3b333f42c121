"""A world that declares every sensor that looks, small enough for each test to build it."""

from math import pi
from typing import Any

SENSORS: dict[str, Any] = {
    "ring": {
        "sensor": "lidar",
        "frame": "rover",
        "pattern": {"kind": "planar", "columns": 90},
        "position": [0.0, 0.0, 0.15],
        "far": 8.0,
        "channels": ["range", "intensity", "instance_id", "class_id"],
        "noise": {"range": {"white": 0.001, "bias": {"normal": {"mean": 0, "std": 0.01}}}},
        "dropout": 0.2,
    },
    "petals": {
        "sensor": "lidar",
        "frame": "rover",
        "pattern": {"kind": "solid_state", "count": 50, "half_angle": 0.3},
        "position": [0.0, 0.0, 0.2],
        "far": 8.0,
        "rate": 25,
        "delay": {"choice": [0, 1]},
    },
    "ground": {"sensor": "heights", "frame": "rover", "spacing": 0.2, "noise": {"height": {"white": 0.002}}},
    "things": {"sensor": "heights", "frame": "rover", "source": "rays", "length": 4.8, "spacing": 0.2},
    "eye": {
        "sensor": "depth",
        "frame": "rover",
        "size": [24, 16],
        "far": 6.0,
        "position": [0.3, 0.0, 0.1],
        "roll_pitch_yaw": [-pi / 2, 0.0, -pi / 2],
        "channels": ["depth", "normals", "instance_id", "class_id", "motion", "appeared"],
    },
    "map": {"sensor": "occupancy", "frame": "rover", "low": 0.05, "high": 0.5, "cell": 0.2, "delay": 1},
}
OBJECTS: dict[str, Any] = {
    "crate": {"source": {"box": [0.4, 0.4, 0.4]}, "color": [1.0, 0.0, 0.0]},
    "ball": {"source": {"sphere": 0.2}, "label": "fruit", "color": [0.0, 1.0, 0.0]},
    "rover": {"source": {"box": [0.5, 0.3, 0.2]}},
}


def world(engine: str = "null", sensors: dict[str, Any] = SENSORS, **more: Any) -> dict[str, Any]:
    """A rover on a plane that looks at a crate and at a ball."""
    return {
        "engine": engine,
        "world": {
            "objects": OBJECTS,
            "layout": {
                "crate": {"on": "terrain", "x": 2.0, "y": 0.0},
                "ball": {"on": "terrain", "x": {"range": [0.6, 1.0]}, "y": 1.0},
                "rover": {"on": "terrain", "x": 0.0, "y": 0.0},
            },
            "sensors": sensors,
            **more,
        },
        "task": {"horizon": 200, "observations": {"policy": ["last_action"]}},
    }
