"""Checkpoints of learners: trees of arrays, numbers and words in one npz file, without pickles."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.commit import write_whole

_TREE = "tree"
"""The array that holds the JSON of everything but arrays; in it an array is `{"array": KEY}`."""


def save(path: Path, tree: Mapping[str, Any]) -> None:
    """Write a tree whole or not at all: mappings, lists, tensors, arrays, numbers, words, truth values and None."""
    arrays: dict[str, Array] = {}
    words = json.dumps(_written(tree, arrays))
    file = io.BytesIO()
    held: dict[str, Any] = {**arrays, _TREE: np.frombuffer(words.encode(), dtype=np.uint8)}
    np.savez(file, **held)
    write_whole(path.parent, {path.name: file.getvalue()})


def load(path: Path) -> dict[str, Any]:
    """What `save` wrote; tensors come back as arrays.

    Raises:
        RecordError: the file is damaged.
    """
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            return _read(json.loads(file[_TREE].tobytes()), file)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise RecordError(f"the checkpoint {path} is damaged: {error}; delete it, and training begins anew") from error


def _written(value: Any, arrays: dict[str, Array]) -> Any:
    if isinstance(value, Mapping):
        pairs = [[key, _written(one, arrays)] for key, one in value.items()]
        return {"pairs": pairs}  # keys of an optimiser's state are numbers, which JSON's mappings have not
    if isinstance(value, list | tuple):
        return [_written(one, arrays) for one in value]
    if hasattr(value, "detach"):
        value = value.detach().cpu().numpy()
    if isinstance(value, np.ndarray | np.generic):
        key = f"a{len(arrays)}"
        arrays[key] = np.asarray(value)
        return {"array": key}
    return value


def _read(value: Any, file: Mapping[str, Array]) -> Any:
    if isinstance(value, list):
        return [_read(one, file) for one in value]
    if isinstance(value, dict):
        return file[value["array"]] if "array" in value else {key: _read(one, file) for key, one in value["pairs"]}
    return value
