"""The nearest thing in each column of the image, the ground left out."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field as Checked

from anysim_annotation.api import Annotator, Channel, Field, Labels, Record
from anysim_annotation.view import Scene, View


class Stixels(Annotator):
    """How far one may go in each direction, and what stands there."""

    needs: tuple[Channel, ...] = ("depth", "segmentation")
    arrays: Mapping[str, Field] = {
        "nearest": Field(("W",), "m", "float32", "depth of the nearest thing in each column, inf without one")
    }
    records: Mapping[str, Field] = {
        "name": Field((), "name", "", "the nearest thing of all"),
        "distance": Field((), "m", "", "its depth"),
        "column": Field((), "px", "", "where it is nearest"),
    }

    def __init__(
        self,
        scene: Scene,
        *,
        reach: Annotated[float, Checked(gt=0, description="what is farther counts not [m]")] = 1e9,
    ) -> None:
        super().__init__(scene)
        self._reach = reach

    def annotate(self, view: View) -> Labels:
        depth, ids = view["depth"], view["segmentation"]
        away = np.where((ids > 0) & (depth <= self._reach), depth, np.inf).astype(np.float32)
        nearest, rows = away.min(axis=1), list[list[Record]]()
        for row, columns in enumerate(nearest):
            column = int(np.argmin(columns))
            if not np.isfinite(columns[column]):
                rows.append([])
                continue
            line = int(np.argmin(away[row, :, column]))
            thing = self.scene.legend.of_entity[int(ids[row, line, column]) - 1]
            rows.append([{"name": thing.name, "distance": float(columns[column]), "column": column}])
        return Labels({"nearest": list(nearest)}, rows)
