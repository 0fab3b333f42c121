"""The lifecycle that every manager has, and what all managers of an env share.

    configure(spec, streams, episodes)  ->  build(world)  ->  parameters()  ->  bind(engine)  ->  reset(env_ids)
                              ->  snapshot(env_ids) / restore(env_ids, data)

A manager owns its slice of the state and nothing else; managers never call each other. What one of them decides and
others need stands in `Episodes`, where each array has one writer, or in the engine. `RESET_ORDER` is the one place that
says which manager comes before which.
"""

from abc import ABC
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import BaseModel

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Need
from anysim.engine.parameters import PARAMETERS
from anysim.errors import TaskError
from anysim.model.world import World
from anysim.randomization.draw import is_random
from anysim.randomization.streams import Streams
from anysim_schemas.run import RunSpec

WORLD = "world."

RESET_ORDER = (
    "curriculum",
    "terrain",
    "population",
    "robot",
    "layout",
    "scene",
    "parameters",
    "action",
    "families",
    "light",
    "camera",
    "capture",
    "sensors",
    "task",
)
"""How much of each spread is drawn from, then the ground, what is there, the robots, where things are around them and
what they are like, how their joints stand and what pulls at them, what drives hold, the families, the lights, the
cameras and sensors, and the task last, on the settled scene."""


class Overridable(NamedTuple):
    """A value of the spec that may be set for one episode.

    Attributes:
        source: dotted path in the spec, with `world.` where it is there.
        holder: the part of the spec that the value belongs to, which also says what values there may be.
        key: its key in the holder.
        parameters: what an engine must be able to change for it.
        midway: whether it can change in the middle of an episode.
    """

    source: str
    holder: BaseModel
    key: str
    parameters: tuple[str, ...] = ()
    midway: bool = False

    @property
    def path(self) -> str:
        """As users write it: `objects.cube.friction`."""
        return self.source.removeprefix(WORLD)


def drawn(source: str, holder: BaseModel, keys: Iterable[str]) -> list[Overridable]:
    """Keys of a part of the spec that are drawn at a reset alone, or constants that pass through `draw`.

    They need no code of their own: where a path is overridden, `anysim.randomization.draw.draw` gives that value
    instead, and no other draw moves.
    """
    return [Overridable(f"{source}.{key}", holder, key) for key in keys]


def random_fields(source: str, holder: BaseModel, keys: Iterable[str] | None = None) -> list[Overridable]:
    """Those keys of a part of the spec, or of all of them, that are drawn at a reset."""
    chosen = type(holder).model_fields if keys is None else keys
    return drawn(source, holder, [key for key in chosen if is_random(getattr(holder, key))])


class Episodes:
    """The present episodes of all envs, as several managers need to know them.

    Attributes:
        origin: (N, 3) [m] where an env's scene stands on the ground; the terrain manager writes it.
        bases: (N, 7) by robot, where a reset has put its base, if not where the World has it.
        elapsed: (N,) control steps since an env's reset; the env's loop writes it, and what follows.
        code: (N,) int8 the place of an env's word among those of `Status`: 0 while it runs, -1 before its first reset.
        succeeded: (N,) bool what was judged at an env's last step.
    """

    def __init__(self, num_envs: int) -> None:
        self.origin = np.zeros((num_envs, 3))
        self.bases: dict[str, Array] = {}
        self.elapsed = np.zeros(num_envs, dtype=np.int64)
        self.code = np.full(num_envs, -1, dtype=np.int8)
        self.succeeded = np.zeros(num_envs, dtype=bool)


class Manager(ABC):
    """Does nothing by itself; a subclass overrides the steps of the lifecycle that it needs."""

    name: ClassVar[str]
    spec: RunSpec
    streams: Streams
    episodes: Episodes
    engine: SimEngine
    located: Callable[[str], str] = str
    """A dotted path with the file, line and column of its key before it, where the spec came from a file."""

    def configure(self, spec: RunSpec, streams: Streams, episodes: Episodes | None = None) -> Self:
        """Take the spec; check what can be checked without a world. Managers of one env share streams and episodes."""
        self.spec = spec
        self.streams = streams
        self.episodes = Episodes(streams.num_envs) if episodes is None else episodes
        return self

    def build(self, world: World) -> None:
        """Prepare for a compiled World; names become indices here."""

    def parameters(self) -> Iterable[tuple[str, str]]:
        """What this run will change per env: (parameter, dotted path of the spec that asks for it).

        Names are those of `anysim.engine.parameters`. Asked after `build`; an engine that cannot change one of them is
        refused before it builds anything.
        """
        return ()

    def needs(self) -> Iterable[Need]:
        """What this run asks of an engine beyond what its World does; asked after `build`, too."""
        return ()

    def bind(self, engine: SimEngine) -> None:
        """The engine is live: allocate buffers."""
        self.engine = engine

    def recall(self, env: int, drawn: Mapping[str, Any]) -> None:
        """Before the reset that replays a recorded episode: what the record holds and no stream can give again."""

    def reset(self, env_ids: Array) -> None:
        """Write the initial state of these envs, from their streams; their `episodes.elapsed` is 0 already."""

    def overridable(self) -> Sequence[Overridable]:
        """The values of the spec that may be overridden for an episode."""
        return ()

    def override(self, path: str, value: Any, env_ids: Array) -> None:
        """Write one of `overridable` that can change midway, now, as if it had been drawn so."""
        raise TaskError(f"the manager '{self.name}' says that {path} can change midway, and has no `override` for it")

    def revert(self, path: str, env_ids: Array) -> None:
        """An episode in which `path` was overridden is over: what `reset` does not write anew is as built again."""

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the manager's own state, arrays with a leading env axis."""
        return {}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        """Raise SnapshotError for values that no env can have; names, types and shapes are those of `snapshot`."""

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned; the engine may still be where it was."""


def revert(engine: SimEngine, parameters: Iterable[str], env_ids: Array, indices: Mapping[str, Array]) -> None:
    """Give parameters the values back that the World gives; `indices` says where, by what a parameter belongs to."""
    for name in parameters:
        which = indices[PARAMETERS[name].target]
        if len(which):
            rows = engine.built_parameters(name)[which]
            engine.set_parameters(name, np.broadcast_to(rows, (len(env_ids), *rows.shape)), env_ids, which)
