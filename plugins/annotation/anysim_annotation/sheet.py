"""annotations.json: what a directory of annotations holds, of which trajectory, and how it was made."""

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from anysim.record.header import Count, Label
from anysim.record.manifest import read_format
from anysim_film.sheet import DrawnSheet
from anysim_schemas.base import Name, Spec

SHEET_FILE, SHEET_FORMAT = "annotations.json", "anysim-annotations-1"
SUFFIX = ".annotations"
"""What the directory of a trajectory's annotations is called after its name."""


class FieldEntry(Spec):
    """An array, or a key of records: shape with letters for what differs, unit, number type, and what it is."""

    shape: tuple[int | str, ...] = ()
    unit: Label = "1"
    dtype: Label = ""
    words: Label = ""


class AnnotatorEntry(Spec):
    """An annotator of a camera: its parameters, what it made, and the files in which that is, by array or `records`."""

    parameters: dict[str, Any] = Field(default_factory=dict)
    arrays: dict[str, FieldEntry] = Field(default_factory=dict)
    records: dict[str, FieldEntry] = Field(default_factory=dict)
    files: dict[str, Label] = Field(default_factory=dict)
    frames: Count = 0


class CameraSheet(Spec):
    """A camera: the size of its images, and its annotators by name."""

    width: Count
    height: Count
    annotators: dict[Name, AnnotatorEntry] = Field(default_factory=dict)


class AnnotationSheet(DrawnSheet):
    """The content of annotations.json. `steps` are the control steps that were labelled."""

    format: Literal["anysim-annotations-1"] = SHEET_FORMAT
    source: Literal["engine", "geometry"]
    steps: tuple[Count, ...] = ()
    legend: dict[str, Any] = Field(default_factory=dict)
    cameras: dict[Name, CameraSheet] = Field(default_factory=dict)


def read_annotations(directory: Path) -> AnnotationSheet | None:
    """The sheet of a directory of annotations; None where nothing was annotated yet.

    Raises:
        RecordError: it is damaged, or of another format.
    """
    path = directory / SHEET_FILE
    return read_format(path, SHEET_FORMAT, AnnotationSheet) if path.exists() else None
