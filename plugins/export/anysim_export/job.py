"""An export: episodes written aside, each whole or not at all, then one data set, visible by one rename."""

import importlib
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from anysim import registry
from anysim.errors import PluginError, RecordError, listing
from anysim.record.commit import publish, write_durably
from anysim.record.incoming import FileLock
from anysim.record.json import load_json
from anysim.record.manifest import Manifest, read_manifest
from anysim.record.names import find_trajectories
from anysim_export.api import DataSet, Exporter
from anysim_export.parts import Told, made, sync, wait_for_writers, write_parts
from anysim_export.sheet import SHEET_FILE, ExportSheet, make_sheet, read_sheet
from anysim_export.streams import streams_of

PARTS, WHOLE = "parts", "whole"


class Exported(NamedTuple):
    """What came of an export.

    Attributes:
        directory: of the data set.
        episodes, frames: in it.
        resumed: episodes that an interrupted export had written already.
        left_out: trajectories that did not succeed.
        present: the same data set was there already.
        omitted: streams of the recordings that are not in it, each with the option that brings it, or an empty word.
    """

    directory: Path
    episodes: int
    frames: int
    resumed: int
    left_out: int
    present: bool
    omitted: dict[str, str]


class Hands(NamedTuple):
    """What writes episodes: so many processes, or the workers of an executor."""

    jobs: int | None
    executor: str | None


def export(
    runs: Sequence[Path],
    to: str,
    out: Path,
    options: Mapping[str, Any] | None = None,
    *,
    failed_too: bool = False,
    jobs: int | None = None,
    executor: str | None = None,
    tell: Callable[[int], Told] | None = None,
) -> Exported:
    """Write committed trajectories as a data set.

    An export that was interrupted goes on where it stopped, and gives the bytes that it would have given.

    Args:
        runs: runs, or trajectories.
        to: the exporter's name.
        out: directory of the data set, which must not exist, or be the same export.
        options: the exporter's.
        failed_too: export episodes too that did not succeed.
        jobs: processes that write episodes, by default one; the bytes are the same. A program that asks for more than
            one guards its main module (`if __name__ == "__main__"`), which each of them imports.
        executor: whose workers write them in place of such processes.
        tell: asked for a `Told` with the number of episodes to write.

    Raises:
        RecordError: nothing to export, damage, trajectories that do not belong together, something else in `out`.
        PluginError: no such exporter, or what it needs is not installed.
        SpecError: at `options.KEY`, an option that it does not have.
    """
    exporter, said = made(to, options or {})
    with closing(exporter):
        _check_needs(to, exporter.needs)
        return _export(exporter, said, runs, to, out, failed_too, Hands(jobs, executor), tell)


def _export(
    exporter: Exporter,
    said: dict[str, Any],
    runs: Sequence[Path],
    to: str,
    out: Path,
    failed_too: bool,
    hands: Hands,
    tell: Callable[[int], Told] | None,
) -> Exported:
    paths, left_out = _chosen(runs, failed_too)
    data = DataSet([manifest for _, manifest in paths], said)
    with registry.using("exporters", to):
        places = exporter.places(data)
    _check_alike(paths, places)
    with registry.using("exporters", to):
        exporter.check(data)
        lacking = omitted(to, exporter, data)
    sheet = make_sheet(to, registry.distribution("exporters", to), said, data.manifests)
    done = Exported(out, len(paths), sum(one.steps for one in data.manifests), 0, left_out, False, lacking)
    aside = out.absolute().with_name(f".{out.absolute().name}.export")
    if _is_there(out, sheet):
        _clear(aside)
        return done._replace(present=True)
    try:
        aside.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock.take(aside.with_name(f"{aside.name}.lock"))
        if lock is None:
            raise RecordError(f"another process exports into {out}; wait for it, or choose another --out")
        with lock:
            resumed = _begin(aside, sheet)
            told = (lambda line, standing: None) if tell is None else tell(len(paths))
            with registry.using("exporters", to, (OSError,)):
                parts = write_parts(aside / PARTS, to, [path for path, _ in paths], data, told, *hands)
                whole = aside / WHOLE
                shutil.rmtree(whole, ignore_errors=True)
                whole.mkdir()
                exporter.assemble(whole, parts, data)
            write_durably(whole / SHEET_FILE, sheet.encode())
            sync(whole)
            publish(whole, out.absolute())
            shutil.rmtree(aside)
    except OSError as error:
        raise RecordError(
            f"cannot export into {out}: {error.strerror or error} ({error.filename or out}). Episodes that were "
            f"written wait in {aside}; make room, and run the same command again, which goes on from there"
        ) from error
    return done._replace(resumed=resumed)


def _check_needs(name: str, needs: Mapping[str, str]) -> None:
    for module, extra in needs.items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise PluginError(f"the exporter '{name}' needs {module}: pip install '{extra}' ({error})") from error


def omitted(name: str, exporter: Exporter, data: DataSet) -> dict[str, str]:
    """The streams that a data set leaves out, each with the option that would bring it, or with an empty word."""
    taken, remedies, options = exporter.places(data), dict[str, str](), data.options
    for key, value in options.items():
        if isinstance(value, bool):
            other, _ = made(name, {**options, key: not value})
            with closing(other):
                remedies |= dict.fromkeys(other.places(data), f"{key}={str(not value).lower()}")
    return {name: remedies.get(name, "") for name in streams_of(data.first) if name not in taken}


def _chosen(runs: Sequence[Path], failed_too: bool) -> tuple[list[tuple[Path, Manifest]], int]:
    """The trajectories to export, and how many are left out."""
    found = [(path, read_manifest(path)) for path in find_trajectories(runs)]
    kept = [(path, manifest) for path, manifest in found if failed_too or manifest.status == "success"]
    if not kept:
        statuses = sorted({manifest.status for _, manifest in found})
        raise RecordError(
            f"{listing(map(str, runs))}: none of {len(found)} committed trajectories succeeded ({listing(statuses)}); "
            "record others, or export these with --failed-too"
        )
    return kept, len(found) - len(kept)


def _check_alike(paths: Sequence[tuple[Path, Manifest]], places: Mapping[str, str]) -> None:
    """See that trajectories can be one data set, and hold what was observed before each action.

    `places` are of the streams that are taken: others may differ.
    """
    first, one = paths[0]
    for path, other in paths:
        if not other.has_initial_frame or not other.steps:
            raise RecordError(f"{path} does not hold how it began, so nothing was observed before its first action")
        differing = [
            what
            for what, ours, theirs in (
                ("observations", one.layout.obs, other.layout.obs),
                ("actions", one.layout.action, other.layout.action),
                ("states", one.layout.state, other.layout.state),
                ("control steps", one.control_dt, other.control_dt),
                ("cameras", _sizes(one), _sizes(other)),
                ("streams", _streams(one, places), _streams(other, places)),
            )
            if ours != theirs
        ]
        if differing:
            raise RecordError(f"{first} and {path} have other {listing(differing)}; export them one by one")


def _sizes(manifest: Manifest) -> dict[str, tuple[int, int]]:
    return {name: (camera.width, camera.height) for name, camera in manifest.cameras.items()}


def _streams(manifest: Manifest, places: Mapping[str, str]) -> dict[str, object]:
    taken = {name: entry for name, entry in manifest.streams.items() if name in places}
    return {name: entry.model_dump(exclude={"file", "rows"}) for name, entry in taken.items()}


def _is_there(out: Path, sheet: ExportSheet) -> bool:
    """Whether this very export is there; raises where anything else is."""
    if not out.exists() and not out.is_symlink():
        return False
    there = read_sheet(out) if out.is_dir() else None
    if there == sheet:
        return True
    if there is None:
        held = "is no data set of `anysim export`"
    else:
        names = ("exporter", "package", "options", "task", "specs", "episodes")
        others = [name for name in names if getattr(there, name) != getattr(sheet, name)]
        held = f"holds another export ('{there.exporter}', {len(there.episodes)} episodes; other {listing(others)})"
    raise RecordError(f"{out} is there and {held}; nothing is overwritten: choose another --out, or remove it")


def _clear(aside: Path) -> None:
    """Remove what an export has left that died after its data set was there."""
    if aside.exists() and (lock := FileLock.take(aside.with_name(f"{aside.name}.lock"))) is not None:
        with lock:
            shutil.rmtree(aside, ignore_errors=True)


def _begin(aside: Path, sheet: ExportSheet) -> int:
    """The folder of this export's work; what another export has left there is removed. Returns the episodes in it."""
    wait_for_writers(aside)
    path = aside / SHEET_FILE
    try:
        same = path.exists() and ExportSheet.model_validate(load_json(path)) == sheet
    except (RecordError, ValueError):
        same = False
    if not same:
        shutil.rmtree(aside, ignore_errors=True)
        (aside / PARTS).mkdir(parents=True)
        write_durably(path, sheet.encode())
    return sum(1 for part in (aside / PARTS).iterdir() if part.suffix == "")
