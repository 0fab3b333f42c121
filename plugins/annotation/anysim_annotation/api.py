"""The contract of an annotator: the channels that it needs of a camera, and the arrays and records that it makes.

An annotator belongs to one camera. It is given a `View`, which is that camera at one moment in a batch of envs, and may
ask it for poses, names, and the channels in its `needs`; a channel is computed once for all that ask, or not at all.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple

from anysim.conventions import Array
from anysim_annotation.view import Scene, Segment, View

Channel = Literal["depth", "segmentation", "normals", "points", "flow", "occluded", "whole", "rgb"]
"""What a view can be asked for:

- `depth` (E, H, W) float32 [m] along the optical axis, inf where nothing is seen;
- `segmentation` (E, H, W) int32 entity ids, as engines draw them (`Legend` has their names);
- `normals` (E, H, W, 3) float32, of the surfaces, world frame; NaN where nothing is seen, or no surface is to be told;
- `points` (E, H, W, 3) float32 [m] of the world; NaN where nothing is seen;
- `flow` (E, H, W, 2) float32 [px] how far what is seen has come in the image since the view before, NaN without one;
- `occluded` (E, H, W) bool, what was not to be seen in the view before;
- `whole` (E, ids) int32 [px] of each entity with nothing before it, by segmentation id;
- `rgb` (E, H, W, 3) uint8, always drawn by the engine.
"""
Record = Mapping[str, Any]


class Field(NamedTuple):
    """One array, or one key of a record.

    Attributes:
        shape: of one env's; `H` and `W` are the image's, other letters are free, and the same within a moment.
        unit: `px`, `m`, `xyzw`; `1` for pure numbers and `name` for words.
        dtype: of an array; keys of records have none.
        words: what it is.
    """

    shape: tuple[int | str, ...] = ()
    unit: str = "1"
    dtype: str = ""
    words: str = ""


class Labels(NamedTuple):
    """What an annotator has made of a view of E envs.

    Attributes:
        arrays: by name E arrays, those of `Annotator.arrays`.
        records: E lists of records, with the keys of `Annotator.records`.
    """

    arrays: Mapping[str, Sequence[Array]]
    records: Sequence[Sequence[Record]]


class Annotator(ABC):
    """Made as `(scene, *, parameters)`; keyword-only arguments are the parameters, as those of a term.

    Attributes:
        needs: channels without which it labels nothing; it may ask for no other.
        arrays: what it makes of each image; those of whole numbers and 2 axes are kept as PNG.
        records: the keys of each of its records; none if it makes none.
    """

    needs: tuple[Channel, ...] = ()
    arrays: Mapping[str, Field] = {}
    records: Mapping[str, Field] = {}

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def reset(self, env_ids: Array) -> None:
        """Episodes begin in these envs: forget what was seen there."""
        del env_ids

    @abstractmethod
    def annotate(self, view: View) -> Labels:
        """Label a moment in envs (E,). The same view gives the same labels, alone or among other envs."""


class SegmentAnnotator(ABC):
    """Labels what a stretch of an episode was for, once for each: it reads poses and words, and no image.

    Attributes:
        by: whether a segment is a skill's, or one phase of it, which is one move.
        records: the keys of each of its records, besides those of `Segment`.
    """

    by: ClassVar[Literal["skill", "phase"]]
    records: Mapping[str, Field] = {}

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @abstractmethod
    def label(self, segment: Segment) -> Sequence[Record]:
        """Label a segment that has ended; nothing if it was for nothing that has such labels."""


def images(rows: Mapping[str, Array]) -> Labels:
    """Labels without records, of arrays (E, …)."""
    count = len(next(iter(rows.values())))
    return Labels({name: list(array) for name, array in rows.items()}, [()] * count)


def listed(records: Sequence[Sequence[Record]]) -> Labels:
    """Labels of records alone, E lists."""
    return Labels({}, records)
