"""The lifecycle that every manager has.

    configure(spec, streams, board)  ->  build(world)  ->  parameters()  ->  bind(engine)  ->  reset(env_ids)
                              ->  before_step(...) / after_step()  ->  snapshot(env_ids) / restore(env_ids, data)

A manager owns its slice of the state and nothing else; managers never call each other. What one of them decides and
others need stands on the `Board`, on which each thing has one writer. `RESET_ORDER` is the one place that says who
comes before whom.
"""

from abc import ABC
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import TaskError
from anysim.managers.board import Board
from anysim.model.world import World
from anysim.randomization.streams import Streams
from anysim_schemas.run import RunSpec

if TYPE_CHECKING:
    from anysim.managers.overrides import Overridable

RESET_ORDER = (
    "terrain",
    "population",
    "layout",
    "scene",
    "joints",
    "physics",
    "robot",
    "light",
    "camera",
    "capture",
    "task",
)
"""The ground first, then who is there, where it is, what it is like, how its joints stand and what pulls at it, then
who moves, what shines and who looks, and the task last, on the settled scene."""


class Manager(ABC):
    """Does nothing by itself; a subclass overrides the steps of the lifecycle that it needs."""

    name: ClassVar[str]
    spec: RunSpec
    streams: Streams
    board: Board
    engine: SimEngine

    def configure(self, spec: RunSpec, streams: Streams, board: Board | None = None) -> Self:
        """Take the spec; check what can be checked without a world. Managers of one env share streams and board."""
        self.spec = spec
        self.streams = streams
        self.board = Board(streams.num_envs) if board is None else board
        return self

    def build(self, world: World) -> None:
        """Prepare for a compiled World; names become indices here."""

    def parameters(self) -> Iterable[tuple[str, str]]:
        """What this run will change per env: (parameter, dotted path of the spec that asks for it).

        Names are those of `anysim.engine.parameters`. Asked after `build`; an engine that cannot change one of them is
        refused before it builds anything.
        """
        return ()

    def bind(self, engine: SimEngine) -> None:
        """The engine is live: allocate buffers."""
        self.engine = engine

    def recall(self, env: int, drawn: Mapping[str, Any]) -> None:
        """Before the reset that replays a recorded episode: what the record holds and no stream can give again."""

    def reset(self, env_ids: Array) -> None:
        """Write the initial state of these envs, from their streams."""

    def overridable(self) -> Sequence["Overridable"]:
        """The values of the spec that may be overridden for an episode: see `anysim.managers.overrides`."""
        return ()

    def override(self, path: str, value: Any, env_ids: Array) -> None:
        """Write one of `overridable` that can change midway, now, as if it had been drawn so."""
        raise TaskError(f"the manager '{self.name}' says that {path} can change midway, and has no `override` for it")

    def revert(self, path: str, env_ids: Array) -> None:
        """An episode in which `path` was overridden is over: what `reset` does not write anew is as built again."""

    def before_step(self, env_ids: Array | None) -> None:
        """Before the physics steps of a control step; `env_ids` None means all envs."""

    def after_step(self, env_ids: Array | None) -> None:
        """After the physics steps of a control step."""

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the manager's own state, arrays with a leading env axis."""
        return {}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
