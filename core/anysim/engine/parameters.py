"""The physical and visual parameters that can be changed per env, by neutral name."""

from collections.abc import Mapping
from typing import NamedTuple

from anysim.world.model import World


class Parameter(NamedTuple):
    """`target` is the list of the World it belongs to, `shape` the shape of one value."""

    name: str
    target: str
    shape: tuple[int, ...]
    unit: str
    minimum: float | None = None


_ALL = (
    Parameter("body.mass", "bodies", (), "kg", 0.0),
    Parameter("body.com", "bodies", (3,), "m, body frame"),
    Parameter("body.inertia", "bodies", (6,), "kg m^2 about the centre of mass: xx yy zz xy xz yz, body axes"),
    Parameter("geom.friction", "geoms", (), "1", 0.0),
    Parameter("geom.color", "geoms", (4,), "red green blue alpha", 0.0),
    Parameter("joint.damping", "joints", (), "N m s/rad or N s/m", 0.0),
    Parameter("joint.friction", "joints", (), "N m or N", 0.0),
    Parameter("joint.armature", "joints", (), "kg m^2 or kg", 0.0),
    Parameter("actuator.kp", "actuators", (), "N m/rad or N/m", 0.0),
    Parameter("actuator.kd", "actuators", (), "N m s/rad or N s/m", 0.0),
    Parameter("actuator.effort_limit", "actuators", (), "N m or N", 0.0),
    Parameter("world.gravity", "world", (3,), "m/s^2"),
    # lights and surroundings: see anysim.engine.looks
    Parameter("light.direction", "lights", (3,), "where it shines to, world axes"),
    Parameter("light.position", "lights", (3,), "m, of point lights"),
    Parameter("light.color", "lights", (3,), "red green blue", 0.0),
    Parameter("light.intensity", "lights", (), "1 lights a white surface fully", 0.0),
    Parameter("world.ambient", "world", (3,), "red green blue of the light from everywhere", 0.0),
    Parameter("world.background", "world", (3,), "red green blue where nothing is", 0.0),
    Parameter("world.shadows", "world", (), "1 where things cast shadows, else 0", 0.0),
)
PARAMETERS: Mapping[str, Parameter] = {p.name: p for p in _ALL}
"""Every parameter the contract knows; an engine declares which of them it can change."""


def count(parameter: Parameter, world: World) -> int:
    """How many values of this parameter a world has."""
    return 1 if parameter.target == "world" else len(getattr(world, parameter.target))
