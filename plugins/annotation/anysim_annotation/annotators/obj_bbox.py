"""Box of the target of each skill segment, as it was when the segment began."""

from collections.abc import Mapping, Sequence

from anysim_annotation.annotators.boxes_2d import THING
from anysim_annotation.annotators.boxes_3d import BOX, box_record
from anysim_annotation.api import Field, Record, SegmentAnnotator
from anysim_annotation.bounds import ThingBounds
from anysim_annotation.targets import target_of
from anysim_annotation.view import Scene, Segment


class ObjBBox(SegmentAnnotator):
    """The eight corners in the world and in the image of the segment's first step, whatever stands before them."""

    by = "skill"
    records: Mapping[str, Field] = {"target": Field((), "name", "", "as the command has it")} | THING | BOX

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._bounds = ThingBounds(scene.world)

    def label(self, segment: Segment) -> Sequence[Record]:
        target = target_of(segment)
        if target is None:
            return ()
        box = self._bounds.box(target.entity, segment.first.body_pose[0], target.bodies)
        if box is None:
            return ()
        said = {"target": target.name, "id": target.thing.id, "name": target.thing.name, "label": target.thing.label}
        return [said | box_record(segment.first, *box)]
