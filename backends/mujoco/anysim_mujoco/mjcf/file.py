"""An MJCF file as a compiled MuJoCo model, after looking where its references lead."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco

from anysim.assets.model import ImportNote
from anysim.assets.uri import resolve_reference
from anysim.errors import AssetError, listing, suggest


def compiled(path: Path, root: Path, body: str = "", notes: list[ImportNote] | None = None) -> Any:
    """Parse and compile a file: defaults, orientations and inertias are MuJoCo's own reading of it.

    Textures and skins are left out: the neutral model has colours only. No body is fused, no visual geom discarded.
    With `body`, all other bodies of the world are taken out, and with them whatever refers to them; `notes` gets what
    tied them to it.

    Raises:
        AssetError: a missing file, a reference that leaves `root`, no such body, or what MuJoCo says against the file.
    """
    path, root = path.resolve(), root.resolve()
    included: dict[str, bytes] = {}
    _check_includes(path, path, root, (), included)
    try:
        spec = _parsed(path, included)
        _check_assets(spec, path, root)
        for texture in list(spec.textures):
            spec.delete(texture)
        for skin in list(spec.skins):
            spec.delete(skin)
        for material in spec.materials:
            material.textures = [""] * len(material.textures)
        spec.compiler.fusestatic = False
        if body:
            left_out = _keep(spec, path, body)
            if notes is not None:
                notes += left_out
        return spec.compile()
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
    spec = mujoco.MjSpec.from_string(path.read_text(encoding="utf-8"), include=dict(included))
    spec.modelfiledir = str(path.parent)
    return spec


def _check_includes(path: Path, main: Path, root: Path, above: tuple[Path, ...], included: dict[str, bytes]) -> None:
    """Follow <include> elements, which MuJoCo resolves against the folder of the main file; keeps what they hold."""
    import lxml.etree as etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        tree = etree.parse(str(path), parser)
    except (OSError, etree.XMLSyntaxError) as error:
        raise AssetError(f"{path}: cannot be read as XML: {error}") from error
    for element in tree.iter("include"):
        asked_by = f"<include> of {path.name}, line {element.sourceline},"
        found = resolve_reference(element.get("file") or "", file=main, root=root, asked_by=asked_by)
        if found in (path, *above):
            raise AssetError(f"{asked_by} includes itself through '{found.name}'")
        included[element.get("file") or ""] = found.read_bytes()
        _check_includes(found, main, root, (path, *above), included)


def _check_assets(spec: Any, path: Path, root: Path) -> None:
    for kind, elements in (("mesh", spec.meshes), ("hfield", spec.hfields)):
        for element in elements:
            if element.file:
                reference = Path(element.file).name if spec.strippath else element.file
                asked_by = f"{kind} '{element.name or element.file}' of {path.name}"
                resolve_reference(str(Path(spec.meshdir) / reference), file=path, root=root, asked_by=asked_by)
