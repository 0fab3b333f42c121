"""Files of large ground: SAPIEN cooks what it reads from a file once a process, and arrays anew for each scene."""

import hashlib
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_sapien.shapes import ground_triangles

LARGE = 20_000
"""Triangles, which take 20 ms to cook. A scene is built at each reset; a million would take a second of it."""

_HEADER = """ply
format binary_little_endian 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {triangles}
property list uchar uint vertex_indices
end_header
"""


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Of this process; SAPIEN looks whether a file is there before it looks for what it has cooked."""
    return tempfile.TemporaryDirectory(prefix="anysim-sapien-")


def ground_files(world: World) -> dict[str, str]:
    """The files of the height fields and concave meshes that are large, by the names of their geoms."""
    found: dict[str, str] = {}
    for geom in world.geoms:
        arrays = ground_triangles(world, geom.shape)
        if arrays is not None and len(arrays[1]) >= LARGE:
            found[geom.name] = str(_written(*arrays))
    return found


def _written(vertices: Array, triangles: Array) -> Path:
    """The file of vertices (V, 3) float32 and triangles (T, 3) uint32, by what it holds."""
    name = hashlib.sha256(vertices.tobytes() + triangles.tobytes()).hexdigest()[:32]
    path = Path(_folder().name) / f"{name}.ply"
    if not path.exists():
        faces = np.empty(len(triangles), dtype=[("corners", "u1"), ("vertices", "<u4", 3)])
        faces["corners"], faces["vertices"] = 3, triangles
        header = _HEADER.format(vertices=len(vertices), triangles=len(triangles))
        path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + faces.tobytes())
    return path
