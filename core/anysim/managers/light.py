"""LightManager: what shines in this episode, on what background."""

from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.managers.overrides import WORLD, Overridable, random_fields
from anysim.model.colors import rgb
from anysim.randomization.draw import draw, is_random

FIELDS = ("direction", "position", "color", "intensity")
SCENERY = ("background", "ambient", "shadows")


class LightManager(Manager):
    """Draws the random fields of lights and of the scenery, written as parameters; constants are in the World."""

    name: ClassVar[str] = "light"

    def _random(self) -> Iterator[tuple[str, str, str, Any, str]]:
        """Thing, field, parameter, value and path of what is random."""
        for light, spec in self.spec.world.lights.items():
            for field in FIELDS:
                value = getattr(spec, field)
                if is_random(value):
                    yield light, field, f"light.{field}", value, f"world.lights.{light}.{field}"
        for field in SCENERY:
            value = getattr(self.spec.world.scenery, field)
            if is_random(value):
                yield "", field, f"world.{field}", value, f"world.scenery.{field}"

    def parameters(self) -> Iterable[tuple[str, str]]:
        return [(parameter, path) for _, _, parameter, _, path in self._random()]

    def overridable(self) -> list[Overridable]:
        world = self.spec.world
        lights = [e for name, light in world.lights.items() for e in random_fields(f"{WORLD}lights.{name}", light)]
        return lights + random_fields(f"{WORLD}scenery", world.scenery)

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._index = {light.name: i for i, light in enumerate(engine.world.lights)}

    def reset(self, env_ids: Array) -> None:
        for light, field, parameter, value, path in self._random():
            stream = f"light/{light}/{field}" if light else f"light/scenery.{field}"
            drawn = [draw(value, stream, self.streams, env, source=path) for env in env_ids.tolist()]
            if field in ("color", "background", "ambient"):
                drawn = [rgb(color) for color in drawn]
            rows = np.array(drawn, dtype=float)[:, None]
            self.engine.set_parameters(parameter, rows, env_ids, [self._index[light]] if light else None)
