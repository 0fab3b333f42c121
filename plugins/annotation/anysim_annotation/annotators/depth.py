"""Depth images, as they are."""

from collections.abc import Mapping

from anysim_annotation.api import Annotator, Channel, Field, Labels, images
from anysim_annotation.view import View


class Depth(Annotator):
    """Distances along the optical axis."""

    needs: tuple[Channel, ...] = ("depth",)
    arrays: Mapping[str, Field] = {
        "depth": Field(("H", "W"), "m", "float32", "along the optical axis, inf where nothing is seen")
    }

    def annotate(self, view: View) -> Labels:
        return images({"depth": view["depth"]})
