"""The importer of xacro files: expanded in a process of its own with their arguments, and read as URDF."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib import util
from pathlib import Path
from types import MappingProxyType
from typing import Any

from anysim.assets.bounded_files import bounded
from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ImportedModel
from anysim.assets.uri import package_folders
from anysim.errors import AssetError, listing
from anysim_schemas.limits import MODEL_BYTES
from anysim_urdf import xacro_child
from anysim_urdf.load import import_expanded

SECONDS, MEMORY, PACKAGES = 5, 2 << 30, 50
"""What one file may take: time of the processor [s], bytes of memory, packages that it refers to."""


def import_xacro(
    path: Path,
    *,
    root: Path,
    scale: float = 1.0,
    packages: Mapping[str, Path] = MappingProxyType({}),
    visual_error: float = VISUAL_ERROR,
    params: Mapping[str, Any] = MappingProxyType({}),
) -> ImportedModel:
    """Read a xacro file. `params` are its arguments by name; see `import_urdf` for the others.

    Raises:
        AssetError: xacro is not installed or refuses the file, it refers to what lies outside of its folders, or the
            URDF that it makes is refused.
    """
    text = expanded(path, root, packages, params)
    with tempfile.TemporaryDirectory(prefix="anysim-xacro-") as folder:
        file = Path(folder) / f"{path.stem}.urdf"
        file.write_text(text, encoding="utf-8")
        return import_expanded(path, file, root=root, scale=scale, packages=packages, visual_error=visual_error)


def expanded(path: Path, root: Path, packages: Mapping[str, Path], params: Mapping[str, Any]) -> str:
    """The URDF that a xacro file makes with these arguments."""
    if util.find_spec("xacro") is None:
        raise AssetError(f"{path}: xacro files need the package xacro: pip install 'anysim-urdf[xacro]'")
    bounded(path, MODEL_BYTES)
    arguments = {name: _written(path, name, value) for name, value in params.items()}
    known = {name: str(folder.resolve()) for name, folder in packages.items()}
    roots = [str(root.resolve())]
    for _ in range(PACKAGES):
        order = {"file": str(path), "roots": roots, "packages": known, "arguments": arguments}
        found = _asked(path, order)
        if "text" in found:
            return found["text"]
        if "package" not in found:
            raise AssetError(f"{path}: xacro cannot expand it: {' '.join(found['error'].split())}")
        name = found["package"]
        folders = [folder for _, folder in package_folders(name, path.resolve(), root.resolve(), packages)]
        there = next((folder for folder in folders if folder.is_dir()), None)
        if there is None:
            raise AssetError(
                f"{path} refers to $(find {name}), and there is no package '{name}' "
                f"(looked for: {listing(dict.fromkeys(map(str, folders)), 4)}); say where it is: "
                f"`packages: {{{name}: FOLDER}}` beside the source, or in ROS_PACKAGE_PATH; "
                f"`anysim robot import` takes --package {name}=FOLDER"
            )
        known[name] = str(there.resolve())
    raise AssetError(f"{path} refers to more than {PACKAGES} packages")


def _written(path: Path, name: str, value: Any) -> str:
    """An argument as xacro takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | int | float):
        return str(value)
    raise AssetError(
        f"{path}: the argument '{name}' is {value!r}; arguments of a xacro are words, numbers and booleans"
    )


def _asked(path: Path, order: dict[str, Any]) -> dict[str, str]:
    """The child's answer to an order."""
    order |= {"seconds": SECONDS, "memory": MEMORY, "bytes": MODEL_BYTES.value}
    try:
        done = subprocess.run(
            [sys.executable, "-I", xacro_child.__file__],
            input=json.dumps(order).encode(),
            capture_output=True,
            timeout=20 * SECONDS,
            cwd=path.parent,
            env={},  # a file says nothing of the environment that it is read in
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise AssetError(f"{path}: xacro did not end within {20 * SECONDS} s") from None
    try:
        answer: dict[str, str] = json.loads(done.stdout)
    except ValueError:
        raise AssetError(
            f"{path}: xacro did not end: its expressions need more than {SECONDS} s or {MEMORY >> 30} GB"
        ) from None
    if len(answer.get("text", "")) > MODEL_BYTES.value:
        raise AssetError(f"{path}: expanded it {MODEL_BYTES.sentence(len(answer['text']))}")
    return answer
