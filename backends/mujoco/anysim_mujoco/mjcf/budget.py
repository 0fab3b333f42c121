"""Budget of an MJCF file: where its references lead and how much it unfolds to, before MuJoCo reads it.

MuJoCo repeats, composes, includes and attaches while it parses, and opens what is referred to. All of that is counted
here from the XML alone; references that leave the root are refused.
"""

from math import isnan, prod
from pathlib import Path
from typing import Any

import mujoco

from anysim.assets.bounded_files import bounded, check, mesh_bytes, opened_image, xml_root
from anysim.assets.uri import resolve_reference
from anysim.errors import AssetError
from anysim_schemas.limits import (
    ASSET_BYTES,
    GROUND_CELLS,
    MESH_BYTES,
    MESH_FACES,
    MODEL_BYTES,
    MODEL_COMPOSITE,
    MODEL_ELEMENTS,
    MODEL_INCLUDE_DEPTH,
    MODEL_INCLUDES,
    MODEL_OCTREE,
    MODEL_SIZE,
)

_UNREAD = frozenset({"texture", "skin"})  # the importer takes them out before MuJoCo opens their files
_MESHES = frozenset({".stl", ".obj", ".msh"})
_SIZES = frozenset({"dim", "num", "nsample", "nkey", "nuserdata"})


class MjcfBudget:
    """A file with all that it includes and attaches, and what it may still be.

    Attributes:
        included: the files that are included, by how they are referred to.
    """

    def __init__(self, path: Path, root: Path) -> None:
        self.path, self.root = path, root
        self.included: dict[str, bytes] = {}
        self._files = self._bytes = self._elements = self._assets = 0

    def check(self) -> set[str]:
        """Walk the file and all that it includes and attaches; the files that its own elements name.

        Raises:
            AssetError: a reference that leaves the root or is missing, more than a limit, no XML.
        """
        return self._model(self.path, ())[1]

    def check_assets(self, spec: Any, path: Path, own: set[str]) -> None:
        """Where the meshes and heightfields of a parsed file lie, and how large they are; `own`, not those attached."""
        for kind, elements in (("mesh", spec.meshes), ("hfield", spec.hfields)):
            for element in elements:
                if element.file in own:
                    reference = Path(element.file).name if spec.strippath else element.file
                    asked_by = f"{kind} '{element.name or element.file}' of {path.name}"
                    full = str(Path(spec.meshdir) / reference)
                    self._asset(kind, resolve_reference(full, file=path, root=self.root, asked_by=asked_by))

    def _asset(self, kind: str, file: Path) -> None:
        if kind == "hfield" and file.suffix.lower() == ".png":
            with opened_image(file, GROUND_CELLS):
                return
        if kind == "hfield":
            data = bounded(file, MESH_BYTES)
            check(file, GROUND_CELLS, prod(int.from_bytes(data[i : i + 4], "little") for i in (0, 4)))
        elif file.suffix.lower() not in _MESHES:
            raise AssetError(f"{file}: MuJoCo reads the meshes {', '.join(sorted(_MESHES))}")
        else:
            data = mesh_bytes(file)
        self._assets += len(data)
        check(self.path, ASSET_BYTES, self._assets)

    def _model(self, path: Path, above: tuple[Path, ...]) -> tuple[int, set[str]]:
        """The elements that a model unfolds to, and the files it names, after a look at the models it attaches."""
        chain = (path, *above)
        tree = self._file(path, path, chain)
        if tree.tag != "mujoco":
            raise AssetError(f"{path}: an MJCF file has the root element <mujoco>, this one has <{tree.tag}>")
        sizes = [0]
        for element in tree.iterfind(".//model"):
            if self.path.suffix.lower() != ".xml":
                raise AssetError(f"{self.path}: MuJoCo attaches <model>s only to a file called .xml; rename it")
            found = self._reference(element, path, path, chain)
            if found.suffix.lower() != ".xml" or element.get("content_type"):
                raise AssetError(f"{path}: the <model> '{found.name}' must be an MJCF file called .xml")
            size, own = self._model(found, chain)
            self.check_assets(mujoco.MjSpec.from_file(str(found)), found, own)
            sizes.append(size)
        self._flexes(tree, path)
        named = {e.get("file") for e in tree.iter() if e.tag not in (*_UNREAD, "include", "model")}
        for element in tree.iter("mesh", "hfield", "flexcomp"):
            kind, name = element.get("content_type"), element.get("file") or ""
            if kind and not name.lower().endswith(f".{kind.rpartition('/')[2].lower()}"):
                raise AssetError(f"{path}: '{name}' is said to be '{kind}'; its ending must say so")
        return self._unfolded(tree, path, max(sizes)), {name for name in named if name}

    def _file(self, path: Path, main: Path, chain: tuple[Path, ...]) -> Any:
        """The tree of a file, what it includes put below each <include>."""
        self._files += 1
        check(self.path, MODEL_INCLUDES, self._files - 1)
        check(self.path, MODEL_INCLUDE_DEPTH, len(chain) - 1)
        root, data = xml_root(path)
        self._bytes += len(data)
        check(self.path, MODEL_BYTES, self._bytes)
        self._elements += sum(1 for _ in root.iter())
        check(self.path, MODEL_ELEMENTS, self._elements)
        for element in list(root.iter("include")):
            found = self._reference(element, path, main, chain)
            self.included[element.get("file") or ""] = bounded(found, MODEL_BYTES)
            element.extend(list(self._file(found, main, (found, *chain))))
        return root

    def _reference(self, element: Any, path: Path, main: Path, chain: tuple[Path, ...]) -> Path:
        asked_by = f"<{element.tag}> of {path.name}, line {element.sourceline},"
        found = resolve_reference(element.get("file") or "", file=main, root=self.root, asked_by=asked_by)
        if found in chain:
            raise AssetError(f"{asked_by} includes itself through '{found.name}'")
        return found

    def _flexes(self, tree: Any, path: Path) -> None:
        """The files of <flexcomp>, which MuJoCo reads while it parses, from a folder that any <compiler> may name."""
        folders = {"", *(c.get(key) or "" for c in tree.iter("compiler") for key in ("meshdir", "assetdir"))}
        for element in tree.iter("flexcomp"):
            for folder in folders if element.get("file") else ():
                name = f"<flexcomp> of {path.name}, line {element.sourceline}, refers to '{element.get('file')}'"
                try:
                    found = (path.parent / folder / (element.get("file") or "")).resolve()
                except (RuntimeError, OSError) as error:  # a loop of symbolic links, too long a name
                    raise AssetError(f"{name}, which cannot be found: {error}") from error
                if not found.is_relative_to(self.root):
                    raise AssetError(f"{name}, which leaves the asset's root {self.root}: it is {found}")
                if found.is_file():
                    mesh_bytes(found)

    def _unfolded(self, element: Any, path: Path, attached: int) -> int:
        """How many elements one unfolds to, itself included; `attached` is the size of the largest attached model."""
        _check_sizes(element, path)
        total = 1 + sum(self._unfolded(child, path, attached) for child in element)
        if element.tag == "attach":
            total += attached
        if element.tag in ("composite", "flexcomp"):
            parts = prod(max(1, n) for n in _whole(element, "count"))
            check(path, MODEL_COMPOSITE, parts)
            total += parts
        if element.tag == "replicate":
            times = max([1, *_whole(element, "count")])
            check(path, MODEL_SIZE, times)
            total *= times
        check(path, MODEL_ELEMENTS, total)
        return total


def _check_sizes(element: Any, path: Path) -> None:
    """The numbers for which MuJoCo sets memory aside."""
    for key in element.attrib:
        if key in _SIZES or key.startswith("nuser_"):
            check(path, MODEL_SIZE, max([0, *_whole(element, key)]))
    if element.tag == "hfield":
        check(path, GROUND_CELLS, prod(max([0, *_whole(element, key)]) for key in ("nrow", "ncol")))
    if element.tag == "mesh":
        check(path, MESH_FACES, 8 * max([0, *_whole(element, "params")]) ** 2)
        check(path, MODEL_OCTREE, max([0, *_whole(element, "octree_maxdepth")]))


def _whole(element: Any, key: str) -> list[int]:
    """The numbers of an attribute, rounded down; what is no number is left to MuJoCo."""
    found: list[int] = []
    for word in (element.get(key) or "").split():
        try:
            value = float(word)
        except ValueError:
            continue
        found.append(0 if isnan(value) else int(min(max(value, -1e18), 1e18)))
    return found
