"""The ground that robots stand on: heights beside them, tiles, and which of them an env has."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, TaskError
from anysim.math.arrays import shown
from anysim.model.world import World
from anysim.randomization.streams import Streams
from anysim_legged_gym.spec import GroundSpec
from anysim_sensors.heights import GroundHeights, scanned_heights
from anysim_sensors.scene import SceneGeometry

BESIDE = np.array([[x, y] for y in (-0.05, 0.0, 0.05) for x in (-0.05, 0.0, 0.05)])
"""[m] Points of `Moment.heights_around_feet`."""
ABOVE = 5.0
"""[m] over a robot from where rays look for the ground."""


class Ground:
    """Heights of the ground, and the tile of each env.

    Attributes:
        origins: (rows, columns, 3) [m] where robots begin on each tile; one of zeros where there are no tiles.
        levels, types: (N,) the row and the column of each env's tile.
        points: (P, 2) [m] beside the base, ahead and to the left, where heights are measured; rows along x.
    """

    def __init__(self, world: World, spec: GroundSpec, streams: Streams) -> None:
        self._streams, self._moves = streams, 0
        rows, columns = (1 + max((getattr(t, k) for t in world.tiles), default=0) for k in ("row", "column"))
        self.tiled = bool(world.tiles)
        self.origins = np.zeros((rows, columns, 3))
        for tile in world.tiles:
            self.origins[tile.row, tile.column] = tile.origin
        n = streams.num_envs
        self.types = np.arange(n) * columns // n
        top = rows - 1
        if self.tiled and spec.surface.tiling.start is not None:
            top = spec.surface.tiling.start
        self.levels = np.array([self._drawn(env, top + 1) for env in range(n)])
        x, y = np.meshgrid(spec.measured_points_x, spec.measured_points_y, indexing="ij")
        self.points = np.stack([x.ravel(), y.ravel()], axis=1)
        try:
            self._table = GroundHeights(world)
            self._scene = None
        except AnysimError:  # a mesh of the user's own
            self._table, self._scene = None, SceneGeometry(world)
        self._world = world
        lowest = [float(np.min(field.heights)) for field in world.heightfields]
        self._void = min(lowest, default=0.0)

    @property
    def env_origins(self) -> Array:
        """(N, 3) [m] where each env's robot begins."""
        return self.origins[self.levels, self.types]

    def around(self, base: Array) -> Array:
        """Heights (N, P) [m] of the ground at `points` beside poses (N, 7), turned with their heading."""
        return self._at(base, self.points)

    def beside(self, frames: Array) -> Array:
        """Heights (N, 9) [m] at and near poses (N, 7)."""
        return self._at(frames, BESIDE)

    def _at(self, frames: Array, points: Array) -> Array:
        if self._table is not None:
            found = self._table.at(frames, points)
        else:
            assert self._scene is not None
            bodies = np.zeros((len(frames), len(self._world.bodies), 7))
            bodies[..., 6] = 1.0
            seen = self._scene.on([-1])
            posed = self._scene.posed(bodies)
            found = scanned_heights(self._scene, posed, frames, points, above=ABOVE, reach=10 * ABOVE, seen=seen)
        return np.nan_to_num(found, copy=False, nan=self._void)

    def move(self, env_ids: Array, up: Array, down: Array) -> None:
        """Raise or lower the levels of envs by one; above the last one an env gets any, and below the first the first.

        Raises:
            TaskError: the ground has no tiles, or the arguments are not of one length.
        """
        if not self.tiled:
            raise TaskError(
                "the ground has no levels to climb; `terrain` needs mesh_type heightfield or trimesh and tiles, as "
                "`{mesh_type: heightfield, ground: {kind: tiles, tiles: {choose: curriculum}}}`"
            )
        up, down = np.asarray(up, dtype=bool), np.asarray(down, dtype=bool)
        if up.shape != env_ids.shape or down.shape != env_ids.shape:
            raise TaskError(
                f"move_up and move_down are one boolean for each of {len(env_ids)} envs, got {shown(up.shape)} and "
                f"{shown(down.shape)}"
            )
        rows = len(self.origins)
        wanted = self.levels[env_ids] + up.astype(int) - down.astype(int)
        self._moves += 1
        for row in np.flatnonzero(wanted >= rows):
            wanted[row] = self._drawn(int(env_ids[row]), rows)
        self.levels[env_ids] = np.maximum(wanted, 0)

    def _drawn(self, env: int, rows: int) -> int:
        return int(self._streams.shared_generator(env, "terrain/level", self._moves).integers(rows))
