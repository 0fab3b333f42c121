"""The commit protocol: everything on the disk, then one rename for each trajectory that makes it visible.

Trajectories that wait at the same time share the last step: their directories are brought to the disk and renamed one
after the other, and then the directory that they are in now is brought to the disk once for all. The sentences for what
goes wrong on the disk are here too.
"""

import errno
import hashlib
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from anysim.errors import RecordError, listing
from anysim.record.header import RunHeader
from anysim.record.json import dump_json
from anysim.record.manifest import FileEntry, RunRecord, read_run
from anysim.record.names import RUN_FILE


def fsync(path: Path) -> None:
    """Wait until a file, or the entries of a directory, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def seal(directory: Path, names: Iterable[str]) -> dict[str, FileEntry]:
    """Bring finished files to the disk and describe them by size and SHA-256."""
    entries: dict[str, FileEntry] = {}
    for name in names:
        path = directory / name
        fsync(path)
        entries[name] = describe(path)
    return entries


def describe(path: Path) -> FileEntry:
    """Size and SHA-256 of a file."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return FileEntry(bytes=file.tell(), sha256=digest)


def write_durably(path: Path, data: bytes) -> None:
    """A new file, on the disk when this returns."""
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def publish(incoming: Path, final: Path) -> None:
    """Make a sealed file or directory visible under its final name, by one rename.

    A directory with content is never replaced.

    Raises:
        OSError: it is not visible, unless even taking it back failed.
    """
    [error] = publish_all([(incoming, final)])
    if error is not None:
        raise error


def publish_all(moves: Sequence[tuple[Path, Path]]) -> list[OSError | None]:
    """Make sealed entries visible in one directory, each (incoming, final) by one rename, all with one last fsync.

    Returns:
        For each, the error for which it is not visible, or None. If the last fsync fails, all are taken back.
    """
    errors: list[OSError | None] = []
    for incoming, final in moves:
        try:
            fsync(incoming)
            incoming.rename(final)
        except OSError as error:
            errors.append(error)
        else:
            errors.append(None)
    done = [place for place, error in enumerate(errors) if error is None]
    try:
        if done:
            fsync(moves[done[0]][1].parent)
    except OSError as error:
        for place in done:
            incoming, final = moves[place]
            with suppress(OSError):  # where even this fails it stays, and is whole
                final.rename(incoming)
            errors[place] = error
    return errors


def write_whole(directory: Path, texts: Mapping[str, str | bytes]) -> None:
    """Write files about what is in a directory, by name, each whole or not at all.

    Raises:
        RecordError: one cannot be written.
    """
    try:
        for name, text in texts.items():
            aside = directory / f".{name}.{os.getpid()}"
            aside.write_bytes(text.encode() if isinstance(text, str) else text)
            aside.replace(directory / name)
    except OSError as error:
        raise RecordError(
            f"cannot write {', '.join(texts)} into {directory}: {error}; what is there is whole"
        ) from error


def describe_run(out: Path, incoming: Path, run: RunHeader) -> None:
    """Write run.json by way of `incoming`, or see that it says the same.

    Raises:
        RecordError: the directory holds the trajectories of another run.
        OSError: it cannot be written.
    """
    record = RunRecord.model_validate(dict(run))
    path = out / RUN_FILE
    if path.exists():
        theirs, ours = read_run(out).to_dict(), record.to_dict()
        differing = sorted(key for key in {*theirs, *ours} if theirs.get(key) != ours.get(key))
        if differing:
            raise RecordError(
                f"{out} holds the trajectories of another run: {listing(differing)} differ"
                f"{'s' if len(differing) == 1 else ''} from {path}; record into another directory"
            )
        return
    aside = incoming / RUN_FILE
    aside.unlink(missing_ok=True)
    try:
        write_durably(aside, dump_json(record.to_dict(), "run"))
        publish(aside, path)
    except OSError:
        aside.unlink(missing_ok=True)
        raise


def disk_trouble(what: str, error: OSError, out: Path) -> RecordError:
    """The error for a failed write into a run's directory; `what` begins its sentence."""
    if error.filename2 is not None and error.errno in (errno.ENOTEMPTY, errno.EEXIST):
        return RecordError(taken(Path(error.filename2)))
    if error.errno in (errno.EMFILE, errno.ENFILE):
        remedy = "Allow more open files (ulimit -n), or record fewer cameras at once: each has one in every env"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        remedy = "Make the directory writable, or record into another one"
    elif error.errno in (errno.ENOTDIR, errno.EEXIST):
        return no_directory(what, file_at(out) or out)
    elif error.errno in (errno.ENAMETOOLONG, errno.ELOOP, errno.EINVAL, errno.ENOENT):
        return RecordError(f"{what}: {error.strerror or error} ({error.filename or out}); name another directory")
    elif error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        remedy = "Make room, or record into another directory, and start it again"
    else:
        remedy = "See to the disk, or record into another directory, and start it again"
    path = error.filename or out
    existing = next((p for p in (out, *out.parents) if p.exists()), Path())
    try:
        free = f"{shutil.disk_usage(existing).free / 2**20:.1f} MiB are free there"
    except OSError:
        free = "its free space is unknown"
    return RecordError(
        f"{what}: {error.strerror or error} ({path}; {free}). What was unfinished of it is discarded, committed "
        f"trajectories are whole. {remedy}"
    )


def file_at(out: Path) -> Path | None:
    """What keeps a directory from being made: a file of its name, or of that of a folder above it."""
    return next((p for p in (out, *out.parents) if p.exists() and not p.is_dir()), None)


def no_directory(what: str, file: Path) -> RecordError:
    """The error for a file where a directory should be."""
    return RecordError(f"{what}: {file} is a file, not a directory; name a directory, which is made if needed")


def taken(final: Path) -> str:
    """The sentence for a trajectory that is there already."""
    return (
        f"{final} is committed already and is never overwritten; skip the ids in Recorder.committed(), "
        "or record into another directory"
    )
