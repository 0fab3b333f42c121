"""Progress along a way: where a base is on it, when it has got stuck, and when the way is to be made anew."""

import numpy as np

from anysim.conventions import Array
from anysim_navigation.navmesh import length_of

OFF = 0.6
"""[m] beside the way from which on it is made anew."""
PATIENCE = 2.5
"""[s] without getting on, after which it is made anew, and the base recovers."""
GOT_ON = 0.05
"""[m] along the way that count as getting on."""
RECOVERY = 1.5
"""[s] that a recovery lasts; then the clock begins anew whatever it came to."""


def arcs_of(path: Array) -> Array:
    """(K,) [m] from the beginning of a way (K, 2) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])


def points_at(path: Array, arcs: Array, at: Array | float) -> Array:
    """(..., 2) the points of a way (K, 2) so far along it, `arcs` (K,) those of its own."""
    return np.stack([np.interp(at, arcs, path[:, k]) for k in (0, 1)], axis=-1)


class Progress:
    """A way (K, 2) and how far along it a base has come. Times are counted in ticks that the caller gives."""

    def __init__(self, path: Array) -> None:
        self.path = path
        self._arc = arcs_of(path)
        self.length = length_of(path)
        self.arc = self._best = 0.0
        self.off = 0.0
        """[m] beside the way."""
        self.idle = 0.0
        """[s] since it last got on."""
        self.recovering = 0.0
        """[s] that are left of a recovery."""

    def look(self, place: Array, elapsed: float) -> None:
        """The base is at a place (2,) after so many seconds."""
        begin, run = self.path[:-1], np.diff(self.path, axis=0)
        square = np.maximum((run**2).sum(axis=1), 1e-12)
        share = np.clip(((place - begin) * run).sum(axis=1) / square, 0.0, 1.0)
        off = np.hypot(*(begin + share[:, None] * run - place).T)
        arc = self._arc[:-1] + share * np.sqrt(square)
        # a way that comes back near itself: what lies a little further on goes before what lies far back
        choice = int(np.argmin(off + 0.2 * np.abs(arc - self.arc)))
        self.arc, self.off = float(arc[choice]), float(off[choice])
        if self.recovering > 0:
            self.recovering -= elapsed
            if self.recovering <= 1e-9:
                self.recovering, self.idle, self._best = 0.0, 0.0, self.arc
            return
        self.idle += elapsed
        if self.arc > self._best + GOT_ON:
            self._best, self.idle = self.arc, 0.0

    def recover(self) -> None:
        """Begin a recovery; it ends by itself."""
        self.recovering = RECOVERY

    @property
    def stale(self) -> bool:
        """Whether the way is to be made anew."""
        return self.off > OFF or self.idle > PATIENCE

    @property
    def left(self) -> float:
        """[m] to the end of the way."""
        return self.length - self.arc

    def ahead(self, distance: float) -> tuple[Array, Array]:
        """The way (K, 2) from here on, and the point (2,) of it so far ahead, or its end."""
        here, there = self._at(self.arc), self._at(min(self.arc + distance, self.length))
        later = self.path[self._arc > self.arc + 1e-9]
        return np.concatenate([here[None], later]), there

    def _at(self, arc: float) -> Array:
        return points_at(self.path, self._arc, arc)
