"""Episodes of an export, each in a folder that is written whole or not at all, by one process or several."""

import os
import platform
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.errors import RecordError
from anysim.plugin_parameters import checked, options_model, parameters
from anysim.record.commit import describe, fsync, publish
from anysim.record.incoming import FileLock
from anysim.record.json import plain
from anysim.record.manifest import Manifest
from anysim.record.reader import open_trajectory
from anysim_export.api import DataSet, Episode, Exporter
from anysim_processes.executors import share

SYNCING = 16
"""Files that are brought to the disk at a time: what waits together takes one turn of its journal."""

Told = Callable[[str, str], None]
"""Called once for each finished episode, with a line about it and what has come so far."""


def made(name: str, options: Mapping[str, Any]) -> tuple[Exporter, dict[str, Any]]:
    """The exporter with its options, and these as plain data, defaults included.

    Raises:
        PluginError: no such exporter.
        SpecError: at `options.KEY`, an option that it does not have.
    """
    kind: type[Exporter] = registry.load("exporters", name)
    given = checked(options_model(kind), options, "options")
    with registry.using("exporters", name):
        return kind(**{key: getattr(given, key) for key in parameters(kind)}), plain(given.model_dump(mode="json"))


def write_parts(
    folder: Path,
    to: str,
    trajectories: Sequence[Path],
    data: DataSet,
    told: Told,
    jobs: int | None = None,
    executor: str | None = None,
) -> list[Path]:
    """The folders of all episodes in order; those that are not there are written, in up to `jobs` processes.

    By default that is this one; an executor has workers of its own.

    Raises:
        RecordError: a trajectory is damaged.
        OSError: the disk is full.
    """
    parts = [folder / f"{i:06d}" for i in range(len(trajectories))]
    work = [(i, trajectories[i], part) for i, part in enumerate(parts) if not part.exists()]
    written = share(executor, work, partial(_writing, folder, to, data), jobs)
    for done, i in enumerate(written, 1 + len(parts) - len(work)):
        told(f"{trajectories[i].name}: {data.manifests[i].steps} steps", f"{done} of {len(parts)}")
    return parts


def wait_for_writers(folder: Path) -> None:
    """See that no process of an export that was killed still writes here; each ends a second after its parent."""
    for path in sorted(folder.glob("*.writer")):
        lock = FileLock.take(path, wait=True)
        if lock is not None:
            lock.release()


@contextmanager
def _writing(folder: Path, to: str, data: DataSet) -> Iterator[Callable[[int, Path, Path], int]]:
    """What writes the folder of an episode, with an exporter of this process; as long as it may, it holds a lock."""
    exporter, _ = made(to, data.options)
    with closing(exporter), _lock(folder.with_name(f"{platform.node()}-{os.getpid()}.writer")):
        yield partial(_write, exporter, data)


def _write(exporter: Exporter, data: DataSet, index: int, trajectory: Path, part: Path) -> int:
    incoming = part.with_suffix(".new")
    shutil.rmtree(incoming, ignore_errors=True)
    incoming.mkdir()
    _check_whole(trajectory, data.manifests[index])
    exporter.write_episode(incoming, Episode(index, open_trajectory(trajectory)), data)
    sync(incoming)
    publish(incoming, part)
    return index


def _lock(path: Path) -> FileLock:
    lock = FileLock.take(path)
    assert lock is not None, "a process writes one data set at a time"
    return lock


def _check_whole(path: Path, manifest: Manifest) -> None:
    """See that a trajectory's files are those that were committed."""
    for name, entry in manifest.files.items():
        if not (path / name).is_file() or describe(path / name) != entry:
            raise RecordError(f"{path / name} is not the file that was committed; `anysim verify {path}` says more")


def sync(folder: Path) -> None:
    """Bring what is in a folder to the disk; what has a second name was brought there under its first one."""
    paths = [path for path in sorted(folder.rglob("*")) if path.is_dir() or path.stat().st_nlink == 1]
    with ThreadPoolExecutor(SYNCING) as pool:
        list(pool.map(fsync, paths))
