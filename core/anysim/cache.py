"""A per-user cache of arrays, addressed by the hash of what they were made from. Losing it costs time and no more.

Entries are .npz files without pickles, written aside and renamed, so that two processes cannot see half of one. A full
disk or a folder that cannot be written turns caching off with one warning; a damaged entry is made anew.
"""

import hashlib
import logging
import os
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from anysim.conventions import Array

CACHE_ENV = "ANYSIM_CACHE_DIR"
_log = logging.getLogger(__name__)
_KEY = "__key__"
_warned: set[Path] = set()


def cache_folder() -> Path:
    """`ANYSIM_CACHE_DIR` if set, else the user's cache directory of the platform."""
    override = os.environ.get(CACHE_ENV)
    if override:
        return Path(override)
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("anysim", appauthor=False))


def digest(*parts: str | bytes) -> str:
    """SHA-256 of parts, in hexadecimal; each part is hashed with its length, so that they cannot run together."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(f"{len(data)}:".encode())
        total.update(data)
    return total.hexdigest()


def load_or_make(kind: str, key: str, make: Callable[[], dict[str, Array]]) -> dict[str, Array]:
    """The arrays stored under `kind` and `key` (a hexadecimal digest), else those of `make()`, which are stored.

    `make` must depend on nothing but what the key was made from: its result and a stored one are taken as equal.
    """
    path = cache_folder() / kind / f"{key}.npz"
    stored = _read(path, key)
    if stored is not None:
        return stored
    arrays = make()
    _write(path, key, arrays)
    return arrays


def _read(path: Path, key: str) -> dict[str, Array] | None:
    try:
        # opened here: numpy leaves the file open when it is too damaged to read
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}  # reading checks the CRC of each member
        if str(arrays.pop(_KEY)) == key:
            return arrays
        reason = "it holds another key"
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        reason = f"{type(error).__name__}: {error}"
    _log.warning("the cached %s is damaged (%s) and is made anew", path, reason)
    return None


def _write(path: Path, key: str, arrays: dict[str, Array]) -> None:
    aside: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
        aside = Path(name)
        with os.fdopen(handle, "wb") as file:
            np.savez(file, allow_pickle=False, **{**arrays, _KEY: np.array(key)})
        aside.replace(path)
        aside = None
    except OSError as error:
        folder = cache_folder()
        if folder not in _warned:
            _warned.add(folder)
            _log.warning(
                "cannot cache in %s (%s); going on without. Set %s to another folder", folder, error, CACHE_ENV
            )
    finally:
        if aside is not None:
            aside.unlink(missing_ok=True)
