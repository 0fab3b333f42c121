"""An MJCF file as a compiled MuJoCo model, after looking where its references lead."""

import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco

from anysim.assets.bounded_files import bounded
from anysim.assets.model import ImportNote
from anysim.errors import AssetError, listing, suggest
from anysim_mujoco.log import silence
from anysim_mujoco.mjcf import unheld
from anysim_mujoco.mjcf.budget import MjcfBudget
from anysim_schemas.limits import MODEL_BYTES


def compiled(path: Path, root: Path, body: str = "", notes: list[ImportNote] | None = None) -> Any:
    """Parse and compile a file: defaults, orientations and inertias are MuJoCo's own reading of it.

    Textures and skins are left out: the neutral model has colours only. No body is fused, no visual geom discarded.
    With `body`, all other bodies of the world are taken out, and with them whatever refers to them; `notes` gets what
    tied them to it, and all else that the file says in vain.

    Raises:
        AssetError: a missing file, a reference that leaves `root`, no such body, or what MuJoCo says against the file.
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
        if body:
            left_out = _keep(spec, path, body)
            said += left_out
        if notes is not None:
            notes += [*said, *unheld.late(spec)]
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            model = spec.compile()
        if notes is not None:
            notes += [ImportNote("info", "MuJoCo", f"warns: {' '.join(str(one.message).split())}") for one in warned]
        return model
    except (ValueError, mujoco.FatalError) as error:
        raise AssetError(f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())}") from error


def _keep(spec: Any, path: Path, body: str) -> list[ImportNote]:
    """Take all bodies of the world out but one. MuJoCo removes what refers to them, and shortens keyframes."""
    others = [one for one in spec.worldbody.bodies if one.name != body]
    if len(others) == len(spec.worldbody.bodies):
        names = [one.name for one in others if one.name]
        raise AssetError(f"{path}: its world has no body '{body}'{suggest(body, names)} (bodies: {listing(names)})")
    for looking in (*spec.cameras, *spec.lights):  # maybe at a body that goes; the importer leaves them behind anyway
        spec.delete(looking)
    rest = spec.copy()
    rest.delete(rest.body(body))
    whole = _ties(spec)
    for one in others:
        spec.delete(one)
    return [
        ImportNote("dropped", body, f"{kind} between it and other bodies of the file are left out ({count})")
        for kind, count in (whole - _ties(rest) - _ties(spec)).items()
    ]


def _ties(spec: Any) -> Counter[str]:
    """How many elements there are that may tie one body to another."""
    return Counter({"equalities": len(spec.equalities), "tendons": len(spec.tendons)})


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
