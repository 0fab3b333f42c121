"""Optical flow: the motion of what is seen since the frame before, from poses, so exact whatever it looks like."""

from collections.abc import Mapping

from anysim_annotation.api import Annotator, Channel, Field, Labels, images
from anysim_annotation.view import View


class Flow(Annotator):
    """Follows each body and the camera. A frame without one before it, as an episode's first, has no flow."""

    needs: tuple[Channel, ...] = ("flow", "occluded")
    arrays: Mapping[str, Field] = {
        "flow": Field(("H", "W", 2), "px", "float32", "columns and rows since the frame before; NaN where nothing is"),
        "occluded": Field(("H", "W"), "1", "bool", "not to be seen in the frame before: hidden, or out of the image"),
    }

    def annotate(self, view: View) -> Labels:
        return images({"flow": view["flow"], "occluded": view["occluded"]})
