"""PhysicsManager: what holds for a whole env in this episode: gravity."""

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.managers.base import Manager
from anysim.managers.overrides import Overridable, revert, written
from anysim.randomization.draw import draw_rows, is_random


class PhysicsManager(Manager):
    """Draws gravity where it is random and writes it as a parameter; a constant is in the World already."""

    name: ClassVar[str] = "physics"

    def parameters(self) -> Iterable[tuple[str, str]]:
        return [("world.gravity", "physics.gravity")] if is_random(self.spec.physics.gravity) else []

    def overridable(self) -> list[Overridable]:
        return written("physics", self.spec.physics, {"gravity": ("world.gravity",)})

    def override(self, path: str, value: Any, env_ids: Array) -> None:
        self.engine.set_parameters("world.gravity", np.tile(value, (len(env_ids), 1, 1)), env_ids)

    def revert(self, path: str, env_ids: Array) -> None:
        revert(self.engine, ["world.gravity"], env_ids, {"world": np.array([0])})

    def reset(self, env_ids: Array) -> None:
        gravity = self.spec.physics.gravity
        if is_random(gravity):
            rows = draw_rows(gravity, "physics/world/gravity", self.streams, env_ids, source="physics.gravity")
            self.engine.set_parameters("world.gravity", rows[:, None], env_ids)
