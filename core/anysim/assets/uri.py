"""Asset URIs and their local files. A file has a root folder that neither `..` nor a symbolic link can leave.

| URI | file | root |
|---|---|---|
| `example-robot-data:panda_description/urdf/panda.urdf` | of the pip package example-robot-data | its `robots` folder |
| `package:my_robots/arm/arm.urdf` | of an installed Python package, which is not imported | that package's folder |
| `robot_descriptions:panda_description` | what that module names | its package folder |
| `file:meshes/cup.stl`, `meshes/cup.stl` | relative to the YAML file | the YAML file's folder |
| `file:/data/arm/urdf/arm.urdf` | absolute | the asset's folder (see `_folder_root`) |
| `procedural:cabinet` | none: `anysim.assets.load` has it built | |
"""

import difflib
import glob
import importlib
import importlib.util
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from importlib import metadata
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from anysim.assets.bounded_files import bounded
from anysim.errors import AssetError, listing, suggest
from anysim.math.arrays import shown
from anysim_schemas.files import name_problem
from anysim_schemas.limits import MODEL_BYTES

EXAMPLE_ROBOT_DATA = "example-robot-data"
SCHEMES = (EXAMPLE_ROBOT_DATA, "package", "robot_descriptions", "file")
_MODEL_FOLDERS = frozenset({"urdf", "robots", "xml", "mjcf", "xacro", "usd"})
_SEARCHED = 5000  # files looked at for a near name in an error message
Folders = dict[str, list[tuple[Path, Path]]]
"""Of packages by name: what no file of it may leave, and a folder where it may lie."""


class MissingReferenceError(AssetError):
    """What a file refers to lies nowhere, and the folder or package that would hold it is there."""


class AssetFile(NamedTuple):
    """An existing file, and the folder that no reference inside it may leave. Both are absolute and resolved."""

    path: Path
    root: Path


def locate(uri: str, *, base: Path | None = None) -> AssetFile:
    """The file a URI stands for; `base` is the folder of the YAML file that names it.

    Raises:
        AssetError: an unknown scheme, a package that is not installed, a path that leaves its root, a missing file.
    """
    scheme, rest = _parts("asset", uri)
    if scheme == EXAMPLE_ROBOT_DATA:
        return _inside(example_robot_data(), rest, uri)
    if scheme == "package":
        return _from_package(rest, uri)
    if scheme == "robot_descriptions":
        return _from_robot_descriptions(rest, uri)
    if scheme != "file":
        raise AssetError(
            f"asset '{uri}': there is no scheme '{scheme}'{suggest(scheme, SCHEMES)} "
            f"(schemes: {', '.join(f'{s}:' for s in SCHEMES)} or a path relative to the YAML file)"
        )
    path = Path(rest)
    if path.is_absolute():
        return _inside(_folder_root(path.parent), str(path), uri)
    if base is None:
        raise AssetError(f"asset '{uri}': a relative path needs the YAML file it is relative to; give an absolute path")
    return _inside(base, rest, uri)


def locate_folder(uri: str, *, base: Path | None = None) -> AssetFile:
    """The folder a URI stands for: as `locate`, but for `robot_descriptions`, which names files.

    Raises:
        AssetError: an unknown scheme, a package that is not installed, a path that leaves its root, no such folder.
    """
    scheme, rest = _parts("folder", uri)
    if scheme == EXAMPLE_ROBOT_DATA:
        return _folder_inside(example_robot_data(), rest, uri)
    if scheme == "package":
        package, _, path = rest.partition("/")
        return _folder_inside(_package_folders(package, uri)[-1], path, uri)
    if scheme != "file":
        known = ", ".join(f"{s}:" for s in SCHEMES if s != "robot_descriptions")
        raise AssetError(f"folder '{uri}': there are no folders of '{scheme}:' (schemes: {known} or a relative path)")
    path = Path(rest)
    if path.is_absolute():
        return _folder_inside(path, str(path), uri)
    if base is None:
        raise AssetError(f"folder '{uri}': a relative path needs the YAML file it is relative to; give an absolute one")
    return _folder_inside(base, rest, uri)


def _parts(what: str, uri: str) -> tuple[str, str]:
    """The scheme of a URI, and what follows it."""
    if problem := name_problem(uri):
        raise AssetError(f"{what} {shown(uri)} {problem}; give the URI of an existing one")
    scheme, colon, rest = uri.partition(":")
    return (scheme, rest) if colon else ("file", uri)


def _folder_inside(root: Path, rest: str, uri: str) -> AssetFile:
    root = root.resolve()
    resolved = _resolved(root / rest, f"folder '{uri}'")
    if not resolved.is_relative_to(root):
        raise AssetError(f"folder '{uri}' leaves its root {root}: it would be {resolved}")
    if not resolved.is_dir():
        near = _nearest(root / rest, root)
        raise AssetError(f"folder '{uri}' does not exist: no folder {root / rest}{near}")
    return AssetFile(resolved, root)


def resolve_reference(
    reference: str,
    *,
    file: Path,
    root: Path,
    asked_by: str,
    packages: Mapping[str, Path] = MappingProxyType({}),
    found: Folders | None = None,
) -> Path:
    """The file that a mesh reference in the URDF or MJCF `file` stands for.

    `package://NAME/rest` (and `model://`) is a file of the package NAME, and of no other: see `package_folders`.
    All else is relative to the file. `asked_by` names what asks, as in `link 'panda_hand' of panda.urdf`, `packages`
    the folders of packages by name. `found` keeps where packages lie for the next reference in the same file.

    Raises:
        AssetError: missing (says where it was looked for and the nearest name there is), or outside of the root.
    """
    if problem := name_problem(reference):
        raise AssetError(f"{asked_by} refers to {shown(reference)}, which {problem}")
    root, package = root.resolve(), ""
    scheme, marker, rest = reference.partition("://")
    if not marker:
        candidates = [(root, file.parent / reference)]
    elif scheme == "file":
        candidates = [(root, Path(rest))]
    elif scheme in ("package", "model"):
        package, _, tail = rest.lstrip("/").partition("/")  # package:///NAME/rest is met, too
        found = {} if found is None else found
        if package not in found:
            found[package] = package_folders(package, file.resolve(), root, packages)
        folders = found[package]
        candidates = [(limit, folder / tail) for limit, folder in folders if folder.is_dir()]
        if not candidates:
            places = listing(dict.fromkeys(str(folder) for _, folder in folders), 4)
            raise AssetError(
                f"{asked_by} refers to '{reference}', and there is no package '{package}' (looked for: {places}); "
                f"say where it is: `packages: {{{package}: FOLDER}}` beside the source, or in ROS_PACKAGE_PATH; "
                f"`anysim robot import` takes --package {package}=FOLDER"
            )
    else:
        raise AssetError(f"{asked_by} refers to '{reference}': only package://, model://, file:// and paths are known")
    outside: Path | None = None
    for limit, candidate in candidates:
        if candidate.is_file():
            resolved = candidate.resolve()
            if resolved.is_relative_to(limit):
                return resolved
            outside = resolved
    if outside is not None:
        raise AssetError(
            f"{asked_by} refers to '{reference}', which leaves the asset's root {root}: it is {outside}; name the file "
            "through a folder that holds both (package:NAME/…, or a YAML file there), or put a package.xml into it"
        )
    places = listing(dict.fromkeys(str(candidate) for _, candidate in candidates), 4)
    near = _nearest(candidates[0][1], candidates[0][0])
    raise MissingReferenceError(
        f"{asked_by} refers to '{reference}', which does not exist{near} (looked for: {places})"
    )


def example_robot_data() -> Path:
    """The `robots` folder of the pip package example-robot-data, found without importing anything."""
    try:
        distribution = metadata.distribution(EXAMPLE_ROBOT_DATA)
    except metadata.PackageNotFoundError:
        raise AssetError(
            f"the package {EXAMPLE_ROBOT_DATA} is not installed: pip install {EXAMPLE_ROBOT_DATA}"
        ) from None
    folder = Path(str(distribution.locate_file("cmeel.prefix/share/example-robot-data/robots")))
    if not folder.is_dir():
        raise AssetError(f"the installed package {EXAMPLE_ROBOT_DATA} {distribution.version} has no folder {folder}")
    return folder.resolve()


def package_folders(name: str, file: Path, root: Path, packages: Mapping[str, Path]) -> list[tuple[Path, Path]]:
    """Where the package `name` may lie, and what no file of it may leave: the first that is there counts.

    What `packages` says; the pip package example-robot-data; a folder from the file's own up to `root` that is called
    so, or says so in its package.xml; a folder `name` in one of those, or beside `root`; in a folder of
    ROS_PACKAGE_PATH, or the share of one of AMENT_PREFIX_PATH; an installed Python package, which is not imported.
    """
    if name in packages:
        return [(packages[name].resolve(), packages[name])]
    if not name.strip(".") or "\0" in name:
        return []
    found: list[Path] = []
    if name == EXAMPLE_ROBOT_DATA:
        with suppress(AssetError):
            found.append(example_robot_data().parent)
    above = [folder for folder in file.parents if folder.is_relative_to(root)]
    inside = [folder for folder in above if folder.name == name or _package_name(folder) == name]
    inside += [folder / name for folder in above]
    found.append(root.parent / name)
    for variable, below in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            if Path(entry).name == name or _package_name(Path(entry)) == name:
                found.append(Path(entry))
            found.append(Path(entry) / below / name)
    if name.isidentifier():
        with suppress(AssetError):
            found += _package_folders(name, name)
    return [*((root, folder) for folder in inside), *((folder.resolve(), folder) for folder in found)]


def _package_name(folder: Path) -> str:
    """The name in a folder's package.xml; empty without one."""
    path = folder / "package.xml"
    if not path.is_file():
        return ""
    named = re.search(rb"<name>\s*([\w.-]+)\s*</name>", bounded(path, MODEL_BYTES))
    return named[1].decode() if named else ""


def _resolved(path: Path, what: str) -> Path:
    try:
        return path.resolve()
    except (RuntimeError, OSError) as error:  # of Python before 3.13: a loop of symbolic links
        raise AssetError(f"{what} cannot be found: {error}") from error


def _inside(root: Path, rest: str, uri: str) -> AssetFile:
    root = root.resolve()
    path = root / rest
    resolved = _resolved(path, f"asset '{uri}'")
    if not resolved.is_relative_to(root):
        how = "through '..'" if ".." in Path(rest).parts else "through a symbolic link or an absolute path"
        raise AssetError(f"asset '{uri}' leaves its root {root} {how}: it would be {resolved}")
    if resolved.is_dir():
        models = [str(p.relative_to(resolved)) for p in sorted(resolved.rglob("*.urdf"))]
        raise AssetError(f"asset '{uri}' is a folder; name a file in it (URDF files: {listing(models)})")
    if not resolved.is_file():
        raise AssetError(f"asset '{uri}' does not exist: no file {path}{_nearest(path, root)}")
    return AssetFile(resolved, root)


def _from_package(rest: str, uri: str) -> AssetFile:
    package, _, path = rest.partition("/")
    if not path:
        raise AssetError(f"asset '{uri}': expected package:<python package>/<path>")
    folders = _package_folders(package, uri)
    for folder in folders[:-1]:
        if (folder / path).is_file():
            return _inside(folder, path, uri)
    return _inside(folders[-1], path, uri)


def _package_folders(package: str, uri: str) -> list[Path]:
    if not package.isidentifier():
        raise AssetError(f"asset '{uri}': expected package:<python package>/<path>")
    spec = importlib.util.find_spec(package)  # a top-level name: nothing is imported
    folders = [Path(p) for p in (spec.submodule_search_locations or [])] if spec is not None else []
    if not folders:
        raise AssetError(
            f"asset '{uri}': no Python package '{package}' is installed; install the one that has the file"
        )
    return folders


def _from_robot_descriptions(name: str, uri: str) -> AssetFile:
    if importlib.util.find_spec("robot_descriptions") is None:
        raise AssetError(f"asset '{uri}' needs the package robot_descriptions: pip install robot_descriptions")
    if not name.isidentifier():
        raise AssetError(
            f"asset '{uri}': expected robot_descriptions:<module>, such as robot_descriptions:ur10_description"
        )
    try:
        module = importlib.import_module(f"robot_descriptions.{name}")
    except Exception as error:  # fetching a description can fail in any way its own tools can
        raise AssetError(f"asset '{uri}': robot_descriptions could not provide it: {error}") from error
    path = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    if path is None:
        raise AssetError(f"asset '{uri}': robot_descriptions.{name} has neither URDF_PATH nor MJCF_PATH")
    root = getattr(module, "REPOSITORY_PATH", None) or getattr(module, "PACKAGE_PATH", None) or Path(path).parent
    return _inside(Path(root), str(Path(path).resolve()), uri)


def _folder_root(folder: Path) -> Path:
    """The root of an asset given by an absolute path.

    The nearest folder with a package.xml, else the file's own folder, or the one above where that is called urdf,
    robots, xml, mjcf, xacro or usd (meshes then lie in a folder beside it).
    """
    for candidate in (folder, *folder.parents):
        if (candidate / "package.xml").is_file():
            return candidate
    return folder.parent if folder.name in _MODEL_FOLDERS else folder


def _nearest(path: Path, root: Path) -> str:
    """`; the nearest file is …` for a missing path: by name in its folder, else anywhere under the root."""
    folder = path.parent
    siblings = sorted(p.name for p in folder.iterdir() if p.is_file()) if folder.is_dir() else []
    folded = {name.lower(): name for name in siblings}
    near = difflib.get_close_matches(path.name.lower(), list(folded), n=1, cutoff=0.6)
    if near:
        return f"; did you mean '{folded[near[0]]}' in the same folder?"
    if root.is_dir() and path.name:
        for candidate in islice(root.rglob(glob.escape(path.name)), _SEARCHED):
            if candidate.is_file():
                return f"; the nearest file is {candidate}"
    ancestor = next((p for p in path.parents if p.is_dir()), root)
    if ancestor.is_dir() and ancestor.is_relative_to(root):
        children = sorted(p.name for p in ancestor.iterdir())
        return f"{suggest(path.relative_to(ancestor).parts[0], children)}; {ancestor} has {listing(children, 8)}"
    return ""
