"""The physical and visual parameters that can be changed per env, by neutral name, and a table of their values."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.lighting import SURROUNDINGS, Looks
from anysim.errors import EngineError, listing
from anysim.model.world import BodyKind, Scenery, World


class Parameter(NamedTuple):
    """`target` is the list of the World it belongs to, `shape` the shape of one value.

    `index_of` names the list of the World of which it is an index, -1 for none; `loose` says that it is one of free
    bodies without links, and 0 of all others.
    """

    name: str
    target: str
    shape: tuple[int, ...]
    unit: str
    minimum: float | None = None
    below: float | None = None
    index_of: str = ""
    loose: bool = False


_ALL = (
    Parameter("body.mass", "bodies", (), "kg", 0.0),
    Parameter("body.com", "bodies", (3,), "m, body frame"),
    Parameter("body.inertia", "bodies", (6,), "kg m^2 about the centre of mass: xx yy zz xy xz yz, body axes"),
    Parameter("body.linear_damping", "bodies", (), "1/s", 0.0, loose=True),
    Parameter("body.angular_damping", "bodies", (), "1/s", 0.0, loose=True),
    Parameter("geom.friction", "geoms", (), "1", 0.0),
    Parameter("geom.restitution", "geoms", (), "1", 0.0, 1.0),
    Parameter("geom.color", "geoms", (4,), "red green blue alpha", 0.0),
    Parameter("geom.texture", "geoms", (), "index into World.textures", -1.0, index_of="textures"),
    Parameter("geom.material", "geoms", (), "index into World.materials", -1.0, index_of="materials"),
    Parameter("joint.damping", "joints", (), "N m s/rad or N s/m", 0.0),
    Parameter("joint.friction", "joints", (), "N m or N", 0.0),
    Parameter("joint.armature", "joints", (), "kg m^2 or kg", 0.0),
    Parameter("actuator.kp", "actuators", (), "N m/rad or N/m", 0.0),
    Parameter("actuator.kd", "actuators", (), "N m s/rad or N s/m", 0.0),
    Parameter("actuator.effort_limit", "actuators", (), "N m or N", 0.0),
    Parameter("world.gravity", "world", (3,), "m/s^2"),
    # lights and surroundings: see anysim.engine.lighting
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

APPEARANCE = frozenset(
    name
    for name, parameter in PARAMETERS.items()
    if parameter.target == "lights" or name in ("geom.color", "geom.texture", "geom.material", *SURROUNDINGS)
)
"""Those that are seen in images and nowhere else."""


def count(parameter: Parameter, world: World) -> int:
    """How many values of this parameter a world has."""
    return 1 if parameter.target == "world" else len(getattr(world, parameter.target))


def nominal(name: str, world: World) -> Array:
    """The values (K, ...) of a parameter that the World gives, float64."""
    bodies, geoms, joints, actuators = world.bodies, world.geoms, world.joints, world.actuators
    table: Mapping[str, Callable[[], Any]] = {
        "body.mass": lambda: [b.inertial.mass for b in bodies],
        "body.com": lambda: [b.inertial.com for b in bodies],
        "body.inertia": lambda: [b.inertial.inertia for b in bodies],
        "body.linear_damping": lambda: [b.damping[0] for b in bodies],
        "body.angular_damping": lambda: [b.damping[1] for b in bodies],
        "geom.friction": lambda: [g.surface.friction for g in geoms],
        "geom.restitution": lambda: [g.surface.restitution for g in geoms],
        "geom.color": lambda: [g.color for g in geoms],
        "geom.texture": lambda: world.geom_texture,
        "geom.material": lambda: world.geom_material,
        "joint.damping": lambda: [j.damping for j in joints],
        "joint.friction": lambda: [j.friction for j in joints],
        "joint.armature": lambda: [j.armature for j in joints],
        "actuator.kp": lambda: [a.kp for a in actuators],
        "actuator.kd": lambda: [a.kd for a in actuators],
        "actuator.effort_limit": lambda: [a.effort_limit for a in actuators],
        "world.gravity": lambda: [world.physics.gravity],
    }
    return np.array(table[name](), dtype=np.float64).reshape(-1, *PARAMETERS[name].shape)


def check_values(parameter: Parameter, world: World, rows: Array, which: Array) -> None:
    """Refuse values (E, K, ...) that the parameter cannot have, whatever the engine.

    Raises:
        EngineError: out of bounds, no index of the World's, or for a body that it does not apply to.
    """
    name, unit = parameter.name, parameter.unit
    if not rows.size:
        return
    if parameter.minimum is not None and rows.min() < parameter.minimum:
        raise EngineError(f"{name} [{unit}] must be at least {parameter.minimum:g}, got {rows.min():g}")
    if parameter.below is not None and rows.max() >= parameter.below:
        raise EngineError(f"{name} [{unit}] must be below {parameter.below:g}, got {rows.max():g}")
    if parameter.index_of:
        things = getattr(world, parameter.index_of)
        if (rows != np.floor(rows)).any() or rows.max() >= len(things):
            names = listing(f"{i} {thing.name}" for i, thing in enumerate(things))
            worst = rows[(rows != np.floor(rows)) | (rows >= len(things))][0]
            raise EngineError(f"{name} is an {unit} or -1, got {worst:g} ({parameter.index_of}: {names})")
    if parameter.loose:
        wrong = np.flatnonzero((rows != 0).any(axis=0) & ~world.loose[which])
        if len(wrong):
            body = world.bodies[which[wrong[0]]]
            raise EngineError(
                f"{name} is for free bodies without links, and '{body.name}' is "
                f"{'fixed' if body.kind is BodyKind.STATIC else 'part of an articulation'}; joints have joint.damping"
            )


UNSEEN = Scenery(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), shadows=False)
"""Surroundings of an engine that does not draw."""


class ParameterTable:
    """Values in all envs as they were asked for; what is given to a library, and what it made of it, a backend adds.

    Attributes:
        values: arrays (N, K, ...) of all but `looks`; views where something else uses them, such as a drive law.
        looks: lights and surroundings, of which a library learns when it draws.
    """

    def __init__(
        self, world: World, num_envs: int, own: Scenery = UNSEEN, kept: Mapping[str, Array] | None = None
    ) -> None:
        """`own` is what the engine draws where the World says nothing, `kept` the arrays that are made already."""
        self.world, self.looks = world, Looks(world, num_envs, own)
        self._built = {name: nominal(name, world) for name in PARAMETERS if name not in self.looks}
        made = {name: np.repeat(rows[None], num_envs, axis=0) for name, rows in self._built.items()}
        self.values: dict[str, Array] = made | dict(kept or {})

    def get(self, name: str) -> Array:
        """All values (N, K, ...), a copy."""
        if name in self.looks:
            return self.looks.get(name)
        values = self.values[name].copy()
        self.read(name, values)
        return values

    def default(self, name: str) -> Array:
        """Values (K, ...) as built, a copy."""
        return self.looks.default(name) if name in self.looks else self._built[name].copy()

    def changed(self, name: str, env: int) -> bool:
        """Whether an env has other values than those of the World."""
        return not np.array_equal(self.values[name][env], self._built[name])

    def set(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...). What the library refuses is taken back."""
        self.check(name, values, indices)
        if name in self.looks:
            self.looks.set(name, values, ids, indices)
            return
        before = self.values[name][ids]
        self.values[name][np.ix_(ids, indices)] = values
        try:
            self.push(name, ids, indices)
        except BaseException:
            self.values[name][ids] = before
            self.push(name, ids, indices)
            raise

    def check(self, name: str, values: Array, indices: Array) -> None:
        """Refuse values (E, K, ...) that the library cannot take, before anything is written."""

    def push(self, name: str, ids: Array, indices: Array) -> None:
        """Give the library what is in force for these things of these envs."""

    def read(self, name: str, values: Array) -> None:
        """Overwrite what was asked for (N, K, ...) by what the library has."""
