"""Sources of a draft: a file, a folder with one, a URI, or a name of robot_descriptions."""

import importlib
import importlib.util
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from anysim import registry
from anysim.assets.load import model_file, split_body
from anysim.errors import AssetError, listing

DESCRIPTIONS = "robot_descriptions"
_FOLDERS = ("", "urdf", "robots", "robot", "xacro", "mjcf", "xml", "sdf")
_ORDER = (".urdf", ".xml", ".mjcf", ".sdf", ".xacro")


class Source(NamedTuple):
    """A model file, what a catalogue's entry calls it (empty: by its path), and what it brings along."""

    file: Path
    uri: str = ""
    arguments: Mapping[str, Any] = {}
    packages: Mapping[str, Path] = {}


def source_of(what: str) -> Source:
    """The source that a path, a folder, a URI or a name of robot_descriptions stands for.

    Raises:
        AssetError: there is none, a folder has several or no models, or a description is not in its cache.
    """
    name = what.removeprefix(f"{DESCRIPTIONS}:")
    path = Path(split_body(what)[0])
    if not path.exists() and re.match(r"(package|example-robot-data):", what):
        return Source(model_file(what).path, what)
    if name != what or (not path.exists() and re.fullmatch(r"\w+_description", what)):
        return _description(name)
    if path.is_dir():
        return Source(_in_folder(path))
    if not path.is_file():
        raise AssetError(
            f"there is no file {path}; `anysim robot import` takes a model file, a folder with one, a URI such as "
            f"package:NAME/arm.urdf, or a name of {DESCRIPTIONS} such as panda_description"
        )
    return Source(Path(what))


def _in_folder(folder: Path) -> Path:
    """The one model in a folder of a robot, in it or where packages have their models."""
    importers = set(registry.names("importers"))
    endings = [ending for ending in _ORDER if ending in (".xml", ".mjcf") or ending[1:] in importers]
    for ending in endings:
        found = [
            file
            for below in _FOLDERS
            if (folder / below).is_dir()
            for file in sorted((folder / below).iterdir())
            if file.suffix.lower() == ending and file.name not in ("package.xml", "scene.xml") and _whole(file)
        ]
        if len(found) == 1:
            return found[0]
        if found:
            raise AssetError(f"the folder {folder} has {len(found)} models; name one: {listing(map(str, found), 8)}")
    raise AssetError(
        f"the folder {folder} has no model ({', '.join(endings)}) in it, or in its folders {', '.join(_FOLDERS[1:])}"
    )


def _whole(file: Path) -> bool:
    """Whether a xacro file is a robot, and no part of one: those have macros alone."""
    if file.suffix.lower() != ".xacro":
        return True
    return re.search(rb"<robot\b[^>]*\bname\s*=", file.read_bytes()[:65536]) is not None


def _description(name: str) -> Source:
    """What a module of robot_descriptions has, where it is in the cache: nothing is fetched here."""
    spec = importlib.util.find_spec(DESCRIPTIONS)
    if spec is None or not spec.submodule_search_locations:
        raise AssetError(f"'{name}' is a name of {DESCRIPTIONS}, which is not installed: pip install {DESCRIPTIONS}")
    file = Path(spec.submodule_search_locations[0]) / f"{name}.py"
    if not name.isidentifier() or not file.is_file():
        raise AssetError(f"{DESCRIPTIONS} has no module '{name}'; `python -m {DESCRIPTIONS} list` shows those it has")
    repositories = importlib.import_module(f"{DESCRIPTIONS}._repositories").REPOSITORIES
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")).expanduser()
    for wanted in re.findall(r"clone_to_cache\(\s*[\"']([^\"']+)", file.read_text("utf-8")):
        folder = cache / repositories[wanted].cache_path if wanted in repositories else cache / wanted
        if not folder.is_dir():
            raise AssetError(
                f"{DESCRIPTIONS}:{name} is not in its cache ({folder}), and nothing is fetched here; with a network "
                f"`python -m {DESCRIPTIONS} pull {name}` fetches it"
            )
    try:
        module = importlib.import_module(f"{DESCRIPTIONS}.{name}")
    except Exception as error:  # its tools for git raise what they like
        raise AssetError(f"{DESCRIPTIONS} could not provide '{name}' from its cache: {error}") from error
    for key in ("URDF_PATH", "MJCF_PATH"):
        if getattr(module, key, None):
            return Source(Path(getattr(module, key)), f"{DESCRIPTIONS}:{name}")
    if getattr(module, "XACRO_PATH", None) is None:
        raise AssetError(f"{DESCRIPTIONS}.{name} has neither URDF_PATH, MJCF_PATH nor XACRO_PATH")
    packages = {key: Path(folder) for key, folder in getattr(module, "XACRO_PACKAGE_PATHS", {}).items()}
    return Source(Path(module.XACRO_PATH), "", dict(getattr(module, "XACRO_ARGS", {})), packages)
