"""The file of a snapshot: one zip of .npy arrays and one JSON header, whole or refused.

The header holds everything that is no array, and for each array its member, size and SHA-256; a third kind of member
holds the SHA-256 of the header. So one hash covers all content. Equal content gives equal bytes, and a file is refused
that has others, so any changed byte is noticed wherever it is. Members are stored as they are, not compressed: a small
file cannot unfold into a large one. Who knows the format can make a file with right hashes: what is in it is checked
where it is used (`anysim.engine.snapshots.row_checks`).

A file is written aside and renamed, so that under its name it is complete or it is not there.

The header is exact: integers of any size, tuples, numpy numbers, and no infinity lost. What JSON lacks becomes a
mapping of one key that begins with `~`; arrays are taken out of the tree.
"""

import hashlib
import io
import json
import math
import os
import platform
import threading
import zipfile
from collections.abc import Callable, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from anysim import __version__
from anysim.conventions import Array
from anysim.errors import SnapshotError
from anysim_schemas.files import open_plain
from anysim_schemas.limits import SNAPSHOT_BYTES, SNAPSHOT_HEADER_BYTES

FORMAT, VERSION = "anysim-snapshot", 1
HEADER, SEAL = "header.json", "header.sha256"
_MARK = "~"
_KINDS = "biufSU"
"""Of numpy's types, those that arrays in a file may have."""
_LONGEST = 1 << 16
"""Bytes of one number or word."""
_MATTER = ("numpy", "numba")
"""What computes states beside the engine: another version of it may round another last bit."""


class Content(NamedTuple):
    """What a file holds: the stamp that says what it belongs to, and the data.

    Attributes:
        kind: `engine snapshot`, `env snapshot` or `world state`.
        stamp: plain data about its origin, shown to people.
        made_with: versions of what computed it, and the kind of machine.
        data: the tree that was saved, with read-only arrays.
        arrays: shape and type of each array, by its place in the tree.
        sha256: the hash of everything.
        size: of the file [bytes].
    """

    kind: str
    stamp: dict[str, Any]
    made_with: dict[str, str]
    data: Any
    arrays: dict[str, str]
    sha256: str
    size: int


@cache
def made_with() -> Mapping[str, str]:
    """The versions on which equal bits depend, beside the engine's own."""
    versions = {"anysim": __version__}
    for name in _MATTER:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions | {"machine": platform.machine()}


def write(path: str | Path, kind: str, stamp: Mapping[str, Any], data: Any) -> Path:
    """Write a tree of mappings, lists, tuples, arrays and plain values; an existing file is replaced.

    Arrays are written as they are in memory: read again, their types and bytes are the same.

    Raises:
        SnapshotError: something in it has no exact form in a file, or the file cannot be written.
    """
    path = Path(path)
    arrays: dict[str, Array] = {}
    tree = encode(data, arrays)
    members = {f"arrays/{number}.npy": _npy(array) for number, array in enumerate(arrays.values())}
    table = {
        name: {"member": member, "bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
        for name, (member, content) in zip(arrays, members.items(), strict=True)
    }
    head = {
        "format": FORMAT,
        "version": VERSION,
        "kind": kind,
        "stamp": encode(dict(stamp), {}),
        "made_with": dict(made_with()),
        "arrays": table,
        "data": tree,
    }
    header = json.dumps(head, allow_nan=False, separators=(",", ":")).encode()
    for limit, size in (
        (SNAPSHOT_HEADER_BYTES, len(header)),
        (SNAPSHOT_BYTES, len(header) + sum(map(len, members.values()))),
    ):
        if limit.exceeded(size):
            raise SnapshotError(f"{path} would not be read again: it {limit.sentence(size)}")
    aside = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with aside.open("wb") as file:
                _pack(file, {HEADER: header, SEAL: _sha(header).encode(), **members})
                file.flush()
                os.fsync(file.fileno())
            aside.replace(path)
        except BaseException:
            aside.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise SnapshotError(f"{path} cannot be written: {error.strerror or error}") from error
    return path


def read(path: str | Path) -> Content:
    """Everything in a file, checked against its hashes.

    Raises:
        SnapshotError: it cannot be read, is no snapshot, is damaged, or has a newer format.
    """
    path = Path(path)
    try:
        with open_plain(path) as file:
            size = file.seek(0, os.SEEK_END)
            if SNAPSHOT_BYTES.exceeded(size):
                raise SnapshotError(f"{path} {SNAPSHOT_BYTES.sentence(size)}")
            with zipfile.ZipFile(file) as archive:
                return _content(path, archive, size, file)
    except OSError as error:
        raise SnapshotError(f"{path} cannot be read: {error.strerror or error}") from error
    except SnapshotError:
        raise
    except Exception as error:  # of any library that reads a file of any origin
        raise SnapshotError(
            f"{path} is no snapshot, or a damaged or truncated one: {error}; copy it anew, or save it anew"
        ) from error


def expect(content: Content, kind: str, path: str | Path) -> Any:
    """The data of a file of a kind that belongs to this installation.

    Raises:
        SnapshotError: another kind, or made with other versions, all of them named.
    """
    same_kind(content, kind, path)
    here = made_with()
    names = dict.fromkeys([*content.made_with, *here])
    other = [
        f"{name} {content.made_with.get(name, 'absent')} (here {here.get(name, 'absent')})"
        for name in names
        if content.made_with.get(name) != here.get(name)
    ]
    if other:
        raise SnapshotError(
            f"{path} was made with {', '.join(other)}, so going on from it would not give the same bits; install those "
            f"versions, or replay the episode here from its seed and actions, or carry a WorldState over"
        )
    return content.data


def same_kind(content: Content, kind: str, path: str | Path) -> None:
    """Refuse a file of another kind, with what loads it."""
    if content.kind != kind:
        raise SnapshotError(f"{path} holds an {content.kind}, not an {kind}; load it with {_LOADERS[content.kind]}")


ENGINE, ENV, WORLD = "engine snapshot", "env snapshot", "world state"
_LOADERS = {ENGINE: "Snapshot.load", ENV: "EnvSnapshot.load", WORLD: "WorldState.load"}


def _pack(file: IO[bytes], members: Mapping[str, bytes]) -> None:
    """Write an archive. Equal members give equal bytes, on every machine."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, content in members.items():
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.create_system, info.external_attr = 3, 0o600 << 16
            archive.writestr(info, content)


def _content(path: Path, archive: zipfile.ZipFile, size: int, file: IO[bytes]) -> Content:
    infos = {info.filename: info for info in archive.infolist()}
    if HEADER not in infos or SEAL not in infos:
        raise ValueError(f"it has no {HEADER} with a {SEAL}")
    header = _member(archive, infos[HEADER], SNAPSHOT_HEADER_BYTES.value)
    seal = _sha(header)
    if _member(archive, infos[SEAL], 64).decode() != seal:
        raise ValueError(f"{HEADER} does not have the hash in {SEAL}")
    head = json.loads(header)
    if head["format"] != FORMAT:
        raise ValueError(f"its format is {head['format']!r}")
    if head["version"] > VERSION:
        raise SnapshotError(
            f"{path} has format {FORMAT} {head['version']}; anysim {__version__} reads up to {VERSION}: "
            f"install a newer anysim"
        )
    if head["kind"] not in _LOADERS:
        raise ValueError(f"it holds a {head['kind']!r}")
    table = head["arrays"]
    known = {HEADER, SEAL, *(entry["member"] for entry in table.values())}
    if infos.keys() != known:
        raise ValueError(f"it should hold {len(known)} members, and holds {len(infos)}")
    arrays: dict[str, Array] = {}
    members = {HEADER: header, SEAL: seal.encode()}
    for name, entry in table.items():
        content = _member(archive, infos[entry["member"]], entry["bytes"])
        if len(content) != entry["bytes"] or _sha(content) != entry["sha256"]:
            raise ValueError(f"'{name}' does not have its hash")
        members[entry["member"]] = content
        arrays[name] = _array(content, name)
    again = io.BytesIO()
    _pack(again, members)
    file.seek(0)
    if size != len(again.getbuffer()) or file.read() != again.getbuffer():
        raise ValueError("there are other bytes in it than its members and the directory that they have")
    shapes = {name: f"{rows.dtype} {rows.shape}" for name, rows in arrays.items()}
    stamp, made = decode(head["stamp"], {}), head["made_with"]
    if not isinstance(stamp, dict) or not isinstance(made, dict):
        raise ValueError("its stamp and `made_with` should be mappings")
    return Content(
        head["kind"], stamp, {str(k): str(v) for k, v in made.items()}, decode(head["data"], arrays), shapes, seal, size
    )


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo, limit: int) -> bytes:
    """The bytes of a member: stored as they are, and not more of them than there may be."""
    if info.compress_type != zipfile.ZIP_STORED or info.file_size != info.compress_size or info.file_size > limit:
        raise ValueError(f"{info.filename} is packed, or larger than it says")
    with archive.open(info) as file:
        return file.read(limit + 1)


def _npy(array: Array) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
    return buffer.getvalue()


def _array(content: bytes, name: str) -> Array:
    """A read-only array of a .npy file, whose header must agree with its length."""
    buffer = io.BytesIO(content)
    if np.lib.format.read_magic(buffer) != (1, 0):
        raise ValueError(f"'{name}' is a .npy file of another version than 1.0")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(buffer)
    body = memoryview(content)[buffer.tell() :]
    if (
        dtype.kind not in _KINDS
        or fortran
        or min(shape, default=0) < 0
        or int(np.prod(shape)) * dtype.itemsize != len(body)
    ):
        raise ValueError(f"'{name}' is not the array that it says")
    return np.frombuffer(body, dtype=dtype).reshape(shape)


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


# -------------------------------------------------------------------------- trees of plain values as exact JSON


def encode(value: Any, arrays: dict[str, Array], where: str = "") -> Any:
    """The tree for JSON; arrays go into `arrays`, by their place in the tree.

    Raises:
        SnapshotError: a value that has no exact form, by its place.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _KINDS:
            raise SnapshotError(f"{where} is an array of {value.dtype}, which has no place in a snapshot's file")
        arrays[where] = value
        return {f"{_MARK}array": where}
    if isinstance(value, np.generic):
        return {f"{_MARK}number": [value.dtype.str, encode(value.item(), arrays, where)]}
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {f"{_MARK}float": str(float(value))}
    if isinstance(value, Mapping):
        if not all(isinstance(key, str) and not key.startswith(_MARK) for key in value):
            raise SnapshotError(f"{where} has keys that are no words, or begin with {_MARK}")
        return {key: encode(item, arrays, f"{where}/{key}" if where else key) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [encode(item, arrays, f"{where}/{number}") for number, item in enumerate(value)]
        return items if isinstance(value, list) else {f"{_MARK}tuple": items}
    raise SnapshotError(
        f"{where} is a {type(value).__name__}, which has no place in a snapshot's file; numbers, words, arrays, and "
        f"tuples, lists and mappings of them have"
    )


def decode(tree: Any, arrays: Mapping[str, Array]) -> Any:
    """What `encode` was given.

    Raises:
        ValueError, KeyError, TypeError: it is not what `encode` made.
    """
    if isinstance(tree, list):
        return [decode(item, arrays) for item in tree]
    if not isinstance(tree, dict):
        return tree
    marked = [key for key in tree if key.startswith(_MARK)]
    if not marked:
        return {key: decode(item, arrays) for key, item in tree.items()}
    if len(tree) != 1:
        raise ValueError(f"{marked[0]} has company")
    return _MARKED[marked[0]](tree[marked[0]], arrays)


def _number(pair: Any, arrays: Mapping[str, Array]) -> np.generic:
    kind, value = pair
    dtype = np.dtype(kind)
    if dtype.kind not in _KINDS or dtype.itemsize > _LONGEST:
        raise ValueError(f"{kind} is no type of numbers")
    return dtype.type(decode(value, arrays))


_MARKED: Mapping[str, Callable[[Any, Mapping[str, Array]], Any]] = {
    f"{_MARK}array": lambda name, arrays: arrays[name],
    f"{_MARK}number": _number,
    f"{_MARK}float": lambda word, _: float(word),
    f"{_MARK}tuple": lambda items, arrays: tuple(decode(item, arrays) for item in items),
}
