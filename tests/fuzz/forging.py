"""Forged trees and files: what somebody could write who knows the format, and makes the hashes right.

A forgery is a mutation of a good tree of mappings, lists, arrays and plain values: something is missing, too much, of
another type, shape or size, or out of its range.
"""

import hashlib
import io
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.engine.snapshots import file as snapshot_file

Place = tuple[Any, ...]
"""Keys and list numbers from the root of a tree to a value."""

PLAIN: Sequence[Any] = (
    None,
    True,
    -1,
    0,
    2**31,
    2**63,
    2**70,
    -(2**70),
    1.5,
    float("nan"),
    float("inf"),
    -float("inf"),
    1e300,
    "",
    "x",
    "a" * 5000,
    "nul\0",
    "\ud800",
    [],
    [[]],
    {},
    {"x": 1},
    [1, "x", None],
    {"": {}},
    (1, 2),
)
"""Values that stand where others should."""
NUMBERS = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e30, 1e-300, -1.0, 0.0, 2.0**40, 0.5)
WHOLE = (-1, 0, 1, 2, 7, 100, 2**31 - 1, 2**62, -(2**62))
DTYPES = ("f4", "f2", ">f8", "i8", "i1", "u1", "?", "U3", "S2", "c16", "M8[s]", "V8", "f8")


def places(tree: Any, path: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Every value of a tree below its root, those that hold others first."""
    if isinstance(tree, Mapping):
        items = tuple(tree.items())
    elif isinstance(tree, list | tuple):
        items = tuple(enumerate(tree))[:4]
    else:
        return
    for key, value in items:
        yield (*path, key), value
        yield from places(value, (*path, key))


def replaced(tree: Any, path: Place, value: Any) -> Any:
    """A tree with another value at a place; `DROP` removes it."""
    if not path:
        return value
    key, *rest = path
    if isinstance(tree, Mapping):
        changed: Any = dict(tree)
    else:
        changed = list(tree)
    if rest or value is not DROP:
        changed[key] = replaced(changed[key], tuple(rest), value)
    else:
        del changed[key]
    return tuple(changed) if isinstance(tree, tuple) else changed


DROP = object()


def renamed(tree: Any, path: Place, name: str) -> Any:
    """A tree in which a value is under another key."""
    holder = at(tree, path[:-1])
    if not isinstance(holder, Mapping):
        return replaced(tree, path, DROP)
    return replaced(tree, path[:-1], {name if key == path[-1] else key: value for key, value in holder.items()})


def at(tree: Any, path: Place) -> Any:
    """The value at a place."""
    for key in path:
        tree = tree[key]
    return tree


def wrong_arrays(array: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Any]]:
    """Other arrays, and things that are none, in place of an array."""
    yield "scalar", array.reshape(-1)[:1].reshape(()) if array.size else np.zeros(())
    yield "flat", array.reshape(-1)
    yield "deeper", array[None]
    yield "more rows", np.concatenate([array, array])
    yield "fewer rows", array[:-1] if array.ndim else array
    yield "no rows", array[:0] if array.ndim else array
    yield "nine axes", array.reshape((1,) * 9 + array.shape)
    if array.ndim > 1:
        yield "no columns", array[:, :0]
        yield "fewer columns", array[:, :-1]
        yield "more columns", np.concatenate([array, array[:, -1:]], axis=1)
        yield "transposed", np.ascontiguousarray(array.swapaxes(0, -1))
    for name in DTYPES:
        dtype = np.dtype(name)
        if dtype != array.dtype:
            with np.errstate(all="ignore"):
                yield f"as {name}", _as(array, dtype)
    values: Sequence[Any] = NUMBERS if array.dtype.kind == "f" else WHOLE if array.dtype.kind in "iu" else ()
    for value in values:
        if array.dtype.kind in "iu" and not np.iinfo(array.dtype).min <= value <= np.iinfo(array.dtype).max:
            continue
        yield f"all {value:g}", np.full_like(array, value)
        if array.size > 1:
            one = array.copy()
            one.flat[int(rng.integers(array.size))] = value
            yield f"one {value:g}", one
    if array.dtype == bool:
        yield "flipped", ~array
        yield "all true", np.ones_like(array)
        yield "all false", np.zeros_like(array)
    if array.size > 1:
        mixed = array.copy()
        rng.shuffle(mixed.reshape(-1))
        yield "shuffled", mixed
        if array.dtype.kind == "f":
            yield "noise", rng.normal(0.0, 10.0 ** float(rng.uniform(-3, 9)), array.shape)
        else:
            yield (
                "noise",
                np.frombuffer(rng.bytes(array.nbytes), array.dtype).reshape(array.shape)
                if (array.dtype.kind in "iu")
                else mixed,
            )
    for value in (None, "x", 1.0, [], {}, [[1.0, 2.0], [3.0]], array.tolist() if array.size < 1000 else []):
        yield f"a {type(value).__name__}", value


def _as(array: np.ndarray, dtype: np.dtype) -> np.ndarray:
    if dtype.kind in "MV" or array.dtype.kind in "US":
        return np.zeros(array.shape, dtype)
    return array.astype(dtype)


def wrong_trees(tree: Any, rng: np.random.Generator) -> Iterator[tuple[str, Any]]:
    """Every systematic forgery of a tree, with its name."""
    for path, value in places(tree):
        where = "/".join(map(str, path))
        yield f"{where} dropped", replaced(tree, path, DROP)
        yield f"{where} renamed", renamed(tree, path, "~x" if rng.random() < 0.2 else f"{path[-1]}x")
        if isinstance(value, np.ndarray):
            for name, wrong in wrong_arrays(value, rng):
                yield f"{where} {name}", replaced(tree, path, wrong)
        else:
            for wrong in PLAIN:
                yield f"{where} = {str(wrong)[:20]!r}", replaced(tree, path, wrong)
            if isinstance(value, list | tuple):
                yield f"{where} doubled", replaced(tree, path, [*value, *value])
            if isinstance(value, Mapping):
                yield f"{where} with more", replaced(tree, path, {**value, "stranger": np.zeros(2), "b": "c"})
            if isinstance(value, int) and not isinstance(value, bool):
                for wrong in WHOLE:
                    yield f"{where} = {wrong}", replaced(tree, path, wrong)


def forged_trees(tree: Any, count: int, seed: int) -> list[tuple[str, Any]]:
    """`count` forgeries: half of them systematic, spread over the whole tree, the rest of two or three at once."""
    rng = np.random.default_rng(seed)
    single = list(wrong_trees(tree, rng))
    chosen = rng.permutation(len(single))
    found = [single[i] for i in np.sort(chosen[: (count + 1) // 2])]
    while len(found) < count:
        names, wrong = [], tree
        for _ in range(int(rng.integers(1, 4))):
            options = [(path, value) for path, value in places(wrong)]
            if not options:
                break
            path, value = options[int(rng.integers(len(options)))]
            kinds = list(wrong_arrays(value, rng)) if isinstance(value, np.ndarray) else [("", v) for v in PLAIN]
            kinds += [("dropped", DROP)]
            name, other = kinds[int(rng.integers(len(kinds)))]
            names.append(f"{'/'.join(map(str, path))} {name or str(other)[:20]!r}")
            wrong = replaced(wrong, path, other)
        found.append((" and ".join(names), wrong))
    return found


# -------------------------------------------------------------------------- files


def write_file(path: Path, head: Any, tree: Any, stamp: Any) -> Path:
    """A file of the format with right hashes, whatever it says: also what `snapshot_file.write` would refuse.

    `head` are the other keys of the header, which win over those of the tree, or something else in its place.
    """
    arrays: dict[str, np.ndarray] = {}
    data, said = _encode(tree, arrays, ""), _encode(stamp, arrays, "~")
    members = {f"arrays/{number}.npy": _npy(array) for number, array in enumerate(arrays.values())}
    table = {
        name: {"member": member, "bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
        for name, (member, content) in zip(arrays, members.items(), strict=True)
    }
    whole = {"arrays": table, "data": data, "stamp": said} | head if isinstance(head, dict) else head
    text = json.dumps(whole, ensure_ascii=True, separators=(",", ":")).encode()
    seal = hashlib.sha256(text).hexdigest().encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, content in {snapshot_file.HEADER: text, snapshot_file.SEAL: seal, **members}.items():
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content)
    return path


def _npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
    return buffer.getvalue()


def _encode(value: Any, arrays: dict[str, np.ndarray], where: str) -> Any:
    if isinstance(value, np.ndarray):
        arrays[where] = value
        return {"~array": where}
    if isinstance(value, np.generic):
        return {"~number": [value.dtype.str, value.item()]}
    if isinstance(value, float) and not np.isfinite(value):
        return {"~float": str(value)}
    if isinstance(value, Mapping):
        return {str(k): _encode(v, arrays, f"{where}/{k}" if where else str(k)) for k, v in value.items()}
    if isinstance(value, list | tuple):
        items = [_encode(v, arrays, f"{where}/{n}") for n, v in enumerate(value)]
        return items if isinstance(value, list) else {"~tuple": items}
    return value
