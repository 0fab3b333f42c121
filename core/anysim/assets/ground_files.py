"""Heights and meshes from files. Nothing here unpickles anything."""

import io
import zipfile
from math import prod
from pathlib import Path
from typing import Any, cast

import numpy as np

from anysim.assets import meshes
from anysim.assets.bounded_files import bounded, check, opened_image
from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.model.ground import MeshGround
from anysim.model.world import Mesh
from anysim_schemas.limits import ARRAY_BYTES, GROUND_CELLS

ARRAYS = (".npy", ".npz")
IMAGES = (".png", ".tif", ".tiff", ".bmp", ".pgm", ".jpg", ".jpeg")


def read_heights(path: Path, height_range: tuple[float, float] | None) -> Array:
    """Heights (rows, cols) [m], first row at the lowest y: of an array as it is, of an image as seen from above.

    The top of an image has the highest y; black is the first of `height_range`, white the second.

    Raises:
        AssetError: not a file of heights; says why.
    """
    kind = path.suffix.lower()
    if kind in IMAGES:
        if height_range is None:
            raise AssetError(f"{path}: an image needs `height_range`, the heights of black and white [m]")
        grey = _image(path)
        return height_range[0] + (height_range[1] - height_range[0]) * grey[::-1]
    if kind not in ARRAYS:
        known = ", ".join((*ARRAYS, *IMAGES, *meshes.FORMATS))
        raise AssetError(f"{path}: '{path.suffix}' holds no heights ({known})")
    heights = _array(path)
    if heights.ndim != 2 or min(heights.shape) < 2 or heights.dtype.kind not in "fiu":
        shape = f"{heights.dtype} of shape {heights.shape}"
        raise AssetError(f"{path}: expected at least two rows of at least two numbers, it holds {shape}")
    heights = heights.astype(np.float64)
    if not np.isfinite(heights).all():
        raise AssetError(f"{path}: holds heights that are not finite")
    return heights


def _array(path: Path) -> Array:
    """The one array of a file, after its header said how large it is; of an archive, a member of stated size."""
    data = bounded(path, ARRAY_BYTES)
    try:
        if zipfile.is_zipfile(io.BytesIO(data)):
            data = _member(path, data)
        version = np.lib.format.read_magic(io.BytesIO(data))
        header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, _, _ = header[version](io.BytesIO(data[np.lib.format.MAGIC_LEN :]))
        check(path, GROUND_CELLS, prod(shape))
        loaded: Any = np.load(io.BytesIO(data), allow_pickle=False)
    except AssetError:
        raise
    except Exception as error:  # damaged archives and headers raise what they like
        raise AssetError(f"{path}: cannot be read as an array: {error}") from error
    return cast("Array", loaded)


def _member(path: Path, data: bytes) -> bytes:
    """The bytes of an archive's only array, or of the one called heights."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if len(members) != 1 and "heights" not in members:
            raise AssetError(f"{path}: expected one array, or one called heights; it has {listing(members)}")
        info = members.get("heights") or next(iter(members.values()))
        check(path, ARRAY_BYTES, info.file_size)
        return archive.read(info)


def _image(path: Path) -> Array:
    """Grey values (rows, cols) in [0, 1], the top row first."""
    with opened_image(path, GROUND_CELLS) as image:
        deep = image.mode.startswith(("I", "F"))
        values = np.asarray(image if deep else image.convert("L"), dtype=np.float64)
        whole = float(np.iinfo(np.uint16).max) if image.mode.startswith("I") else 1.0 if deep else 255.0
    if values.ndim != 2 or min(values.shape) < 2:
        raise AssetError(f"{path}: expected an image of at least 2 by 2 pixels, it has the shape {values.shape}")
    return np.clip(values / whole, 0.0, 1.0)


def read_mesh(path: Path, scale: float) -> Mesh:
    """All triangles of a mesh file, as they are, in metres with z up.

    Raises:
        AssetError: it cannot be read.
    """
    return meshes.whole_mesh(path, (scale, scale, scale), upright=True)


def heights_of_mesh(mesh: Mesh, cell: float) -> tuple[Array, tuple[float, float], tuple[float, float]]:
    """What a mesh looks like from above: heights (rows, cols) about `cell` [m] apart, their extent, and its middle.

    Places that the mesh does not cover get its lowest height.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    counts = [max(1, round(float(e) / cell)) for e in (high - low)[:2]]
    x, y = (np.linspace(low[k], high[k], counts[k] + 1) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    heights = MeshGround(np.asarray(mesh.vertices), np.asarray(mesh.faces)).heights_at(grid)
    heights = np.where(np.isfinite(heights), heights, low[2])
    extent, middle = (high - low)[:2], (high + low)[:2] / 2
    return heights, (float(extent[0]), float(extent[1])), (float(middle[0]), float(middle[1]))
