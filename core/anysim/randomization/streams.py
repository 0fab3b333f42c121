"""Random streams: one for each name, so that nothing else moves when one more thing is drawn.

A seed gives each env a master generator; each episode draws one 64-bit `episode_seed` from it. Everything random in
the episode is a draw from a stream named by its purpose (`layout/cube/x`) and keyed by (episode_seed, name, tick)
alone: a counter-based generator, so no stream has state, none depends on another, and an episode can be drawn again
from its `episode_seed`.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math.arrays import whole, wholes


@cache
def stream_key(name: str) -> int:
    """A 64-bit key of a stream's name, the same on every machine."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


_HIGHEST = np.nextafter(1.0, 0.0)
OVERRIDDEN = "overridden"
"""The stream of a value that was not drawn, but set for the episode when it began or went on."""


class Origin(NamedTuple):
    """Where a draw comes from: the name of its stream, and the dotted path of the value in the spec."""

    stream: str
    source: str = ""


class Narrowing(NamedTuple):
    """Draws from a part of a value's spread: `level` (N,) of it, grown from the quantile `around`."""

    level: Array
    around: float

    def of(self, env: int, quantiles: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """The quantiles of an env, drawn towards `around`; below 1 as they were."""
        share = float(self.level[env])
        return lambda shape: np.minimum(self.around + share * (quantiles(shape) - self.around), _HIGHEST)


def _master(entropy: Sequence[int]) -> np.random.Generator:
    """What draws the episode seeds of an env."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))


def episode_seed(seed: int, env: int, episode: int) -> int:
    """The seed of an env's episode, counted from 0, under a global seed."""
    master = _master([seed, env])
    return [_next_episode(master) for _ in range(episode + 1)][-1]


def _next_episode(master: np.random.Generator) -> int:
    return int(master.integers(0, 2**63))


def _plain(value: object) -> bool:
    """Whether it is of words, numbers, lists and mappings, as draws are."""
    if isinstance(value, Mapping):
        return all(isinstance(key, str) and _plain(item) for key, item in value.items())
    if isinstance(value, list | tuple):
        return all(map(_plain, value))
    return value is None or isinstance(value, bool | int | float | str | np.number | np.bool_)


class Streams:
    """The streams of all envs, and the draws of their current episodes.

    Attributes:
        episode_seed: (N,) uint64, what the current episode of each env was drawn from.
        draws: for each env, what was drawn in its current episode by name.
        origins: for each env, where each of its draws comes from, by the same names.
        overridden: for each env, the values that its current episode has instead of its draws, by dotted path.
        narrowed: of which part of their spread values are drawn, by their dotted path.
    """

    def __init__(self, num_envs: int, seed: int = 0) -> None:
        """`seed` is that of envs which are never given another."""
        self.num_envs = num_envs
        self.episode_seed = np.zeros(num_envs, dtype=np.uint64)
        self.draws: list[dict[str, object]] = [{} for _ in range(num_envs)]
        self.origins: list[dict[str, Origin]] = [{} for _ in range(num_envs)]
        self.overridden: list[dict[str, Any]] = [{} for _ in range(num_envs)]
        self.narrowed: dict[str, Narrowing] = {}
        self._turning = np.random.Generator(np.random.Philox(key=0))
        self._state: Any = {
            "bit_generator": "Philox",
            "buffer": np.zeros(4, dtype=np.uint64),
            "buffer_pos": 4,
            "has_uint32": 0,
            "uinteger": 0,
            "state": {"counter": np.zeros(4, dtype=np.uint64), "key": np.zeros(2, dtype=np.uint64)},
        }
        self._masters = [_master([seed, env]) for env in range(num_envs)]

    def seed(self, seed: int | Sequence[int], env_ids: Array) -> None:
        """Seed envs: an int seeds env i with (seed, i); a sequence gives one seed to each of `env_ids`."""
        several = isinstance(seed, Sequence) and not isinstance(seed, str | bytes)
        if several or (isinstance(seed, np.ndarray) and seed.ndim):
            entropies = [[s] for s in wholes("seed", seed, len(env_ids), TaskError)]
        else:
            one = whole("seed", seed, TaskError)
            entropies = [[one, int(i)] for i in env_ids]
        for env, entropy in zip(env_ids, entropies, strict=True):
            self._masters[env] = _master(entropy)

    def begin(self, env_ids: Array, episode_seeds: Sequence[int] | Array | None = None) -> None:
        """Start new episodes: draw their seeds, or take those given."""
        for row, env in enumerate(env_ids):
            drawn = _next_episode(self._masters[env]) if episode_seeds is None else int(episode_seeds[row])
            self.episode_seed[env] = drawn
            self.draws[env], self.origins[env], self.overridden[env] = {}, {}, {}

    def note(self, env: int, name: str, drawn: object, origin: Origin) -> None:
        """Keep what was drawn in an env's episode."""
        self.draws[env][name], self.origins[env][name] = drawn, origin

    def override(self, env: int, source: str, value: object) -> None:
        """Have `value` for what the spec says at `source` until the env's episode ends; draws of it give it."""
        self.overridden[env][source] = value

    def note_override(self, env: int, source: str) -> None:
        """Mark an override among the draws: under the names of what was drawn for it, or else under its path."""
        names = [name for name, origin in self.origins[env].items() if origin.source == source] or [source]
        for name in names:
            self.note(env, name, self.overridden[env][source], Origin(OVERRIDDEN, source))

    def skip(self, env: int, episodes: int) -> None:
        """Pass over the next episodes of an env, as if they had been begun."""
        for _ in range(episodes):
            self.begin(np.array([env]))

    def generator(self, env: int, name: str, tick: int = 0) -> np.random.Generator:
        """The stream `name` of an env's current episode at a control step; fresh at each call."""
        key = np.array([self.episode_seed[env], stream_key(name)], dtype=np.uint64)
        counter = np.array([0, 0, 0, tick], dtype=np.uint64)
        return np.random.Generator(np.random.Philox(key=key, counter=counter))

    def shared_generator(self, env: int, name: str, tick: int = 0) -> np.random.Generator:
        """What `generator(env, name, tick)` is, to be used at once: the next call of this takes it away.

        A new generator takes 20 us, and a reset draws from hundreds of streams; this one is turned to each of them.
        """
        words = self._state["state"]
        words["key"][0], words["key"][1], words["counter"][3] = self.episode_seed[env], stream_key(name), tick
        self._turning.bit_generator.state = self._state
        return self._turning

    def snapshot(self, env_ids: Array) -> dict[str, object]:
        """Both levels of randomness of envs, as plain data."""
        masters = [self._masters[i] for i in env_ids]
        return {
            "episode_seed": [int(self.episode_seed[i]) for i in env_ids],
            "draws": [dict(self.draws[i]) for i in env_ids],
            "origins": [{name: tuple(origin) for name, origin in self.origins[i].items()} for i in env_ids],
            "overridden": [dict(self.overridden[i]) for i in env_ids],
            "masters": [master.bit_generator.state for master in masters],
        }

    @staticmethod
    def fault(data: object, envs: int) -> str:
        """Why `restore` could not go on from data that may come from a file; empty if it can."""
        kinds = {"episode_seed": int, "draws": Mapping, "origins": Mapping, "overridden": Mapping, "masters": Mapping}
        if not isinstance(data, Mapping) or data.keys() != kinds.keys():
            return f"they should hold {', '.join(kinds)}"
        for name, kind in kinds.items():
            rows = data[name]
            if not isinstance(rows, list) or len(rows) != envs:
                return f"'{name}' should be a list of {envs}"
            if not all(isinstance(row, kind) and not isinstance(row, bool) for row in rows):
                return f"'{name}' should hold a {kind.__name__} for each env"
        if not all(0 <= seed < 1 << 64 for seed in data["episode_seed"]):
            return "'episode_seed' has 64 bits"
        for draws, origins, overridden in zip(data["draws"], data["origins"], data["overridden"], strict=True):
            if draws.keys() != origins.keys():
                return "'draws' and 'origins' should have the same names"
            for origin in origins.values():
                if not isinstance(origin, tuple) or len(origin) != 2 or not all(isinstance(w, str) for w in origin):
                    return "'origins' should hold pairs of words"
            if not all(_plain(value) for value in (*draws.values(), *overridden.values())):
                return "'draws' and 'overridden' should hold words, numbers, and lists and mappings of them"
        for state in data["masters"]:
            generator = np.random.PCG64()
            try:
                generator.state = state
            except (ValueError, TypeError, KeyError, OverflowError):
                return "'masters' should hold states of PCG64"
            if generator.state != state:
                return "'masters' should hold states of PCG64"
        return ""

    def restore(self, env_ids: Array, data: Mapping[str, Any]) -> None:
        """Write what `snapshot` returned."""
        masters = data["masters"]
        for row, env in enumerate(env_ids):
            self.episode_seed[env] = data["episode_seed"][row]
            self.draws[env], self.overridden[env] = dict(data["draws"][row]), dict(data["overridden"][row])
            self.origins[env] = {name: Origin(*origin) for name, origin in data["origins"][row].items()}
            self._masters[env] = np.random.Generator(np.random.PCG64())
            self._masters[env].bit_generator.state = masters[row]
