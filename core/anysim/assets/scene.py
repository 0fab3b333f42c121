"""Scene files of other programs as parts of a run's spec, by the readers of the kind `scenes`.

A reader is a function `(path, *, root, uri, packages)` to an `anysim_schemas.scene.ImportedScene`: objects whose assets
are `URI#/BODY`, which the importer of the format reads as a part of the scene, their layout, lights, cameras, physics.
"""

from collections.abc import Mapping
from pathlib import Path

from anysim import registry
from anysim.assets.load import model_file
from anysim.assets.uri import locate_folder
from anysim.errors import AssetError
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
