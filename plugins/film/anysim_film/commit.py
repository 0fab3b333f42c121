"""Videos that are added to a directory which others may read: whole, and then named in its manifest, or not at all."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from anysim.errors import RecordError
from anysim.record.commit import fsync, seal, write_durably
from anysim.record.incoming import FileLock
from anysim.record.json import dump_json
from anysim.record.manifest import CameraEntry, Manifest
from anysim_film.sheet import FilmSheet

Listing = TypeVar("Listing", Manifest, FilmSheet)


@contextmanager
def workspace(directory: Path) -> Iterator[Path]:
    """An empty directory beside `directory`, for this process alone, that is gone afterwards.

    What a process that died has left there is removed.

    Raises:
        RecordError: another process films the same.
    """
    aside = directory.with_name(f".{directory.name}.film")
    lock = FileLock.take(aside.with_name(f"{aside.name}.lock"))
    if lock is None:
        raise RecordError(f"another process films {directory}; wait for it, or film something else")
    with lock:
        shutil.rmtree(aside, ignore_errors=True)
        aside.mkdir()
        try:
            yield aside
        finally:
            shutil.rmtree(aside, ignore_errors=True)


def add_videos(
    aside: Path,
    directory: Path,
    manifest: str,
    listing: Listing,
    cameras: Mapping[str, CameraEntry],
    clock: Mapping[str, Any],
) -> Listing:
    """Move the finished videos of `cameras` from `aside` into `directory`, and then name them in its manifest.

    A crash on the way leaves files that the manifest does not know, and that are replaced when they are filmed again.

    Args:
        aside: on the file system of `directory`.
        directory: of the trajectory or film.
        manifest: the name of its manifest file, replaced in one step.
        listing: what the manifest says so far.
        cameras: what is new, by camera.
        clock: when and by what each was drawn, kept under `clock.filmed`.

    Returns:
        What the manifest says now.
    """
    entries = seal(aside, [camera.file for camera in cameras.values()])
    more = {
        "cameras": {**listing.cameras, **cameras}, "files": {**listing.files, **entries},
        "clock": {**listing.clock, "filmed": {**listing.clock.get("filmed", {}), **clock}},
    }  # fmt: skip
    grown = type(listing)(**{**dict(listing), **more})
    move_in(aside, directory, list(entries), manifest, dump_json(grown.to_dict(), "manifest"))
    return grown


def move_in(aside: Path, directory: Path, names: Sequence[str], sheet: str, content: bytes) -> None:
    """Move finished files and folders of files into a directory, and then its sheet, which names them, in one step.

    Args:
        aside: on the file system of `directory`.
        directory: where a folder of the same name is replaced.
        names: of the files, relative.
        sheet: the name of the sheet.
        content: of the sheet.
    """
    write_durably(aside / sheet, content)
    for top in dict.fromkeys(name.partition("/")[0] for name in names):
        if (directory / top).is_dir():
            shutil.rmtree(directory / top)
        if (aside / top).is_dir():
            fsync(aside / top)
        (aside / top).replace(directory / top)
    fsync(directory)
    (aside / sheet).replace(directory / sheet)
    fsync(directory)
