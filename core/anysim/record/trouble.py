"""Sentences for what goes wrong on the disk: which path, how much space there is, what remains, what to do."""

import errno
import shutil
from pathlib import Path

from anysim.errors import RecordError


def disk_trouble(what: str, error: OSError, out: Path) -> RecordError:
    """The error for a failed write into a run's directory; `what` begins its sentence."""
    if error.filename2 is not None and error.errno in (errno.ENOTEMPTY, errno.EEXIST):
        return RecordError(taken(Path(error.filename2)))
    if error.errno in (errno.EMFILE, errno.ENFILE):
        remedy = "Allow more open files (ulimit -n), or record fewer cameras at once: each has one in every env"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        remedy = "Make the directory writable, or record into another one"
    else:
        remedy = "Make room, or record into another directory, and start it again"
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


def taken(final: Path) -> str:
    """The sentence for a trajectory that is there already."""
    return (
        f"{final} is committed already and is never overwritten; skip the ids in Recorder.committed(), "
        "or record into another directory"
    )
