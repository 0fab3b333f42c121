"""The numbers of a place: streams by the name of the object and of the field, one tick an attempt; or the middles.

What is drawn for an attempt that comes to nothing leaves no trace; what holds is kept under the name of its stream.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.randomization.distributions import nominal, weighted
from anysim.randomization.draw import draw
from anysim.randomization.streams import Origin, Streams

SPREAD = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
"""Steps of an even sequence in the unit cube (the powers of the inverse of the root of x^4 = x + 1)."""


class PlacementSampler(ABC):
    """The numbers of one attempt at an object's place."""

    @abstractmethod
    def value(self, field: str, value: Any) -> Any:
        """A field of the entry, drawn."""

    @abstractmethod
    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        """Numbers in [0, 1) for one purpose."""

    def keep(self) -> None:
        """Note what was drawn: it is what holds."""


class NominalSampler(PlacementSampler):
    """The middle of what may be drawn, for the World and for the episodes in which nothing is drawn."""

    def __init__(self, number: int) -> None:
        """`number` tells objects apart that go anywhere on one support: they are spread over it."""
        self._number = number

    def value(self, field: str, value: Any) -> Any:
        """The nominal value."""
        del field
        return nominal(value)

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        """The first resting pose, else a point of a sequence that fills the unit cube evenly, its middle first."""
        if purpose == "rest":
            return (0.0,) * count
        return tuple((0.5 + self._number * step) % 1.0 for step in SPREAD[:count])


class EpisodeSampler(PlacementSampler):
    """Draws from the streams of an env's episode."""

    def __init__(
        self, streams: Streams, env: int, name: str, path: str, tick: int, inherited: Mapping[str, str] | None = None
    ) -> None:
        """`name` is the object's, `path` its entry's; `inherited` has the paths of fields said elsewhere."""
        self._streams, self._env, self._name, self._path, self._tick = streams, env, name, path, tick
        self._inherited = inherited or {}
        self._aside = _Aside(streams)

    def value(self, field: str, value: Any) -> Any:
        source = self._inherited.get(field, f"{self._path}.{field}")
        return draw(value, f"layout/{self._name}/{field}", self._aside, self._env, self._tick, source=source)

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        stream = f"layout/{self._name}/{purpose}"
        drawn = tuple(float(u) for u in self._streams.shared_generator(self._env, stream, self._tick).random(count))
        self._aside.note(self._env, stream, drawn if count > 1 else drawn[0], Origin(stream, self._path))
        return drawn

    def pick(self, purpose: str, weights: Sequence[float]) -> int:
        """One of several by its weight; what is kept is its number."""
        number = weighted(weights, self.uniform(purpose, 1)[0])
        stream = f"layout/{self._name}/{purpose}"
        self._aside.note(self._env, stream, number, Origin(stream, f"{self._path}.{purpose}"))
        return number

    def keep(self) -> None:
        for name, (drawn, origin) in self._aside.noted.items():
            self._streams.note(self._env, name, drawn, origin)


class _Aside(Streams):
    """Streams whose notes are put aside."""

    def __init__(self, streams: Streams) -> None:
        self._of, self.overridden, self.narrowed = streams, streams.overridden, streams.narrowed
        self.noted: dict[str, tuple[object, Origin]] = {}

    def generator(self, env: int, name: str, tick: int = 0) -> np.random.Generator:
        return self._of.generator(env, name, tick)

    def shared_generator(self, env: int, name: str, tick: int = 0) -> np.random.Generator:
        return self._of.shared_generator(env, name, tick)

    def note(self, env: int, name: str, drawn: object, origin: Origin) -> None:
        del env
        self.noted[name.partition("@")[0]] = (drawn, origin)
