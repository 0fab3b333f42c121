"""The robot catalogue: entries of the group `anysim.robots`, each a package with NAME.yaml."""

from importlib import metadata, util
from pathlib import Path
from typing import NamedTuple

from anysim import registry
from anysim.assets.uri import EXAMPLE_ROBOT_DATA
from anysim.errors import PluginError
from anysim.math.arrays import shown
from anysim_schemas.files import exists
from anysim_schemas.robot_model import RobotModelSpec


class CatalogueEntry(NamedTuple):
    """A robot of the catalogue: its spec, and the file it was read from (relative assets are relative to it)."""

    spec: RobotModelSpec
    file: Path


def load_robot(name: str) -> CatalogueEntry:
    """A robot of the catalogue by name (or `dist:name`). The package is found, not imported.

    A name that ends with `.yaml` is a file with an entry that is not installed (yet).

    Raises:
        PluginError: unknown (lists what is installed), or there is no such file.
        SpecError: the file is not a valid RobotModelSpec.
    """
    if name.endswith((".yaml", ".yml")):
        file = Path(name)
        if not exists(file):
            raise PluginError(f"there is no file {shown(name)} with the entry of a robot (looked in {Path.cwd()})")
        return CatalogueEntry(_read(file), file)
    entry = registry.entry("robots", name)
    package = entry.value
    with registry.using("robots", name):  # imports what the package is in, if it is in one
        spec = util.find_spec(package)
    folders = [Path(folder) for folder in (spec.submodule_search_locations or [])] if spec is not None else []
    for folder in folders:
        file = folder / f"{entry.name}.yaml"
        if file.is_file():
            return CatalogueEntry(_read(file), file)
    raise PluginError(
        f"the robot '{name}' should be in {entry.name}.yaml of the package {package}, which has no such file"
    )


def _read(file: Path) -> RobotModelSpec:
    from anysim_schemas.load import load

    return load(RobotModelSpec, file).spec


def missing_source(entry: CatalogueEntry) -> str:
    """What is not installed of the files that a robot needs, and what to do; empty where all is there."""
    spec = entry.spec
    for source in (spec.source, *(part.source for part in spec.parts)):
        lacking = _lacking(source)
        if lacking:
            package = spec.needs or lacking
            return f"its files come with the package {lacking}, which is not installed: pip install '{package}'"
    return ""


def _lacking(source: str) -> str:
    """The package that a source needs and that is not there, or nothing."""
    scheme, colon, rest = source.partition(":")
    if not colon:
        return ""
    if scheme == EXAMPLE_ROBOT_DATA:
        try:
            metadata.distribution(EXAMPLE_ROBOT_DATA)
        except metadata.PackageNotFoundError:
            return EXAMPLE_ROBOT_DATA
    package = rest.partition("/")[0] if scheme == "package" else scheme if scheme == "robot_descriptions" else ""
    return package if package.isidentifier() and util.find_spec(package) is None else ""
