"""TerrainManager: on which piece of ground an env stands, and what ground and room look like in this episode.

With `choose: curriculum` each env keeps its column for good, and its level until what judges progress calls `promote`
or `demote`; that takes effect at the env's next reset. An env that has mastered the last level gets one of all levels,
by its streams, so that it does not forget the easy ones.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.compile.room import MAIN, ROOM
from anysim.conventions import GROUND, WORLD, Array
from anysim.engine.base import SimEngine
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import TaskError
from anysim.managers.base import Manager
from anysim.model.appearance import rgb
from anysim.model.world import Tile, World
from anysim.randomization.draw import draw, is_random
from anysim.randomization.streams import Origin
from anysim_schemas.rooms import furniture_names
from anysim_schemas.run import WorldSpec
from anysim_schemas.values import Choice

NEVER = -1
"""The level of an env that was not reset yet."""


class DrawnColor(NamedTuple):
    """Geoms that have one colour, which is drawn in each episode."""

    color: Any
    stream: str
    source: str
    geoms: Array


def _looks(spec: WorldSpec, world: World) -> list[DrawnColor]:
    """What of the ground and of the room looks different in each episode."""
    owner = {b: e.name for e in world.entities for b in range(e.body_start, e.body_stop)}
    parts: list[tuple[Any, str, str, list[int]]] = [
        (spec.terrain.color, "terrain/color", "world.terrain.color",
         [i for i, g in enumerate(world.geoms) if g.body == WORLD and g.name == GROUND and g.visible])
    ]  # fmt: skip
    if spec.room is not None:
        shell = {i: g.name.partition(".")[2] for i, g in enumerate(world.geoms) if owner.get(g.body) == ROOM}
        walls = [i for i, name in shell.items() if name.startswith(("wall", "lintel", "sill"))]
        floor = [i for i, name in shell.items() if name == "floor"]
        parts.append((spec.room.floor_color, "terrain/room/floor_color", "world.room.floor_color", floor))
        parts.append((spec.room.wall_color, "terrain/room/wall_color", "world.room.wall_color", walls))
        for name in furniture_names(spec.room):
            main = [
                i
                for i, g in enumerate(world.geoms)
                if owner.get(g.body) == name and g.name.partition(".")[2].startswith(MAIN)
            ]
            stream = f"terrain/{name}/color"
            parts.append((spec.room.furniture_color, stream, "world.room.furniture_color", main))
    return [DrawnColor(c, s, p, np.array(g)) for c, s, p, g in parts if is_random(c) and g]


LEVEL, COLUMN, KIND = "terrain/level", "terrain/column", "terrain/kind"
"""The streams of a tile's row and column, and the names under which recordings keep them and what the column is."""


class TerrainManager(Manager):
    """Chooses tiles and writes `episodes.origin`; draws colours of ground and room. Geometry is part of the World."""

    name = "terrain"

    def build(self, world: World) -> None:
        self._spec = self.spec.world.terrain
        n = self.streams.num_envs
        self.rows = 1 + max((tile.row for tile in world.tiles), default=0)
        self.columns = 1 + max((tile.column for tile in world.tiles), default=0)
        self._origins = np.zeros((self.rows, self.columns, 3))
        for tile in world.tiles:
            self._origins[tile.row, tile.column] = tile.origin
        self.tiled = bool(world.tiles)
        self.level = np.full(n, NEVER)
        """(N,) the row of each env's tile."""
        self.column = np.zeros(n, dtype=int)
        """(N,) the column of each env's tile."""
        self._change = np.zeros(n, dtype=int)
        self._recalled: dict[int, tuple[int, int]] = {}
        self._looks = _looks(self.spec.world, world)

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._tiling = self._spec.tiling
        weights = tuple(column.weight for column in self._tiling.columns)
        self._columns: Any = Choice[float](choice=tuple(map(float, range(len(weights)))), weights=weights)

    # ------------------------------------------------------------------ curriculum

    @property
    def climbs(self) -> bool:
        """Whether envs have levels of their own; otherwise each episode draws one, if there are tiles."""
        return self.tiled and self._spec.tiling.choose == "curriculum"

    def tile(self, env: int) -> Tile:
        """The tile on which an env stands."""
        return self.engine.world.tiles[self.level[env] * self.columns + self.column[env]]

    def promote(self, env_ids: Array, by: int | Array = 1) -> None:
        """From their next reset on, these envs stand on ground that is `by` levels harder (one number, or one each).

        The latest call before a reset counts.

        Raises:
            TaskError: the terrain has no curriculum.
        """
        if not self.climbs:
            raise TaskError(
                "the ground has no levels to climb; world.terrain needs `kind: tiles` and `tiles: {choose: "
                "curriculum}`, and anysim.make `curriculum=True`"
            )
        self._change[env_ids] = by

    def demote(self, env_ids: Array, by: int = 1) -> None:
        """As `promote`, to easier ground; the easiest is level 0."""
        self.promote(env_ids, -by)

    def recall(self, env: int, drawn: Mapping[str, Any]) -> None:
        """A tile of a curriculum follows from earlier episodes; the record of this one says it."""
        if self.climbs and LEVEL in drawn:
            self._recalled[env] = min(int(drawn[LEVEL]), self.rows - 1), min(int(drawn[COLUMN]), self.columns - 1)

    # ------------------------------------------------------------------ lifecycle

    def reset(self, env_ids: Array) -> None:
        if self.tiled:
            for env in env_ids:
                self._choose(int(env))
            self.episodes.origin[env_ids] = self._origins[self.level[env_ids], self.column[env_ids]]
        for look in self._looks:
            drawn = [draw(look.color, look.stream, self.streams, int(e), source=look.source) for e in env_ids]
            rows = np.array([[[*rgb(color), 1.0]] for color in drawn])
            self.engine.set_parameters("geom.color", np.repeat(rows, len(look.geoms), axis=1), env_ids, look.geoms)

    def _choose(self, env: int) -> None:
        path, first = "world.terrain.tiles", self.level[env] == NEVER or not self.climbs
        wanted, self._change[env] = self.level[env] + self._change[env], 0
        if env in self._recalled:
            self.level[env], self.column[env] = self._recalled.pop(env)
        else:
            if first:
                self.column[env] = draw(self._columns, COLUMN, self.streams, env, source=f"{path}.columns")
            if self.climbs and first:
                top = self.rows - 1 if self._tiling.start is None else self._tiling.start
                self.level[env] = self._drawn_level(env, top, f"{path}.start")
            elif first or wanted >= self.rows:
                self.level[env] = self._drawn_level(env, self.rows - 1, f"{path}.rows")
            else:
                self.level[env] = max(0, wanted)
        for name, kept in ((LEVEL, float(self.level[env])), (COLUMN, float(self.column[env]))):
            if name not in self.streams.draws[env]:
                self.streams.note(env, name, kept, Origin("", f"{path}.choose"))
        self.streams.note(env, KIND, self.tile(env).kind, Origin("", f"{path}.columns"))

    def _drawn_level(self, env: int, top: int, source: str) -> int:
        levels: Any = Choice[float](choice=tuple(map(float, range(top + 1))))
        return int(draw(levels, LEVEL, self.streams, env, source=source))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {
            "level": self.level[env_ids],
            "column": self.column[env_ids],
            "change": self._change[env_ids],
            "origin": self.episodes.origin[env_ids],
        }

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        refuse_range("level", data["level"], NEVER, self.rows - 1)
        refuse_range("column", data["column"], 0, self.columns - 1)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self.level[env_ids], self.column[env_ids] = data["level"], data["column"]
        self._change[env_ids], self.episodes.origin[env_ids] = data["change"], data["origin"]
