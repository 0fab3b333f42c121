"""Files of annotations: JSON lines of records, PNG images of whole numbers, and archives of all other arrays.

An archive is an `.npz` with one member for each control step, `000012`: `numpy.load(file)["000012"]` reads one without
the others. All of it is lossless, and equal labels give equal bytes.
"""

import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.record.json import plain
from anysim_annotation.api import Field, Record

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The time of every member of an archive: files do not depend on the clock."""
_DIGITS = 9
"""[m, px, 1] decimals of floats in records: beyond them linear algebra rounds otherwise on another machine."""


def as_png(field: Field) -> bool:
    """Whether an array is kept as images: whole numbers of 8 or 16 bits, or colours."""
    return (field.shape == ("H", "W") and field.dtype in ("uint8", "uint16")) or (
        field.shape == ("H", "W", 3) and field.dtype == "uint8"
    )


def write_png(path: Path, image: Array) -> None:
    """Write (H, W) uint8 or uint16, or (H, W, 3) uint8."""
    from PIL import Image

    Image.fromarray(image).save(path, format="PNG", compress_level=6)


class ArrayFile:
    """One array of an annotator over an episode: a folder of images, or an archive."""

    def __init__(self, directory: Path, stem: str, field: Field) -> None:
        self._png = as_png(field)
        self.name = stem if self._png else f"{stem}.npz"
        self._path = directory / self.name
        self.members: list[str] = []
        """Files, from `directory`."""
        if self._png:
            self._path.mkdir()
        else:
            self._archive = zipfile.ZipFile(self._path, "w", zipfile.ZIP_DEFLATED, compresslevel=4)
            self.members.append(self.name)

    def append(self, step: int, array: Array) -> None:
        """Write the array of a control step."""
        if self._png:
            file = f"{step:06d}.png"
            write_png(self._path / file, array)
            self.members.append(f"{self.name}/{file}")
            return
        info = zipfile.ZipInfo(f"{step:06d}.npy", _EPOCH)
        info.compress_type = zipfile.ZIP_DEFLATED
        with self._archive.open(info, "w", force_zip64=True) as member:
            np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)

    def close(self) -> None:
        """Finish the file."""
        if not self._png:
            self._archive.close()


def read_array(directory: Path, name: str, step: int) -> Array:
    """An array of a control step, from the file that a sheet names."""
    if name.endswith(".npz"):
        with np.load(directory / name) as archive:
            return archive[f"{step:06d}"]
    from PIL import Image

    with Image.open(directory / name / f"{step:06d}.png") as image:
        return np.array(image)


def json_line(record: Mapping[str, Any]) -> str:
    """A record as one line: floats rounded to `_DIGITS`, NaN as null."""
    return json.dumps(tidied(plain(record, "record")), ensure_ascii=False, allow_nan=False) + "\n"


def lines_of(step: int, records: Sequence[Record]) -> str:
    """Records of a control step, a line each."""
    return "".join(json_line({"step": step, **record}) for record in records)


def read_records(path: Path) -> list[dict[str, Any]]:
    """The records of a file of JSON lines."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def tidied(value: Any) -> Any:
    """Plain data with floats rounded to `_DIGITS`, and None in place of what is no number."""
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0
    if value in ("nan", "inf", "-inf"):
        return None
    if isinstance(value, list):
        return [tidied(item) for item in value]
    if isinstance(value, dict):
        return {key: tidied(item) for key, item in value.items()}
    return value
