"""An MJCF file as a compiled MuJoCo model, after looking where its references lead."""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco

from anysim.assets.bounded_files import bounded
from anysim.assets.model import ImportNote
from anysim.assets.scene import PART
from anysim.errors import AssetError
from anysim_mujoco.log import silence
from anysim_mujoco.mjcf import unheld
from anysim_mujoco.mjcf.budget import MjcfBudget
from anysim_mujoco.mjcf.part import keep, scene_part
from anysim_schemas.limits import MODEL_BYTES


def compiled(path: Path, root: Path, body: str = "", notes: list[ImportNote] | None = None) -> Any:
    """Parse and compile a file: defaults, orientations and inertias are MuJoCo's own reading of it.

    Textures and skins are left out: the neutral model has colours only. No body is fused, no visual geom discarded.
    With `body`, all other bodies of the world are taken out, and with them whatever refers to them; `notes` gets what
    tied them to it, and all else that the file says in vain.

    Raises:
        AssetError: a missing file, a reference that leaves `root`, no such body, or what MuJoCo says against the file.
    """
    with opened(path, root) as file:
        spec, said = file
        if body.startswith(PART) and spec.body(body) is None:
            said = scene_part(spec, path, body.removeprefix(PART))
        else:
            said += [] if not body else keep(spec, path, body)
            said += unheld.late(spec)
        if notes is not None:
            notes += said
        return compile_noting(spec, notes)


@contextmanager
def opened(path: Path, root: Path) -> Iterator[tuple[Any, list[ImportNote]]]:
    """A parsed file without textures and skins, and notes of what is taken out; what MuJoCo says becomes an AssetError.

    Raises:
        AssetError: see `compiled`.
    """
    silence()  # MuJoCo logs each NaN of a file; where one matters, the World refuses it
    path, root = path.resolve(), root.resolve()
    budget = MjcfBudget(path, root)
    try:
        own = budget.check()
        spec = _parsed(path, budget.included)
        budget.check_assets(spec, path, own)
        _without_memory(spec)
        said = unheld.early(spec)
        for texture in list(spec.textures):
            spec.delete(texture)
        for skin in list(spec.skins):
            spec.delete(skin)
        for material in spec.materials:
            material.textures = [""] * len(material.textures)
        spec.compiler.fusestatic = False
        yield spec, said
    except (ValueError, mujoco.FatalError) as error:
        raise AssetError(f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())}") from error


def compile_noting(spec: Any, notes: list[ImportNote] | None = None) -> Any:
    """The compiled model; `notes` gets what MuJoCo warns of."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        model = spec.compile()
    if notes is not None:
        notes += [ImportNote("info", "MuJoCo", f"warns: {' '.join(str(one.message).split())}") for one in warned]
    return model


def _parsed(path: Path, included: Mapping[str, bytes]) -> Any:
    """MuJoCo tells formats by the ending and knows no .mjcf: a file that is not called .xml is read as a text."""
    if path.suffix.lower() == ".xml":
        return mujoco.MjSpec.from_file(str(path))
    spec = mujoco.MjSpec.from_string(bounded(path, MODEL_BYTES).decode(), include=dict(included))
    spec.modelfiledir = str(path.parent)
    return spec


def _without_memory(spec: Any) -> None:
    """Take out what only a simulation needs: memory for it, and simulated lengths of muscles."""
    spec.memory = spec.njmax = spec.nconmax = spec.nstack = -1
    spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE
