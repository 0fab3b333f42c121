"""Plain data and the one way to write it as JSON: mappings in their order, two spaces, shortest exact floats."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anysim.errors import RecordError
from anysim_schemas.files import RefusedFileError, read_plain
from anysim_schemas.limits import JSON_BYTES


def plain(value: Any, where: str = "value") -> Any:
    """The same data as str, int, float, bool, None, list and dict; numpy arrays become lists.

    JSON has no infinity: such floats become the strings `inf`, `-inf` and `nan`, which a spec reads back as floats.

    Raises:
        RecordError: something that JSON cannot say, by its place.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist(), where)
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(float(value))
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise RecordError(f"{where} has the key {key!r}; keys must be strings")
        return {str(key): plain(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    raise RecordError(
        f"{where} is a {type(value).__name__}, which JSON cannot hold; numbers, strings and lists of them can"
    )


def dump_json(value: Any, where: str = "value") -> bytes:
    """The bytes of a JSON file: equal data, in the same order, gives equal bytes.

    Keys are not sorted: the order of the objects in a spec is that of the bodies in the world it makes.
    """
    text = json.dumps(plain(value, where), indent=2, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def load_json(path: Path) -> Any:
    """The data of a plain JSON file of at most `JSON_BYTES`.

    Raises:
        RecordError: the file is missing, a device, too large, or not JSON.
    """
    try:
        data = read_plain(path, JSON_BYTES)
    except RefusedFileError as error:
        raise RecordError(f"{path} {error.strerror}") from error
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror or error}") from error
    try:
        return json.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{path} is not JSON: {error}") from error
