"""Asset files by format."""

from pathlib import Path

from anysim import registry
from anysim.errors import AssetError
from anysim.world.assets import AssetFile, locate
from anysim.world.imported import ImportedModel, Importer
from anysim.world.procedural.build import from_uri
from anysim.world.urdf import import_urdf
from anysim_schemas.object_source import PROCEDURAL

_FORMATS = {".urdf": "urdf", ".xml": "mjcf", ".mjcf": "mjcf"}


def import_asset(uri: str, *, base: Path | None = None, scale: float = 1.0) -> ImportedModel:
    """The model behind a URI. `.urdf` is read here; `.xml` and `.mjcf` by the installed importer named `mjcf`.

    `procedural:NAME` is built by the installed builder, with its default parameters.

    Raises:
        AssetError: see `anysim.world.assets.locate` and the importers.
        PluginError: no importer for the format is installed.
    """
    if uri.startswith(PROCEDURAL):
        return from_uri(uri, scale=scale)
    file = locate(uri, base=base)
    return _importer(file, uri)(file.path, root=file.root, scale=scale)


def _importer(file: AssetFile, uri: str) -> Importer:
    kind = _FORMATS.get(file.path.suffix.lower())
    if kind is None:
        raise AssetError(
            f"asset '{uri}': '{file.path.suffix}' is no format of robots and assets ({', '.join(_FORMATS)})"
        )
    if kind == "mjcf" and file.path.read_bytes()[:4096].lstrip().find(b"<robot") >= 0:
        kind = "urdf"  # a URDF that is called .xml
    return import_urdf if kind == "urdf" else registry.load("importers", kind)
