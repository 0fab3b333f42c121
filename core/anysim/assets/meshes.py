"""Meshes for engines: convex hulls of few vertices to collide, light triangles in few colours to look at.

Processing is deterministic and cached; `Mesh.hash` is the digest of the source bytes, the processing version and its
parameters, never of the result, so that it is equal on all machines.
"""

import io
import json
import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import islice
from math import inf, nan
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from anysim import cache
from anysim.assets.bounded_files import bounded, check, mesh_bytes, plain_xml
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.geometry.triangles import FEW, convex_hull, decimated, enclosed_volume
from anysim.math import matrix as M
from anysim.model.world import Mesh, Vec3
from anysim_schemas.limits import MESH_BYTES, MESH_FACES

FORMATS = (".stl", ".obj", ".dae", ".glb", ".gltf", ".off", ".3mf", ".ply")
HULL_VERTICES = 64  # what PhysX takes in a convex mesh with margin; enough for grasping at millimetres
VISUAL_ERROR = 0.002  # [m] that what is looked at may be off
VISUAL_COLORS = 6
SMALL_BYTES = 256_000  # arrays of a mesh up to so large stay in memory
MATERIAL_FILES = 100  # of one .obj; what it names beyond is not read
LONGEST_PATH = 4096  # [characters] of a file that a mesh names: what Linux opens
_VERSION = "anysim-mesh-4"  # change with anything that changes the result
_UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
_ONE: Vec3 = (1.0, 1.0, 1.0)
Color = tuple[float, float, float, float]
_units: dict[str, float] = {}


class WholeMesh(NamedTuple):
    """What a convex hull was made of. `volume` [m^3] is that inside of its triangles, NaN where they are not closed."""

    volume: float
    mesh: Callable[[], Mesh]


class VisualPart(NamedTuple):
    """The triangles of one colour; `color` is None where the file says none."""

    mesh: Mesh
    color: Color | None


class _ColladaHead(NamedTuple):
    """The head of a .dae: metres in its unit, and the axis that points up, `X`, `Y` or `Z`."""

    metres: float = 1.0
    up: str = "Y"


class _Piece(NamedTuple):
    vertices: Array
    faces: Array
    color: Color | None


def collision_mesh(path: Path, scale: Vec3 = _ONE, *, upright: bool = False) -> Mesh:
    """The convex hull of a mesh file, at most `HULL_VERTICES` vertices. See `visual_parts` for the arguments."""
    key = _key(path, "hull", scale, upright, HULL_VERTICES)

    def make() -> dict[str, Array]:
        pieces = _load(path, scale, upright)
        _volume_of(key, lambda: _joined(pieces))
        vertices, faces = convex_hull(np.concatenate([piece.vertices for piece in pieces]), HULL_VERTICES)
        return {"vertices": vertices, "faces": faces}

    return _mesh(path.stem, key, _arrays(key, make))


def whole_of(path: Path, scale: Vec3 = _ONE, *, upright: bool = False) -> WholeMesh:
    """What `collision_mesh` made its hull of."""
    key = _key(path, "hull", scale, upright, HULL_VERTICES)
    volume = _volume_of(key, lambda: _joined(_load(path, scale, upright)))
    return WholeMesh(volume, lambda: whole_mesh(path, scale, upright=upright))


def whole_read(name: str, vertices: Array, faces: Array, source: str) -> WholeMesh:
    """What `hull_of` made its hull of, with its triangles (F, 3)."""
    key = cache.digest(_VERSION, "whole of", source)
    arrays = {"vertices": np.asarray(vertices, dtype=float), "faces": np.asarray(faces)}
    return WholeMesh(_volume_of(key, lambda: tuple(arrays.values())), lambda: _mesh(name, key, arrays))


def _joined(pieces: Sequence[_Piece]) -> tuple[Array, ...]:
    """The vertices (V, 3) and triangles (F, 3) of all pieces."""
    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces[:-1])])
    faces = [piece.faces + start for piece, start in zip(pieces, starts, strict=True)]
    return np.concatenate([piece.vertices for piece in pieces]), np.concatenate(faces)


def _volume_of(key: str, triangles: Callable[[], tuple[Array, ...]]) -> float:
    """[m^3] that the triangles of a key enclose; NaN where they are not closed."""
    key = cache.digest(key, "volume")
    return float(_arrays(key, lambda: {"volume": np.array(enclosed_volume(*triangles()))})["volume"])


def whole_mesh(path: Path, scale: Vec3 = _ONE, *, upright: bool = False) -> Mesh:
    """All triangles of a mesh file, with equal vertices joined. See `visual_parts` for the arguments."""
    key = _key(path, "whole", scale, upright)

    def make() -> dict[str, Array]:
        vertices, faces = _joined(_load(path, scale, upright))
        joined = decimated(vertices, faces, 0.0)
        return {"vertices": joined[0], "faces": joined[1]}

    return _mesh(path.stem, key, _arrays(key, make))


def hull_of(name: str, vertices: Array, source: str) -> Mesh:
    """The convex hull of vertices (V, 3) that some parser has read; `source` is a digest of where they come from."""
    key = cache.digest(_VERSION, "hull of", source, str(HULL_VERTICES))

    def make() -> dict[str, Array]:
        hull = convex_hull(np.asarray(vertices, dtype=float), HULL_VERTICES)
        return {"vertices": hull[0], "faces": hull[1]}

    return _mesh(name, key, _arrays(key, make))


def light_mesh(name: str, vertices: Array, faces: Array, source: str, *, error: float = VISUAL_ERROR) -> Mesh:
    """Triangles (V, 3), (F, 3) that some parser has read, as light as `error` [m] allows; `source` as in `hull_of`."""
    key = cache.digest(_VERSION, "visual of", source, repr(error))

    def make() -> dict[str, Array]:
        light = decimated(np.asarray(vertices, dtype=float), np.asarray(faces), error)
        return {"vertices": light[0], "faces": light[1]}

    return _mesh(name, key, _arrays(key, make))


def visual_parts(
    path: Path, scale: Vec3 = _ONE, *, upright: bool = False, error: float = VISUAL_ERROR
) -> tuple[VisualPart, ...]:
    """What a mesh file looks like: one mesh for each of its colours.

    Args:
        path: one of `FORMATS`. The unit that a .dae or .3mf declares is applied.
        scale: component-wise; a negative one mirrors.
        upright: turn files whose up axis is y (.glb, .gltf, and .dae that say so) to z up. References in a URDF do not
            want that: there the axes are taken as they are, whatever the file declares.
        error: [m] that the surface may be off, see `anysim.geometry.triangles`; 0 keeps every triangle.

    Raises:
        AssetError: an unknown format, a damaged file, no triangles.
    """
    key = _key(path, "visual", scale, upright, error, VISUAL_COLORS)

    def make() -> dict[str, Array]:
        arrays: dict[str, Array] = {}
        groups = _by_color(_load(path, scale, upright))
        total = sum(len(piece.faces) for piece in groups)
        for i, (vertices, faces, color) in enumerate(groups):
            few = max(60, FEW * len(faces) // total)
            arrays[f"{i}/vertices"], arrays[f"{i}/faces"] = decimated(vertices, faces, error, few)
            arrays[f"{i}/color"] = np.array(color if color is not None else (), dtype=float)
        return arrays

    stored = _arrays(key, make)
    parts: list[VisualPart] = []
    for i in range(len(stored) // 3):
        arrays = {name: stored[f"{i}/{name}"] for name in ("vertices", "faces")}
        color = stored[f"{i}/color"]
        mesh = _mesh(path.stem if i == 0 else f"{path.stem}_{i}", cache.digest(key, str(i)), arrays)
        rgba = (float(color[0]), float(color[1]), float(color[2]), float(color[3])) if len(color) else None
        parts.append(VisualPart(mesh, rgba))
    return tuple(parts)


def _arrays(key: str, make: Callable[[], dict[str, Array]]) -> dict[str, Array]:
    """Those of the cache. Small ones stay in memory for a while: a world is often compiled again."""
    kept = _kept(key)
    if kept:
        return kept
    arrays = cache.load_or_make("meshes", key, make)
    if sum(array.nbytes for array in arrays.values()) <= SMALL_BYTES:
        kept.update(arrays)
    return arrays


@lru_cache(maxsize=256)
def _kept(key: str) -> dict[str, Array]:
    """What stays in memory of an entry of the cache: nothing yet."""
    return {}


def _mesh(name: str, key: str, arrays: dict[str, Array]) -> Mesh:
    vertices = np.ascontiguousarray(arrays["vertices"], dtype=np.float64)
    faces = np.ascontiguousarray(arrays["faces"], dtype=np.int32)
    vertices.setflags(write=False)
    faces.setflags(write=False)
    return Mesh(name, vertices, faces, key)


def _key(path: Path, *parameters: object) -> str:
    """Of the file, the material file it names, and the processing."""
    if path.suffix.lower() not in FORMATS:
        raise AssetError(f"{path}: mesh files are {', '.join(FORMATS)}; '{path.suffix}' is not known")
    data = bounded(path, MESH_BYTES)
    materials = b"".join(bounded(file, MESH_BYTES) for file in _files_beside(path, data))
    key = cache.digest(_VERSION, path.suffix.lower(), data, materials, *(repr(p) for p in parameters))
    unit = _units[key] = _units.get(key) or _declared(path, data).metres
    return key if unit == 1.0 else cache.digest(key, repr(unit))


def _declared(path: Path, data: bytes) -> _ColladaHead:
    """What `<asset>` of a .dae says of the whole file; COLLADA's defaults, metres and y, where it says nothing.

    Read as XML and not by a pattern: quotes of either kind, blanks around `=` and comments are all in use.

    Raises:
        AssetError: no XML, XML that declares entities, a unit that is no positive number of metres.
    """
    if path.suffix.lower() != ".dae":
        return _ColladaHead()
    from lxml import etree

    try:
        plain_xml(data)
        events = etree.iterparse(
            io.BytesIO(data), ("end",), tag="{*}asset", resolve_entities=False, no_network=True, huge_tree=True
        )
        # parts of the file may have an `asset` of their own, which declares nothing of the rest
        asset = next((one for _, one in events if sum(1 for _ in one.iterancestors()) == 1), None)
    except (ValueError, etree.XMLSyntaxError) as error:
        raise AssetError(f"{path}: cannot be read as a mesh: {error}") from error
    if asset is None:
        return _ColladaHead()
    unit, up = asset.find("{*}unit"), asset.findtext("{*}up_axis", "").strip()
    said = "1" if unit is None else unit.get("meter", "1")
    try:
        metres = float(said)
    except ValueError:
        metres = nan
    if not 0.0 < metres < inf:
        raise AssetError(f"{path}: <unit meter='{said[:30]}'> is not the number of metres of its unit, such as 0.001")
    return _ColladaHead(metres, up[0] if up in ("X_UP", "Y_UP", "Z_UP") else "Y")


def _files_beside(path: Path, data: bytes) -> list[Path]:
    """What else a mesh is read from: the .mtl files of an .obj, the buffers of a .gltf, in its own folder."""
    if path.suffix.lower() != ".gltf":
        return _material_files(path, data)
    try:
        uris = [str(buffer.get("uri", "data:")) for buffer in json.loads(data).get("buffers", ())]
    except (ValueError, AttributeError, RecursionError) as error:
        raise AssetError(f"{path}: cannot be read as a mesh: {error}") from error
    here, asked = path.parent.resolve(), [unquote(uri) for uri in uris if not uri.startswith("data:")]
    if max(map(len, asked), default=0) > LONGEST_PATH:  # to resolve it would take seconds
        raise AssetError(f"{path}: a buffer cannot be found: its path is longer than {LONGEST_PATH} characters")
    try:
        files = [(here / name).resolve() for name in asked]
    except (ValueError, RuntimeError, OSError) as error:  # no name of a file, or a loop of symbolic links
        raise AssetError(f"{path}: a buffer cannot be found: {str(error)[:300]}") from error
    for file in files:
        if not file.is_relative_to(here):
            raise AssetError(f"{path}: a buffer lies outside of its folder: {str(file)[:300]}")
    return files


def _material_files(path: Path, data: bytes) -> list[Path]:
    """The .mtl files of an .obj that lie in its own folder."""
    if path.suffix.lower() != ".obj":
        return []
    found = islice(re.finditer(rb"^mtllib[ \t]+(.{1,300})$", data, re.MULTILINE), MATERIAL_FILES)
    files = [path.parent / Path(name[1].decode(errors="replace").strip()).name for name in found]
    return [file for file in dict.fromkeys(files) if file.is_file()]


def _load(path: Path, scale: Vec3, upright: bool) -> list[_Piece]:
    """The triangles of a file in metres, in its own axes or upright."""
    import trimesh
    from trimesh.resolvers import FilePathResolver

    data = mesh_bytes(path)
    kind = path.suffix.lower()
    buffers = _files_beside(path, data) if kind == ".gltf" else []

    class MaterialsOnly(FilePathResolver):
        """Serves the .mtl of the mesh's own folder, and buffers: textures are not used, no other file may be read."""

        def get(self, name: str) -> bytes:
            if (buffer := (path.parent / unquote(str(name))).resolve()) in buffers:
                return bounded(buffer, MESH_BYTES)
            file = path.parent / Path(str(name)).name
            if file.suffix.lower() != ".mtl":
                raise ValueError(f"'{name}' is not read")
            return bounded(file, MESH_BYTES)

    total = 0
    try:
        scene: Any = trimesh.load_scene(io.BytesIO(data), file_type=kind[1:], resolver=MaterialsOnly(str(path)))
        has_color = kind != ".obj" or bool(_material_files(path, data))
        pieces: list[_Piece] = []
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            geometry = scene.geometry[name]
            faces = np.asarray(getattr(geometry, "faces", ()), dtype=np.int64)
            total += len(faces)
            check(path, MESH_FACES, total)  # a geometry may be there many times
            if len(faces):
                if faces.min() < 0 or faces.max() >= len(geometry.vertices):
                    raise ValueError(f"a triangle has vertex {faces.max()} of {len(geometry.vertices)}")
                vertices = M.product(np.asarray(geometry.vertices, dtype=float), matrix[:3, :3].T) + matrix[:3, 3]
                mirrored = M.determinant(matrix[:3, :3]) < 0
                pieces.append(
                    _Piece(vertices, faces[:, ::-1] if mirrored else faces, _color(geometry) if has_color else None)
                )
    except AssetError:
        raise
    except ModuleNotFoundError as error:  # of what trimesh itself needs for some formats only
        raise AssetError(f"{path}: reading {kind} needs the package {error.name}: pip install {error.name}") from error
    except Exception as error:  # parsers of nine formats raise what they like
        raise AssetError(f"{path}: cannot be read as a mesh: {type(error).__name__}: {error}") from error
    if not pieces:
        raise AssetError(f"{path}: holds no triangles")
    if not all(np.isfinite(piece.vertices).all() for piece in pieces):
        raise AssetError(f"{path}: holds vertices that are not finite")
    unit, up = _declared(path, data)
    unit = _unit_of_3mf(path, scene.units or "millimeter") if kind == ".3mf" else unit
    turn = np.array(scale)[:, None] * (_upright(kind, up) if upright else np.eye(3)) * unit
    flip = M.determinant(turn) < 0
    return [_Piece(M.product(v, turn.T), f[:, ::-1] if flip else f, color) for v, f, color in pieces]


def _unit_of_3mf(path: Path, unit: str) -> float:
    """[m] of a unit; trimesh calls that of a file that names none "millimeters"."""
    singular = unit.removesuffix("s")
    if singular not in _UNITS:
        raise AssetError(f"{path}: its unit is '{unit}'; the units of a .3mf are {', '.join(_UNITS)}")
    return _UNITS[singular]


def _upright(kind: str, up: str) -> Array:
    """The turn (3, 3) to z up; a .glb or .gltf has y up, a .dae what it declares."""
    if kind in (".glb", ".gltf") or (kind == ".dae" and up == "Y"):
        return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    if kind == ".dae" and up == "X":
        return np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    return np.eye(3)


def _color(geometry: Any) -> Color | None:
    visual = geometry.visual
    if not getattr(visual, "defined", False):
        return None
    material = getattr(visual, "material", None)
    rgba = np.asarray(visual.main_color if material is None else material.main_color, dtype=float) / 255.0
    return (float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3]) if len(rgba) > 3 else 1.0)


def _by_color(pieces: list[_Piece]) -> list[_Piece]:
    """One piece a colour; of more than `VISUAL_COLORS`, the ones with fewest faces join the nearest of the others."""
    groups: dict[Color | None, list[_Piece]] = {}
    for piece in pieces:
        groups.setdefault(piece.color, []).append(piece)
    # an order of its own: that of the file is not kept by every parser
    ranked = sorted(groups, key=lambda c: (-sum(len(p.faces) for p in groups[c]), c or ()))
    kept = ranked[:VISUAL_COLORS]
    for color in ranked[VISUAL_COLORS:]:
        grey = np.array(color or (0.7, 0.7, 0.7, 1.0))
        nearest = min(kept, key=lambda c: float(np.abs(np.array(c or (0.7, 0.7, 0.7, 1.0)) - grey).sum()))
        groups[nearest] += groups.pop(color)
    merged: list[_Piece] = []
    for color in kept:
        members = groups[color]
        starts = np.cumsum([0, *(len(p.vertices) for p in members[:-1])])
        faces = np.concatenate([p.faces + start for p, start in zip(members, starts, strict=True)])
        merged.append(_Piece(np.concatenate([p.vertices for p in members]), faces, color))
    return merged
