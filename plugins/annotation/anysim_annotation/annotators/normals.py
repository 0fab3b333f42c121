"""Normals of the surfaces that are seen."""

from typing import Literal

import numpy as np

from anysim.math import pose as P
from anysim_annotation.api import Annotator, Channel, Field, Labels, images
from anysim_annotation.view import Scene, View


class Normals(Annotator):
    """Unit vectors out of the surfaces: exact by geometry, from an engine's depth within the first pixel of an edge."""

    needs: tuple[Channel, ...] = ("normals",)

    def __init__(self, scene: Scene, *, frame: Literal["world", "camera"] = "world") -> None:
        super().__init__(scene)
        self._frame = frame
        words = f"unit, out of the surface, {frame} frame; NaN where nothing is seen"
        self.arrays = {"normals": Field(("H", "W", 3), "1", "float32", words)}

    def annotate(self, view: View) -> Labels:
        normals = view["normals"]
        if self._frame == "camera":
            turn = np.broadcast_to(view.pose[:, None, None, 3:], (*normals.shape[:3], 4))
            normals = P.rotate_inverse(turn, normals.astype(float)).astype(np.float32)
        return images({"normals": normals})
