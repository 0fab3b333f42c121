"""Where the numbers of a layout come from: streams by the name of the object and of the field, one tick an attempt.

What is drawn for an attempt that comes to nothing leaves no trace; what holds is kept under the name of its stream.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from anysim.placement.nominal import spread
from anysim.randomization.distributions import nominal
from anysim.randomization.draw import draw
from anysim.randomization.streams import Origin, Streams


class _Aside(Streams):
    """Streams whose notes are put aside."""

    def __init__(self, streams: Streams) -> None:
        self._of, self.overridden = streams, streams.overridden
        self.noted: dict[str, tuple[object, Origin]] = {}

    def generator(self, env: int, name: str, tick: int = 0) -> np.random.Generator:
        return self._of.generator(env, name, tick)

    def quantiles(self, env: int, name: str, tick: int = 0) -> Callable[..., Any]:
        return self._of.quantiles(env, name, tick)

    def note(self, env: int, name: str, drawn: object, origin: Origin) -> None:
        del env
        self.noted[name.partition("@")[0]] = (drawn, origin)


class Dice:
    """The numbers of one attempt at an object's place."""

    def __init__(
        self, streams: Streams, env: int, name: str, path: str, tick: int, inherited: Mapping[str, str] | None = None
    ) -> None:
        """`name` is the object's, `path` its entry's; `inherited` has the paths of fields said elsewhere."""
        self._streams, self._env, self._name, self._path, self._tick = streams, env, name, path, tick
        self._inherited = inherited or {}
        self._aside = _Aside(streams)

    def value(self, field: str, value: Any) -> Any:
        """A field of the entry, drawn."""
        source = self._inherited.get(field, f"{self._path}.{field}")
        return draw(value, f"layout/{self._name}/{field}", self._aside, self._env, self._tick, source=source)

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        """Numbers in [0, 1) for one purpose."""
        stream = f"layout/{self._name}/{purpose}"
        drawn = tuple(float(u) for u in self._streams.generator(self._env, stream, self._tick).random(count))
        self._aside.note(self._env, stream, drawn if count > 1 else drawn[0], Origin(stream, self._path))
        return drawn

    def pick(self, purpose: str, weights: Sequence[float]) -> int:
        """One of several by its weight; what is kept is its number."""
        edges = np.cumsum(weights) / np.sum(weights)
        number = min(int(np.searchsorted(edges, self.uniform(purpose, 1)[0], side="right")), len(weights) - 1)
        stream = f"layout/{self._name}/{purpose}"
        self._aside.note(self._env, stream, number, Origin(stream, f"{self._path}.{purpose}"))
        return number

    def keep(self) -> None:
        """Note what was drawn: it is what holds."""
        for name, (drawn, origin) in self._aside.noted.items():
            self._streams.note(self._env, name, drawn, origin)


class Middle:
    """The middle of what may be drawn, for the episodes in which nothing is."""

    def __init__(self, number: int) -> None:
        """`number` tells objects apart that go anywhere on one support: they are spread over it."""
        self._number = number

    def value(self, field: str, value: Any) -> Any:
        """The nominal value."""
        del field
        return nominal(value)

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        """The middle, or the next of an even sequence."""
        return (0.0,) * count if purpose == "rest" else spread(self._number, count)

    def keep(self) -> None:
        """Nothing was drawn."""
