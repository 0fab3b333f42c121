"""A height scan that a world declares: the ground around a frame, from its table or from rays straight down."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.model.world import ORIGIN
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView
from anysim_schemas.base import NonNegative, Positive, Vec3
from anysim_sensors.heights import GroundHeights, scanned_heights
from anysim_sensors.patterns import grid
from anysim_sensors.sight.eye import Eye, LeftOut, Shapes

MOST = 1_000_000


class HeightScan(Sensor):
    """Heights over the frame's origin [m], on a grid that turns with its heading: rows across, columns along it.

    `table` is the ground alone, bilinear in two triangles a cell, cut from its lowest corner to its highest; `rays` is
    the first thing below `above`, what stands on the ground too. Both are clipped to `limit` up and down; where there
    is no ground it is -limit.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        length: Annotated[Positive, Field(description="along the heading [m]")] = 1.6,
        width: Annotated[Positive, Field(description="across [m]")] = 1.0,
        spacing: Annotated[Positive, Field(description="from point to point [m]")] = 0.1,
        limit: Annotated[Positive, Field(description="largest height and depth [m]")] = 2.0,
        source: Literal["table", "rays"] = "table",
        above: Annotated[NonNegative, Field(description="over the frame, where `rays` begin [m]")] = 1.0,
        shapes: Shapes = "collision",
        leave_out: Annotated[LeftOut, Field(description="what carries it, and `rays` pass")] = "entity",
        position: Annotated[Vec3, Field(description="in the frame [m]")] = ORIGIN,
    ) -> None:
        super().__init__(scene.engine.num_envs)
        columns, rows = (max(1, round(extent / spacing) + 1) for extent in (length, width))
        if rows * columns > MOST:
            raise AnysimError(f"{rows} x {columns} points are more than {MOST:,}; choose a larger `spacing`")
        self._points = grid((length, width), spacing)
        self._limit, self._above, self._shape = limit, above, (rows, columns)
        self._eye = Eye(scene, frame, shapes, leave_out, position)
        try:
            self._ground = GroundHeights(scene.engine.world) if source == "table" else None
        except AnysimError as error:
            raise AnysimError(f"{error} (`source: rays`)") from None
        self.fields = {"height": SensorField(self._shape, "m", "world", "float32")}

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        eye, shown = self._eye, self._eye.poses
        if self._ground is not None:
            found = self._ground.at(shown, self._points)
        else:
            reach = self._above + self._limit
            found = scanned_heights(
                eye.geometry, eye.posed, shown, self._points, above=self._above, reach=reach, seen=eye.seen
            )
        over = np.nan_to_num(found - shown[:, 2, None], nan=-self._limit)
        return {"height": np.clip(over, -self._limit, self._limit).reshape(len(env_ids), *self._shape)}
