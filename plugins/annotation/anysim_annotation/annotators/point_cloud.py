"""Points of what is seen, in the world and before the camera."""

from typing import Annotated

import numpy as np
from pydantic import Field as Checked

from anysim.conventions import Array
from anysim_annotation.api import Annotator, Field, Labels
from anysim_annotation.view import Scene, View


class PointCloud(Annotator):
    """One point for each pixel, or each `stride`-th along both axes, that sees anything."""

    def __init__(
        self,
        scene: Scene,
        *,
        stride: Annotated[int, Checked(ge=1, description="pixels from one point to the next")] = 1,
        colors: bool = False,
    ) -> None:
        super().__init__(scene)
        self._stride = stride
        self.needs = ("points", "segmentation", *(("rgb",) if colors else ()))
        self.arrays = {
            "world": Field(("P", 3), "m", "float32", "world frame"),
            "camera": Field(("P", 3), "m", "float32", "optical frame"),
            "instance": Field(("P",), "1", "uint16", "ids of the legend"),
            "pixel": Field(("P", 2), "px", "uint16", "column and row"),
        }
        if colors:
            self.arrays["color"] = Field(("P", 3), "1", "uint8", "red, green, blue")

    def annotate(self, view: View) -> Labels:
        points, ids, step = view["points"], view["segmentation"], self._stride
        found: dict[str, list[Array]] = {name: [] for name in self.arrays}
        for row in range(len(view)):
            grid = np.zeros(points.shape[1:3], dtype=bool)
            grid[::step, ::step] = True
            at = grid & np.isfinite(points[row, ..., 0])
            v, u = np.nonzero(at)
            found["world"].append(points[row][at])
            found["camera"].append(view.local[row][at].astype(np.float32))
            found["instance"].append(self.scene.legend.instance[ids[row][at]])
            found["pixel"].append(np.column_stack([u, v]).astype(np.uint16))
            if "color" in found:
                found["color"].append(view["rgb"][row][at])
        return Labels(found, [()] * len(view))
