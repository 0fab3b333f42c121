"""USD files, composed within their folder: what a file refers to is looked at before anything is composed of it.

A layer may name others by sublayers, references and payloads, in any variant. Each must be a file of the root folder,
or of a package (.usdz) there; resolvers of other schemes are not asked. The prims that a composition has are counted
before, so that references of references cannot make a small file a large one.
"""

import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from anysim.assets.bounded_files import bounded, check
from anysim.errors import AssetError
from anysim_schemas.limits import (
    ASSET_BYTES,
    MESH_BYTES,
    MODEL_DEPTH,
    MODEL_ELEMENTS,
    MODEL_INCLUDE_DEPTH,
    MODEL_INCLUDES,
)
from anysim_usd.library import pxr, quiet

ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
_TOKENS = re.compile(
    rb"""'{3}.*?'{3}|"{3}.*?"{3}|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|\#[^\n]*|[\[({]|[\])}]""", re.DOTALL
)
_LISTS = ("explicitItems", "prependedItems", "appendedItems", "addedItems")


@contextmanager
def opened(path: Path, root: Path) -> Iterator[tuple[Any, list[str]]]:
    """The composed stage of a file, and what the library had to say of it.

    Raises:
        AssetError: a missing or damaged file, a reference that leaves `root`, more than the limits allow.
    """
    lib = pxr()
    with quiet() as warned:
        try:
            layers = _Layers(path, root.resolve())
            layers.check()
            stage = lib.Usd.Stage.Open(layers.top)
            errors = [str(error) for error in stage.GetCompositionErrors()]
        except (lib.Tf.ErrorException, UnicodeDecodeError) as error:
            raise AssetError(f"{path}: cannot be read as USD: {_short(error)}") from error
        told = [_plain(error) for error in errors]
        try:
            yield stage, told
        except (lib.Tf.ErrorException, UnicodeDecodeError) as error:
            raise AssetError(f"{path}: cannot be read as USD: {_short(error)}") from error
        finally:
            del stage, layers
    told += [line for line in map(_plain, warned) if line not in told]


class _Layers:
    """The layers that a file is composed of, each checked before the library reads it."""

    def __init__(self, path: Path, root: Path) -> None:
        self.path, self.root = path, root
        self.missing: list[str] = []
        self._bytes = 0
        self._layers: dict[str, Any] = {}
        self._targets: dict[tuple[str, str], str] = {}
        self._weights: dict[tuple[str, str], int] = {}
        self.top = self._open(path, str(path.resolve()), str(path), 0)

    def check(self) -> None:
        """Raises AssetError where something is missing, or the composition would have too many prims.

        What is missing here may not be looked for elsewhere: the library has search paths of its own.
        """
        if self.missing:
            raise AssetError(f"{self.path}: {self.missing[0]}")
        try:
            weight = self._weight(self.top, "/", ())
        except RecursionError:
            raise AssetError(f"{self.path}: {MODEL_DEPTH.sentence()}") from None
        if MODEL_ELEMENTS.exceeded(weight):
            raise AssetError(f"{self.path}: composed, it {MODEL_ELEMENTS.sentence(weight)}")

    # ------------------------------------------------------------------ reading

    def _open(self, file: Path, identifier: str, asked: str, depth: int) -> Any:
        """A layer by its resolved identifier, `file` or `file[inner]`, and all that it names."""
        lib = pxr()
        if identifier in self._layers:
            return self._layers[identifier]
        if depth > MODEL_INCLUDE_DEPTH.value:
            raise AssetError(f"{self.path}: {MODEL_INCLUDE_DEPTH.sentence()}")
        check(self.path, MODEL_INCLUDES, len(self._layers))
        self._look(file, identifier, asked)
        layer = lib.Sdf.Layer.FindOrOpen(identifier)
        if not layer:
            raise AssetError(
                f"{asked}: cannot be read as USD: it is damaged, or of a version that usd-core does not know"
            )
        self._layers[identifier] = layer
        for reference in filter(None, sorted(layer.GetCompositionAssetDependencies())):
            inner = self._resolved(layer, reference)
            if inner is not None:
                self._targets[identifier, reference] = inner
                self._open(Path(inner.partition("[")[0]), inner, inner, depth + 1)
        return layer

    def _look(self, file: Path, identifier: str, asked: str) -> None:
        """Refuse what the library's parser should not see."""
        data = bounded(file, MESH_BYTES)
        self._bytes += len(data)
        check(self.path, ASSET_BYTES, self._bytes)
        if data[:4] == b"PK\x03\x04":
            texts = list(_inside(file, identifier))
        elif data[:8] == b"PXR-USDC" or data[:5] == b"#usda":
            texts = [data]
        else:
            raise AssetError(
                f"{asked}: is no USD file: it begins with {data[:8]!r}, not with '#usda', 'PXR-USDC' or 'PK'"
            )
        for text in texts:
            if text[:5] == b"#usda":
                if _depth(text) > MODEL_DEPTH.value:
                    raise AssetError(f"{asked}: {MODEL_DEPTH.sentence()}")
                try:
                    text.decode("utf-8")
                except UnicodeDecodeError as error:
                    raise AssetError(
                        f"{asked}: is no UTF-8 from its byte {error.start} on; save it as UTF-8"
                    ) from error

    def _resolved(self, layer: Any, reference: str) -> str | None:
        """Where a reference of a layer leads; None, with a word in `missing`, where nothing is."""
        where = f"'{reference[:200]}'"
        if "`" in reference or "://" in reference or "\0" in reference:
            raise AssetError(
                f"{self.path}: refers to {where}; only paths of files are followed: no expressions, no servers"
            )
        lib = pxr()
        anchored = lib.Sdf.ComputeAssetPathRelativeToLayer(layer, reference)
        outer, _, inner = anchored.partition("[")
        home = Path(layer.identifier.partition("[")[0]).parent
        found = (home / outer).resolve()
        if not found.is_relative_to(self.root):
            raise AssetError(
                f"{self.path}: refers to {where}, which leaves the asset's root {self.root}: it is {found}; name the "
                "file through a folder that holds both"
            )
        if found.suffix.lower() not in ENDINGS:
            self.missing.append(f"refers to {where}, which is no USD file ({', '.join(ENDINGS)})")
            return None
        if not found.is_file():
            self.missing.append(f"refers to {where}, which does not exist (looked for: {found})")
            return None
        return f"{found}[{inner}" if inner else str(found)

    # ------------------------------------------------------------------ counting

    def _weight(self, layer: Any, path: str, above: tuple[tuple[str, str], ...]) -> int:
        """At most so many prims are at a path of a layer and its sublayers, with all that they refer to."""
        key = (layer.identifier, path)
        if key in above:
            return 1  # the library breaks circles itself
        if key not in self._weights:
            self._weights[key] = min(
                sum(self._own(layer, part, path, (*above, key)) for part in self._stack(layer, ())), 1 << 62
            )
        return self._weights[key]

    def _stack(self, layer: Any, above: tuple[str, ...]) -> Iterator[Any]:
        yield layer
        if len(above) < MODEL_INCLUDE_DEPTH.value and layer.identifier not in above:
            for reference in layer.subLayerPaths:
                if (target := self._target(layer, reference)) is not None:
                    yield from self._stack(target, (*above, layer.identifier))

    def _target(self, layer: Any, reference: str) -> Any:
        identifier = self._targets.get((layer.identifier, reference))
        return None if identifier is None else self._layers[identifier]

    def _own(self, base: Any, layer: Any, path: str, above: tuple[tuple[str, str], ...]) -> int:
        """At most so many prims are at a path of one layer of the stack of `base`, with all that they refer to."""
        key = (base.identifier, f"{layer.identifier} {path}")
        if key in self._weights:
            return self._weights[key]
        spec = layer.pseudoRoot if path == "/" else layer.GetPrimAtPath(path)
        if not spec:
            return 0
        if path != "/" and spec.HasInfo("clips"):
            raise AssetError(f"{self.path}: prim '{path}' has value clips, which are files; bake them into the stage")
        total = 1 + sum(self._own(base, layer, str(child.path), above) for child in spec.nameChildren)
        if path != "/":
            total += sum(self._variants(base, layer, spec, above)) + sum(self._arcs(base, layer, spec, above))
        self._weights[key] = min(total, 1 << 62)
        return total

    def _variants(self, base: Any, layer: Any, spec: Any, above: tuple[tuple[str, str], ...]) -> Iterator[int]:
        for variants in spec.variantSets.values():
            for one in variants.variants.values():
                yield self._own(base, layer, str(one.primSpec.path), above)

    def _arcs(self, base: Any, layer: Any, spec: Any, above: tuple[tuple[str, str], ...]) -> Iterator[int]:
        for arcs in (spec.referenceList, spec.payloadList):
            for arc in _items(arcs):
                target = self._target(layer, arc.assetPath) if arc.assetPath else base
                if target is not None:
                    yield self._weight(target, str(arc.primPath) if arc.primPath else f"/{target.defaultPrim}", above)
        for arcs in (spec.inheritPathList, spec.specializesList):
            for one in _items(arcs):
                yield self._weight(base, str(one), above)


def _items(arcs: Any) -> list[Any]:
    return [item for name in _LISTS for item in getattr(arcs, name)]


def _inside(file: Path, identifier: str) -> Iterator[bytes]:
    """The layers in a package that may be read."""
    try:
        with zipfile.ZipFile(file) as package:
            if MESH_BYTES.exceeded(sum(one.file_size for one in package.infolist())):
                raise AssetError(f"{identifier}: what is in it {MESH_BYTES.sentence()}")
            for one in package.infolist():
                if one.filename.lower().endswith(ENDINGS):
                    yield package.read(one)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, ValueError) as error:
        raise AssetError(f"{identifier}: cannot be read as a package: {error}") from error


def _depth(text: bytes) -> int:
    """How deep brackets of a text are nested."""
    deepest = depth = 0
    for found in _TOKENS.finditer(text):
        token = found[0]
        if token in b"[({":
            depth += 1
            deepest = max(deepest, depth)
        elif token in b"])}":
            depth -= 1
    return deepest


def _plain(words: str) -> str:
    return " ".join(str(words).split())[:300]


def _short(error: Exception) -> str:
    found = re.search(r"Error in '[^']*' at line \d+ in file \S+ : '(.*)'", str(error), re.DOTALL)
    return _plain(found[1] if found else str(error))
