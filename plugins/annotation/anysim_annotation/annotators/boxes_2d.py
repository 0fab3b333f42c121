"""Boxes around what is seen of things, and how much of each is hidden."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim_annotation.api import Annotator, Channel, Field, Labels, Record, listed
from anysim_annotation.view import View

THING = {
    "id": Field((), "1", "", "of the legend"),
    "name": Field((), "name", "", "of the thing"),
    "label": Field((), "name", "", "what kind of thing it is"),
}
"""The first keys of records about things."""


class Boxes2D(Annotator):
    """Things that are seen, with tight boxes; what is wholly hidden or out of the image has none."""

    needs: tuple[Channel, ...] = ("segmentation", "whole")
    records: Mapping[str, Field] = THING | {
        "box": Field((4,), "px", "", "left, top, right, bottom edge of its pixels"),
        "visible": Field((), "px", "", "its pixels"),
        "occlusion": Field((), "1", "", "share of its pixels that other things hide, 0 to 1"),
    }

    def annotate(self, view: View) -> Labels:
        legend, rows = self.scene.legend, list[list[Record]]()
        for ids, whole in zip(view["segmentation"], view["whole"], strict=True):
            found = {number: (box, count) for number, box, count in tight_boxes(ids) if number > 0}
            row = list[Record]()
            for number, (box, count) in found.items():
                thing, alone = legend.of_entity[number - 1], int(whole[number])
                hidden = max(0.0, 1.0 - count / alone) if alone else 0.0  # an engine's edges may be a pixel wider
                row.append(
                    {"id": thing.id, "name": thing.name, "label": thing.label}
                    | {"box": box, "visible": count, "occlusion": round(hidden, 6)}
                )
            rows.append(row)
        return listed(rows)


def tight_boxes(ids: Array) -> list[tuple[int, list[int], int]]:
    """Numbers in a map (H, W), each with its box (left, top, right, bottom) and its pixels."""
    found = list[tuple[int, list[int], int]]()
    for number in np.unique(ids).tolist():
        mask = ids == number
        columns, lines = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
        box = [int(columns[0]), int(lines[0]), int(columns[-1]) + 1, int(lines[-1]) + 1]
        found.append((number, box, int(np.count_nonzero(mask))))
    return found
