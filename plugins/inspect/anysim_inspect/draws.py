"""Draws of an episode: every value, its stream, and the line of YAML that asks for it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from anysim.api import blind_env, compile_world, load, place_of, watched
from anysim.randomization.streams import episode_seed
from anysim_schemas.load import LoadedRun, LoadedSpec


class Draw(NamedTuple):
    """One draw of an episode.

    Attributes:
        name: the name under which recordings keep it; `@n` is step n. Of a layout's attempts
            only what holds is kept.
        value: what was drawn.
        stream: the stream it was drawn from; `shared/NAME` where fields share a draw, `…/ratio` where a ratio left the
            nominal value.
        path: dotted path of the value in the spec.
        where: `file:line:column` of it.
    """

    name: str
    value: Any
    stream: str
    path: str
    where: str


class Explanation(NamedTuple):
    """The draws of one episode, in the order of the reset, and the seed that gives it again."""

    seed: int
    episode_seed: int
    draws: tuple[Draw, ...]


def explain(
    source: str | Path | LoadedRun | Mapping[str, Any],
    *,
    seed: int | None = None,
    env: int = 0,
    episode: int = 0,
    overrides: Sequence[str] = (),
) -> Explanation:
    """The draws of episode `episode` (counted from 0) of env `env` under a global seed, by default the file's.

    A world needs no task for that.

    Draws depend on the seed, the env and the names of streams alone, so no engine is needed: the reset runs on the
    kinematic one, with a single env.
    """
    loaded = watched(source if isinstance(source, LoadedSpec) else load(source, overrides=overrides))
    seed = loaded.spec.seed if seed is None else seed
    chosen = episode_seed(seed, env, episode)
    with blind_env(loaded, compile_world(loaded), "explain") as one:
        one.reset(episode_seeds=[chosen])
        values, origins = one.streams.draws[0], one.streams.origins[0]
    draws = [
        Draw(name, value, origins[name].stream, origins[name].source, place_of(loaded, origins[name].source))
        for name, value in values.items()
    ]
    return Explanation(seed, chosen, tuple(draws))
