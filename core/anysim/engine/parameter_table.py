"""Values of the parameters of all envs, as they were asked for, for engines that give them to a library."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.lighting import Looks
from anysim.engine.parameters import PARAMETERS, nominal
from anysim.model.world import Scenery, World

UNSEEN = Scenery(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), shadows=False)
"""Surroundings of an engine that does not draw."""


class ParameterTable:
    """Reads and writes parameters by name; what is given to a library, and what it made of it, is a backend's to add.

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
