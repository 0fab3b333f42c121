"""Maps of things and of kinds of things, with the numbers of the legend."""

from collections.abc import Mapping

from anysim_annotation.api import Annotator, Channel, Field, Labels, images
from anysim_annotation.view import View


class InstanceMap(Annotator):
    """The thing at each pixel: one number for a logical object, whatever asset it is in an episode."""

    needs: tuple[Channel, ...] = ("segmentation",)
    arrays: Mapping[str, Field] = {
        "instance": Field(("H", "W"), "1", "uint16", "ids of the legend; 0 is the ground, and nothing")
    }

    def annotate(self, view: View) -> Labels:
        return images({"instance": self.scene.legend.instance[view["segmentation"]]})


class SemanticMap(Annotator):
    """The kind of thing at each pixel."""

    needs: tuple[Channel, ...] = ("segmentation",)
    arrays: Mapping[str, Field] = {
        "semantic": Field(("H", "W"), "1", "uint16", "labels of the legend; 0 is the ground, and nothing")
    }

    def annotate(self, view: View) -> Labels:
        return images({"semantic": self.scene.legend.semantic[view["segmentation"]]})
