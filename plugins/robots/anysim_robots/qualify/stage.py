"""The world that a robot is qualified in: alone, bolted down in empty space, or standing on a plane."""

from pathlib import Path
from typing import Any

from anysim.assets.catalogue import CatalogueEntry
from anysim.errors import AnysimError
from anysim_schemas.robot_model import RobotModelSpec

NAME = "robot"
"""What the robot is called in that world."""

ENDLESS = 10**9
"""Control steps: the episode ends when the qualification says so."""

FALLBACK = "joint_position"
"""The controller of a channel that the catalogue gives none."""


def controllers(spec: RobotModelSpec) -> dict[str, str]:
    """By channel the controller that it is qualified with: the catalogue's default, else joint positions."""
    return {name: "default" if channel.controllers else FALLBACK for name, channel in spec.channels.items()}


def stage(entry: CatalogueEntry, *, ground: bool | None = None) -> dict[str, Any]:
    """The run, as a file would say it: the robot with all its channels, and a task that asks for nothing.

    Args:
        entry: of the catalogue, or of a file.
        ground: whether there is a plane; where not given, for robots that are not bolted down.
    """
    spec = entry.spec
    plane = spec.base == "floating" if ground is None else ground
    return {
        "physics": {"dt": 0.002, "control_dt": 0.02},
        "world": {
            "name": spec.name,
            "terrain": "plane" if plane else "none",
            "robots": {NAME: {"robot": reference(entry), "actions": controllers(spec)}},
        },
        "task": {"horizon": ENDLESS, "observations": {"policy": ["last_action"]}},
    }


def reference(entry: CatalogueEntry) -> str:
    """How a world names the entry: by its name where that is this file's, else by the file."""
    from anysim.assets.catalogue import load_robot

    try:
        known = load_robot(entry.spec.name).file
    except AnysimError:
        return str(entry.file.resolve())
    return entry.spec.name if known == entry.file else str(entry.file.resolve())


def engines() -> list[str]:
    """Installed engines that can run here and move things by forces, sorted."""
    from anysim.engine.capability import Capability
    from anysim.engine.factory import runnable

    return list(runnable(Capability.DYNAMICS, Capability.ARTICULATIONS))


def is_file(name: str) -> bool:
    """Whether a robot is given by its YAML file and not by its name in the catalogue."""
    return name.endswith((".yaml", ".yml")) or Path(name).name != name
