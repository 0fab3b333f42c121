"""Asset files by format.

| URI | what is read |
|---|---|
| `…/arm.urdf`, `…/arm.xml` | the one robot or object that the file holds |
| `…/scene.xml#left_arm` | of an MJCF, SDF or USD file with several, the one whose first body is `left_arm` |
| `…/shelf.boards` | whatever the installed importer `boards` reads |
"""

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from anysim import registry
from anysim.assets.bounded_files import bounded
from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ImportedModel, strange_number
from anysim.assets.procedural import from_uri
from anysim.assets.uri import locate, locate_folder
from anysim.errors import AssetError
from anysim_schemas.limits import MODEL_BYTES
from anysim_schemas.object_source import PROCEDURAL

_FORMATS = {".urdf": "urdf", ".xml": "mjcf", ".mjcf": "mjcf"}  # other endings are importers' names
_WITH_BODY = re.compile(
    r"(robot_descriptions:\w+|.*\.(?:urdf|xml|mjcf|sdf|world|usd[acz]?))#(.+)", re.IGNORECASE | re.DOTALL
)
"""A `#` inside of a path is none that names a body."""


class ModelFile(NamedTuple):
    """A file that holds a model, the folder that no reference in it may leave, its format, and the body that is meant.

    `kind` is the name of its importer. `body` is empty where the whole file is meant, as of all but MJCF, SDF and USD.
    """

    path: Path
    root: Path
    kind: str
    body: str


def import_asset(
    uri: str,
    *,
    base: Path | None = None,
    scale: float = 1.0,
    packages: Mapping[str, str] = MappingProxyType({}),
    visual_error: float = VISUAL_ERROR,
    params: Mapping[str, Any] = MappingProxyType({}),
) -> ImportedModel:
    """The model behind a URI: `.xml` is read by the installed importer `mjcf`, others by that of their ending's name.

    `procedural:NAME` is built by the installed builder, with its default parameters. `packages` are the folders, as
    URIs, of what a URDF or xacro calls `package://NAME/…`, `params` the arguments of a xacro, and `visual_error` [m] is
    how far its looks may be off.

    Raises:
        AssetError: see `model_file`, `anysim.assets.uri.locate_folder` and the importers; a number that is none.
        PluginError: no importer for the format is installed.
    """
    if uri.startswith(PROCEDURAL):
        model = from_uri(uri, scale=scale)
    else:
        file = model_file(uri, base=base)
        own: dict[str, object] = {"body": file.body} if file.body else {"params": params} if params else {}
        if params and file.kind != "xacro":
            raise AssetError(f"asset '{uri}': `params` are for xacro files and builders; this is a {file.kind} file")
        if file.kind in ("urdf", "xacro", "sdf", "world"):
            own |= {"packages": {name: locate_folder(folder, base=base).path for name, folder in packages.items()}}
        importer = registry.load("importers", file.kind)
        with registry.using("importers", file.kind):
            model = importer(file.path, root=file.root, scale=scale, visual_error=visual_error, **own)
    if found := strange_number(model):
        raise AssetError(f"{uri}: {found}; write a finite number (limits may be infinite)")
    return model


def split_body(uri: str) -> tuple[str, str]:
    """A URI without the body that it names, and that body; empty where it names none."""
    named = _WITH_BODY.fullmatch(uri)
    return (named[1], named[2]) if named else (uri, "")


def model_file(uri: str, *, base: Path | None = None) -> ModelFile:
    """The file that a URI stands for, and the body in it.

    Raises:
        AssetError: see `anysim.assets.uri.locate`; no format of models; a body of a URDF, which has one tree.
    """
    whole, body = split_body(uri)
    file = locate(whole, base=base)
    ending = file.path.suffix.lower()
    endings = dict.fromkeys([*_FORMATS, *(f".{name}" for name in registry.names("importers"))])
    if ending not in endings:
        raise AssetError(f"asset '{uri}': '{ending}' is no format of robots and assets ({', '.join(endings)})")
    kind = _FORMATS.get(ending, ending[1:])
    if kind == "mjcf" and bounded(file.path, MODEL_BYTES)[:4096].find(b"<robot") >= 0:
        kind = "urdf"  # a URDF that is called .xml
    if body and kind == "urdf":
        raise AssetError(f"asset '{uri}': a URDF is one tree; '#' chooses among the bodies of an MJCF file's world")
    return ModelFile(file.path, file.root, kind, body)
