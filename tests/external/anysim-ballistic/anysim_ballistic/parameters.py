"""The values that can be changed per env, and the constants of motion that follow from them."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.model.world import World
from anysim_ballistic.motion import Constants

_TENSOR = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""Places of the six numbers of an inertia (xx yy zz xy xz yz) in its matrix."""


class Parameters:
    """The engine's only copy of masses, centres, inertias and gravity: what is read back is what moves the bodies."""

    NAMES: ClassVar[frozenset[str]] = frozenset({"body.mass", "body.com", "body.inertia", "world.gravity"})

    def __init__(self, world: World, num_envs: int, free: Array) -> None:
        self._names = [body.name for body in world.bodies]
        self._free = free
        weightless = [world.bodies[i].gravity_compensation for i in free]
        self._weight = np.where(weightless, 0.0, 1.0).reshape(-1, 1)
        bodies = [body.inertial for body in world.bodies]
        self.defaults: Mapping[str, Array] = {
            "body.mass": np.array([b.mass for b in bodies], dtype=np.float64),
            "body.com": np.array([b.com for b in bodies], dtype=np.float64).reshape(-1, 3),
            "body.inertia": np.array([b.inertia for b in bodies], dtype=np.float64).reshape(-1, 6),
            "world.gravity": np.array([world.physics.gravity], dtype=np.float64),
        }
        for name, values in self.defaults.items():
            self._check(name, values[None], np.arange(len(values)))
        self.values = {name: np.repeat(v[None], num_envs, axis=0) for name, v in self.defaults.items()}
        self._constants: Constants | None = None

    def write(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        """Values (E, K, ...) into envs and indices, all of them or none."""
        self._check(name, values, indices)
        self.values[name][np.ix_(ids, indices)] = values
        self._constants = None

    def constants(self) -> Constants:
        """Of all envs and the free bodies, made anew after a change."""
        if self._constants is None:
            v = {name: values[:, self._free] for name, values in self.values.items() if name != "world.gravity"}
            inertia = v["body.inertia"][..., _TENSOR]
            gravity = self.values["world.gravity"] * self._weight
            self._constants = Constants(v["body.mass"], v["body.com"], inertia, np.linalg.inv(inertia), gravity)
        return self._constants

    def _check(self, name: str, values: Array, indices: Array) -> None:
        """A free body needs mass and an inertia that can be inverted."""
        least = {"body.mass": lambda v: v, "body.inertia": lambda v: np.linalg.eigvalsh(v[..., _TENSOR])[..., 0]}
        if name not in least:
            return
        column = np.flatnonzero(np.isin(indices, self._free))
        wrong = (least[name](values[:, column]) <= 0.0).any(axis=0)
        if wrong.any():
            body = self._names[indices[column[wrong.argmax()]]]
            raise EngineError(f"ballistic: {name} of the free body '{body}' must be positive (definite); give it more")
