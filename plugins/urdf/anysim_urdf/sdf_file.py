"""The trees of an SDF file: models, with those that they include, and the one that is meant."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

from anysim.assets.bounded_files import check, xml_root
from anysim.assets.uri import package_folders
from anysim.errors import AssetError, listing, suggest
from anysim_schemas.limits import MODEL_ELEMENTS, MODEL_INCLUDE_DEPTH, MODEL_INCLUDES

_PARTS = ("visual", "collision")


class SdfDocument(NamedTuple):
    """The <model> elements of a file, includes unfolded, by name; `version` as (1, 9)."""

    path: Path
    version: tuple[int, int]
    models: Mapping[str, Any]


def document(path: Path, root: Path, packages: Mapping[str, Path]) -> SdfDocument:
    """Read a file and what it includes.

    Raises:
        AssetError: a missing or damaged file, one that is no SDF, an include that leaves the folders or itself.
    """
    reader = _Reader(path, root, packages)
    element = reader.root_of(path)
    models: dict[str, Any] = {}
    for model in reader.unfolded(element, path, 0):
        if model.get("name") in models:
            raise AssetError(f"{path}:{model.sourceline}: two models have the name '{model.get('name')}'")
        models[model.get("name")] = model
    return SdfDocument(path, _version(path, element), models)


def chosen(document: SdfDocument, name: str) -> tuple[Any, str]:
    """The model that a name means, and the link of it that is its root; without a name the only one.

    `MODEL`, `MODEL::LINK`, or in a file of one model `LINK`.
    """
    models = document.models
    model, marker, link = name.partition("::")
    if model in models:
        return models[model], link
    if len(models) == 1 and (not name or not marker):
        return next(iter(models.values())), name
    if not models:
        raise AssetError(f"{document.path}: has no <model>")
    if name:
        raise AssetError(
            f"{document.path}: there is no model '{name}'{suggest(model, list(models))} (models: {listing(models, 8)})"
        )
    first = next(iter(models))
    raise AssetError(
        f"{document.path}: holds {len(models)} models, {listing(models, 6)}; name the one that is meant: "
        f"{document.path.name}#{first}"
    )


class _Reader:
    def __init__(self, path: Path, root: Path, packages: Mapping[str, Path]) -> None:
        self._path, self._root, self._packages = path, root.resolve(), packages
        self._elements = self._files = 0

    def root_of(self, path: Path) -> Any:
        element, data = xml_root(path)
        self._elements += data.count(b"<")
        check(self._path, MODEL_ELEMENTS, self._elements // 2)
        if element.tag != "sdf":
            raise AssetError(f"{path}: an SDF has the root element <sdf>, this one has <{element.tag}>")
        return element

    def unfolded(self, element: Any, path: Path, depth: int) -> Iterator[Any]:
        """The models of an <sdf>, also those in a <world>, with names, and with what they include in them."""
        for owner in (element, *element.findall("world")):
            for child in list(owner):
                if child.tag == "model":
                    self._open(child, path, depth)
                elif child.tag == "include":
                    child = self._included(child, path, depth)
                else:
                    continue
                if not child.get("name"):
                    raise AssetError(f"{path}:{child.sourceline}: a <model> has no name")
                yield child

    def _open(self, model: Any, path: Path, depth: int) -> None:
        """Put the models that a model includes in their place, and make references absolute."""
        for tag in _PARTS:
            for shape in model.findall(f"link/{tag}/geometry/mesh/uri"):
                text = (shape.text or "").strip()
                if "://" not in text and text:
                    shape.text = str(path.parent / text)
        for child in list(model):
            if child.tag == "include":
                model.replace(child, self._included(child, path, depth))
            elif child.tag == "model":
                self._open(child, path, depth)

    def _included(self, include: Any, path: Path, depth: int) -> Any:
        """The model of an <include>, with the name, the pose and the state that it gives it."""
        uri = (include.findtext("uri") or "").strip()
        where = f"{path}:{include.sourceline}"
        if depth >= MODEL_INCLUDE_DEPTH.value:
            raise AssetError(f"{self._path}: {MODEL_INCLUDE_DEPTH.sentence()}")
        self._files += 1
        check(self._path, MODEL_INCLUDES, self._files)
        file = self._file(uri, path, where)
        found = list(self.unfolded(self.root_of(file), file, depth + 1))
        if len(found) != 1:
            raise AssetError(f"{where}: includes '{uri}', which has {len(found)} models; expected one")
        model = deepcopy(found[0])
        if include.findtext("name"):
            model.set("name", include.findtext("name").strip())
        for tag in ("pose", "static"):
            if (own := include.find(tag)) is not None:
                for old in model.findall(tag):
                    model.remove(old)
                model.append(deepcopy(own))
        if include.findtext("placement_frame"):
            model.set("placement_frame", include.findtext("placement_frame").strip())
        return model

    def _file(self, uri: str, path: Path, where: str) -> Path:
        scheme, marker, rest = uri.partition("://")
        if not uri or "\0" in uri or (marker and scheme not in ("model", "package", "file")):
            raise AssetError(f"{where}: includes '{uri[:80]}'; expected model://NAME, package://NAME/… or a path")
        if scheme in ("model", "package") and marker:
            name, _, tail = rest.lstrip("/").partition("/")
            folders = package_folders(name, path.resolve(), self._root, self._packages)
            places = [(limit, folder / tail) for limit, folder in folders]
        else:
            places = [(self._root, path.parent / (rest if marker else uri))]
        for limit, place in places:
            try:
                file = _in_model_folder(place) if place.is_dir() else place
                if not file.is_file():
                    continue
            except OSError:
                continue
            if not file.resolve().is_relative_to(limit):
                raise AssetError(f"{where}: includes '{uri}', which leaves its folder {limit}: it is {file.resolve()}")
            return file.resolve()
        tried = listing(dict.fromkeys(str(place) for _, place in places), 4)
        raise AssetError(f"{where}: includes '{uri[:200]}', which does not exist (looked for: {tried[:600]})")


def _in_model_folder(folder: Path) -> Path:
    """The SDF file of a model's folder: what its model.config says, else model.sdf."""
    config = folder / "model.config"
    if config.is_file():
        element, _ = xml_root(config)
        names = [(one.text or "").strip() for one in element.findall("sdf")]
        if names and names[-1]:
            return folder / names[-1]
    return folder / "model.sdf"


def _version(path: Path, element: Any) -> tuple[int, int]:
    words = (element.get("version") or "").split(".")
    if len(words) != 2 or not all(word.isdecimal() and len(word) < 4 for word in words):
        raise AssetError(f'{path}: <sdf version="{(element.get("version") or "")[:20]}"> is no version such as 1.9')
    return int(words[0]), int(words[1])
