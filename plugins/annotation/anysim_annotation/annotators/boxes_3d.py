"""Boxes around things in space, from their shapes and poses, and where their corners are in the image."""

from collections.abc import Mapping

from anysim.conventions import Array
from anysim_annotation.annotators.boxes_2d import THING
from anysim_annotation.api import Annotator, Field, Labels, Record, listed
from anysim_annotation.bounds import ThingBounds, corners
from anysim_annotation.view import Scene, View

BOX = {
    "pose": Field((7,), "m, xyzw", "", "of the box: its middle, and the axes of the thing's root; world frame"),
    "size": Field((3,), "m", "", "along those axes"),
    "corners": Field((8, 3), "m", "", "world frame; x, then y, then z from low to high, z fastest"),
    "pixels": Field((8, 2), "px", "", "the corners in the image; null where one is behind the camera"),
    "depth": Field((8,), "m", "", "of the corners along the optical axis"),
}


class Boxes3D(Annotator):
    """Every thing that is there, seen or not. Whether anything stands before it is for `boxes_2d` to say."""

    records: Mapping[str, Field] = THING | BOX | {"inside": Field((), "1", "", "whether any corner is in the image")}

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._bounds = ThingBounds(scene.world)

    def annotate(self, view: View) -> Labels:
        rows = list[list[Record]]()
        for number in range(len(view)):
            one, row = view.row(number), list[Record]()
            for entity, thing in self.scene.legend.there(view.present[number]):
                found = self._bounds.box(entity, view.body_pose[number])
                if found is not None:
                    box = box_record(one, *found)
                    inside = bool(one.project(corners(*found)[None]).inside.any())
                    said = {"id": thing.id, "name": thing.name, "label": thing.label}
                    row.append(said | box | {"inside": inside})
            rows.append(row)
        return listed(rows)


def box_record(view: View, pose: Array, size: Array) -> dict[str, object]:
    """A box as the keys of `BOX` say, seen in a view of one env."""
    points = corners(pose, size)
    seen = view.project(points[None])
    return {"pose": pose, "size": size, "corners": points, "pixels": seen.pixel[0], "depth": seen.depth[0]}
