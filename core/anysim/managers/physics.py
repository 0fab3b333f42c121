"""PhysicsManager: what holds for a whole env in this episode: gravity."""

from collections.abc import Iterable
from typing import ClassVar

from anysim.conventions import Array
from anysim.managers.base import Manager
from anysim.managers.values import draw_rows, is_random


class PhysicsManager(Manager):
    """Draws gravity where it is random and writes it as a parameter; a constant is in the World already."""

    name: ClassVar[str] = "physics"

    def parameters(self) -> Iterable[tuple[str, str]]:
        return [("world.gravity", "physics.gravity")] if is_random(self.spec.physics.gravity) else []

    def reset(self, env_ids: Array) -> None:
        gravity = self.spec.physics.gravity
        if is_random(gravity):
            rows = draw_rows(gravity, "physics/world/gravity", self.streams, env_ids, source="physics.gravity")
            self.engine.set_parameters("world.gravity", rows[:, None], env_ids)
