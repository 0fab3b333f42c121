"""Scene files of other programs as parts of a run's spec, by the readers of the kind `scenes`.

A reader is a function `(path, *, root, uri, packages)` to an `anysim_schemas.scene.ImportedScene`: objects whose assets
are `URI#/BODY`, which the importer of the format reads as a part of the scene, their layout, lights, cameras, physics.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.assets.load import model_file
from anysim.assets.uri import locate_folder
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim_schemas.nodes import Mark
from anysim_schemas.scene import ImportedScene

PART = "/"
"""What the name of a body begins with that is read as a part of its scene; alone, all that is fixed to the world."""


def read_scene(uri: str, packages: Mapping[str, str], place: Mark) -> ImportedScene:
    """What the scene file behind a URI says; relative to the file of `place`, or to the working directory.

    Raises:
        AssetError: see `anysim.assets.load.model_file`; the reader's own.
        PluginError: no reader of the format is installed.
    """
    written = bool(place.line)
    base = Path(place.source).parent if written else Path.cwd()
    file = model_file(uri, base=base)
    if file.body:
        raise AssetError(f"'{uri}' names one body; a world is made of the whole file: leave '#{file.body}' out")
    folders = {name: locate_folder(folder, base=base).path for name, folder in packages.items()}
    relative = uri.startswith("file:") or ":" not in uri
    reader = registry.load("scenes", file.kind)
    with registry.using("scenes", file.kind):
        scene: ImportedScene = reader(
            file.path, root=file.root, uri=uri if written or not relative else str(file.path), packages=folders
        )
    for entry in scene.entries if packages else ():
        if entry.keys[:2] == ("world", "objects") and len(entry.keys) == 3:
            entry.value["source"]["packages"] = dict(packages)
    return scene


# ------------------------------------------------------------------ what readers share


def free_name(wanted: str, otherwise: str, taken: Collection[str]) -> str:
    """A name that anysim takes, made of one of another program, that is not taken; `otherwise` is for one without."""
    name = re.sub(r"[^a-zA-Z0-9_]", "_", wanted.replace("::", "_"))
    name = name if re.match(r"[a-zA-Z]", name) else f"{otherwise}_{name}" if name else otherwise
    free, count = name, 0
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    return free


def control_step(dt: float, usual: float = 0.02) -> float:
    """The whole multiple of a time step [s] that is nearest to the usual time between two actions [s]."""
    steps = max(1, round(usual / dt)) if dt > 0 else 1
    return usual if abs(steps * dt - usual) < 1e-9 else steps * dt


def placed(position: Iterable[float], quaternion: Iterable[float]) -> dict[str, Any]:
    """An entry of the layout for a position [m] and a unit quaternion xyzw, that other things may touch at first."""
    angles = dict(zip(("roll", "pitch", "yaw"), P.exact_roll_pitch_yaw(quaternion).tolist(), strict=True))
    turned = {key: angle for key, angle in angles.items() if angle}
    return {"position": [float(v) for v in position], **turned, "checked": False}
