"""An occupancy grid that a world declares: free, occupied and unknown cells around a frame."""

from collections.abc import Mapping
from math import inf
from typing import Annotated

from pydantic import Field

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.model.world import ORIGIN
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView
from anysim_schemas.base import Number, Positive, Vec3
from anysim_sensors.occupancy import Grid, occupancy
from anysim_sensors.sight.eye import Eye, LeftOut, Shapes

MOST = 1_000_000


class Occupancy(Sensor):
    """An upright grid that turns with a frame's heading, rows across, columns along: -1 unknown, 0 free, 1 occupied.

    A cell is occupied where something stands between `low` and `high` in sight of the frame; see `occupancy`.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        size: Annotated[tuple[Positive, Positive], Field(description="along the heading and across [m]")] = (6.0, 6.0),
        cell: Annotated[Positive, Field(description="side of a cell [m]")] = 0.05,
        low: Annotated[Number, Field(description="over the frame, above which things stand in the way [m]")] = 0.1,
        high: Annotated[Number, Field(description="over the frame, below which they do [m]")] = 1.2,
        reach: Annotated[Positive | None, Field(description="how far it sees [m]; the whole grid if not given")] = None,
        shapes: Shapes = "collision",
        leave_out: Annotated[LeftOut, Field(description="what carries it, and does not stand in the way")] = "entity",
        position: Annotated[Vec3, Field(description="in the frame [m]")] = ORIGIN,
    ) -> None:
        super().__init__(scene.engine.num_envs)
        if low >= high:
            raise AnysimError(f"`low` ({low:g} m) is below `high` ({high:g} m)")
        self._grid, self._reach = Grid(size, cell, low, high), inf if reach is None else reach
        rows, columns = self._grid.shape
        if rows * columns > MOST:
            raise AnysimError(f"{rows} x {columns} cells are more than {MOST:,}; choose a larger `cell`")
        self._eye = Eye(scene, frame, shapes, leave_out, position)
        self.fields = {"cells": SensorField((rows, columns), "1", frame.name, "int8")}

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        eye = self._eye
        return {"cells": occupancy(eye.geometry, eye.posed, eye.poses, self._grid, reach=self._reach, seen=eye.seen)}
