"""Faults of a committed trajectory: what is not as its recorder committed it."""

from pathlib import Path

import numpy as np

from anysim.errors import PluginError, RecordError, listing
from anysim.record.commit import describe
from anysim.record.manifest import Manifest, read_manifest
from anysim.record.names import EPISODES, MANIFEST_FILE, parse_trajectory, trajectories
from anysim.record.reader import TrajectoryReader, open_trajectory

LATE = 1e-3
"""How far a time may be from that of its control step, in control steps: sums of physics steps are rounded."""


def verify(directory: str | Path) -> list[str]:
    """The faults of a trajectory, as sentences; empty if it is whole. Reads every byte.

    Finds a manifest that is damaged, missing and additional files, changed bytes, content that contradicts the
    manifest, videos that do not decode, and numbers that no recorder writes, also where the hashes were made right.
    The manifest itself carries no signature: who can change everything can change everything.

    Raises:
        PluginError: the reader of the trajectory, or a library that it needs, is not installed: nothing is known of
            the content.
    """
    path = Path(directory)
    try:
        manifest = read_manifest(path)
    except RecordError as error:
        return [str(error)]
    faults = _names(path, manifest) + _bytes(path, manifest)
    if faults:
        return faults
    try:
        reader = open_trajectory(path)
        return reader.faults() or reader.nonsense() or _clock(reader)
    except RecordError as error:
        return [str(error)]
    except ImportError as error:  # of a library that a reader imports when it reads: nothing is known of the content
        library = error.name or "a library"
        raise PluginError(
            f"the reader '{manifest.writer}' of {path} needs {library}, which is not installed ({error})"
        ) from error


def verify_run(out: str | Path) -> dict[str, list[str]]:
    """The faults of all trajectories of a run, by name.

    Raises:
        RecordError: there is no such run.
        PluginError: a reader is not installed.
    """
    run = Path(out)
    if not (run / EPISODES).is_dir():
        raise RecordError(f"{run} holds no trajectories; the directory of a run has {EPISODES}/ in it")
    return {path.name: verify(path) for path in trajectories(run)}


def _clock(reader: TrajectoryReader) -> list[str]:
    """Times that are not those of their control steps."""
    dt = reader.manifest.control_dt
    late = np.abs(reader.times / dt - np.arange(1, len(reader.times) + 1)) > LATE
    if not late.any():
        return []
    step = 1 + int(np.argmax(late))
    return [
        f"{reader.directory}: step {step} is at {reader.times[step - 1]:g} s; "
        f"with control steps of {dt:g} s it should be at {step * dt:g} s"
    ]


def _names(path: Path, manifest: Manifest) -> list[str]:
    faults: list[str] = []
    if parse_trajectory(path.name) not in (None, (manifest.env, manifest.episode)):
        faults.append(f"{path} holds env {manifest.env}, episode {manifest.episode}")
    there = {entry.name for entry in path.iterdir()} - {MANIFEST_FILE}
    missing, extra = sorted(manifest.files.keys() - there), sorted(there - manifest.files.keys())
    if missing:
        faults.append(f"{path} lacks {listing(missing)}")
    if extra:
        faults.append(f"{path} has files that its manifest doesn't know: {listing(extra)}")
    return faults


def _bytes(path: Path, manifest: Manifest) -> list[str]:
    faults: list[str] = []
    for name, entry in sorted(manifest.files.items()):
        file = path / name
        if file.is_symlink() or (file.exists() and not file.is_file()):
            faults.append(f"{file} is not a plain file")
        elif file.exists():
            try:
                found = describe(file)
            except OSError as error:
                faults.append(f"{file} cannot be read: {error.strerror}")
                continue
            if found.bytes != entry.bytes:
                faults.append(f"{file} has {found.bytes} bytes; {entry.bytes} were committed")
            elif found.sha256 != entry.sha256:
                faults.append(f"{file} was changed after its commit (its SHA-256 differs)")
    return faults
