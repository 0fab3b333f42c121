"""Lights and surroundings in all envs, engine-neutral: the contract keeps what is in force, an engine only draws it.

A surface of colour c with the normal n is drawn as c * (ambient + sum of emission * max(0, n . towards the light)).
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.model.world import Scenery, World

LIGHTS = ("light.direction", "light.position", "light.color", "light.intensity")
SURROUNDINGS = ("world.ambient", "world.background", "world.shadows")


class Look(NamedTuple):
    """What shines in one env, and on what.

    Attributes:
        direction: (L, 3) unit vectors, where the lights shine to.
        position: (L, 3) [m] of point lights.
        emission: (L, 3) colour times intensity.
        ambient: (3,) light from everywhere.
        background: (3,) colour where nothing is.
        sky: the background is the engine's own, which need not be of one colour.
        shadows: whether things cast shadows.
    """

    direction: Array
    position: Array
    emission: Array
    ambient: Array
    background: Array
    sky: bool
    shadows: bool


class Looks:
    """The parameters of `LIGHTS` and `SURROUNDINGS` of all envs (N, K, ...)."""

    def __init__(self, world: World, num_envs: int, own: Scenery) -> None:
        """`own` is what the engine draws where the World says nothing."""
        self._world = world
        lights, scenery = world.lights, world.scenery
        background = own.background if scenery.background is None else scenery.background
        ambient = own.ambient if scenery.ambient is None else scenery.ambient
        shadows = own.shadows if scenery.shadows is None else scenery.shadows
        self._defaults = {
            "light.direction": np.array([light.direction for light in lights], dtype=float).reshape(-1, 3),
            "light.position": np.array([x.position or (0.0, 0.0, 0.0) for x in lights], dtype=float).reshape(-1, 3),
            "light.color": np.array([light.color for light in lights], dtype=float).reshape(-1, 3),
            "light.intensity": np.array([light.intensity for light in lights], dtype=float),
            "world.ambient": np.array([ambient], dtype=float),
            "world.background": np.array([background], dtype=float),
            "world.shadows": np.array([float(bool(shadows))]),
        }
        self._values = {name: np.repeat(rows[None], num_envs, axis=0) for name, rows in self._defaults.items()}
        self._local = np.array([light.position is not None for light in lights], dtype=bool)

    def __contains__(self, name: object) -> bool:
        return name in self._defaults

    def get(self, name: str) -> Array:
        """All values (N, K, ...)."""
        return self._values[name].copy()

    def default(self, name: str) -> Array:
        """Values (K, ...) as built."""
        return self._defaults[name].copy()

    def set(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Write values (E, K, ...).

        Raises:
            EngineError: a direction of zero, or a place for a light that has none.
        """
        if name == "light.direction" and values.size and np.linalg.norm(values, axis=-1).min() < 1e-9:
            raise EngineError("a light needs a direction that is not zero")
        far = ~self._local[indices] if name == "light.position" else np.zeros(len(indices), dtype=bool)
        if values[:, far].any():
            light = self._world.lights[int(indices[far][0])].name
            raise EngineError(f"the light '{light}' shines from far away and has no place; give it a position")
        self._values[name][np.ix_(ids, indices)] = values

    def of(self, env: int) -> Look:
        """What an engine draws in an env."""
        v = self._values
        direction, background = v["light.direction"][env], v["world.background"][env, 0]
        own = self._world.scenery.background is None
        return Look(
            direction / np.linalg.norm(direction, axis=-1, keepdims=True) if len(direction) else direction,
            v["light.position"][env],
            v["light.color"][env] * v["light.intensity"][env][:, None],
            v["world.ambient"][env, 0],
            background,
            own and bool((background == self._defaults["world.background"][0]).all()),
            bool(v["world.shadows"][env, 0] > 0.5),
        )

    @property
    def world(self) -> World:
        """The World whose lights they are."""
        return self._world

    @property
    def local(self) -> Array:
        """(L,) bool: which lights have a place."""
        return self._local
