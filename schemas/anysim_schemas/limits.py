"""Budgets of all parsers: how many files, bytes, elements and levels an input may have before it is refused.

Whatever reads a file asks here, so that `docs/limits.md` is the whole truth and every refusal is the same sentence:
what was found, the limit, what the limit is for, and the remedy. The values are several times those of the largest
file of the catalogue, and a file at its limit is read within seconds and a gigabyte.
"""

from collections.abc import Sequence
from typing import NamedTuple

MIB = 1 << 20


class Limit(NamedTuple):
    """The largest amount that is accepted.

    Attributes:
        value: the amount.
        unit: what is counted.
        thing: in what it is counted.
        remedy: what to do about a larger one.
    """

    value: int
    unit: str
    thing: str
    remedy: str

    def sentence(self, found: int | None = None) -> str:
        """`has 9,000 bytes; the limit of a YAML file is 8,000 bytes: split it`; None says "more than the limit"."""
        amount = f"more than {self.value:,}" if found is None else f"{found:,}"
        return f"has {amount} {self.unit}; the limit of {self.thing} is {self.value:,} {self.unit}: {self.remedy}"

    def exceeded(self, found: int) -> bool:
        """Whether an amount is refused."""
        return found > self.value


_SPLIT = "split it, or generate what repeats with `count`"
YAML_BYTES = Limit(2 * MIB, "bytes", "a YAML file", _SPLIT)
YAML_VALUES = Limit(100_000, "values", "a YAML file", _SPLIT)
YAML_ALIASED = Limit(100_000, "values behind aliases", "a YAML file", "write fewer aliases")
YAML_DEPTH = Limit(100, "levels of mappings and lists", "a YAML file", "flatten it")
YAML_FILES = Limit(100, "files", "`extends` of one run", "extend fewer files")
JSON_BYTES = Limit(16 * MIB, "bytes", "a JSON file", "check that it is what a recorder wrote")
MODEL_BYTES = Limit(16 * MIB, "bytes of XML", "a model with all that it includes", "split the model")
MODEL_ELEMENTS = Limit(20_000, "elements", "a model with all that it includes and repeats", "split the model")
MODEL_DEPTH = Limit(256, "levels of elements", "a file of a model", "flatten the file")
MODEL_INCLUDES = Limit(200, "inclusions", "a model", "include fewer files")
MODEL_INCLUDE_DEPTH = Limit(20, "levels of inclusion", "a model", "include files more directly")
MODEL_SIZE = Limit(1_000, "entries", "a size that an MJCF file asks for", "ask for less")
MODEL_COMPOSITE = Limit(200, "parts", "a <composite> of an MJCF file", "use fewer parts")
MODEL_OCTREE = Limit(8, "levels", "an octree of an MJCF mesh", "use fewer levels")
SCENE_PARTS = Limit(200, "bodies that are objects", "a scene file", "join what stands still to one body")
MESH_BYTES = Limit(128 * MIB, "bytes", "a mesh file", "decimate the mesh")
MESH_FACES = Limit(600_000, "triangles", "a mesh file", "decimate the mesh")
MESH_NODES = Limit(20_000, "nodes", "the scene of a mesh file", "join its parts")
FOLDER_ENTRIES = Limit(
    10_000, "entries", "a folder of sources with all that its pattern looks into", "name a folder further down"
)
ASSET_BYTES = Limit(512 * MIB, "bytes of meshes", "a model", "decimate the meshes")
IMAGE_BYTES = Limit(128 * MIB, "bytes", "an image file", "make the image smaller")
IMAGE_PIXELS = Limit(8192 * 8192, "pixels", "an image", "make the image smaller")
GROUND_CELLS = Limit(4096 * 4096, "heights", "a ground or a heightfield", "use fewer rows and columns")
ARRAY_BYTES = Limit(256 * MIB, "bytes", "an array file, packed or not,", "use fewer rows and columns")
_FEWER = "write fewer envs into a file: snapshot.rows([...])"
SNAPSHOT_BYTES = Limit(1024 * MIB, "bytes", "a snapshot's file", _FEWER)
SNAPSHOT_HEADER_BYTES = Limit(32 * MIB, "bytes", "the header of a snapshot's file", _FEWER)
POLICY_BYTES = Limit(512 * MIB, "bytes", "a policy's model file", "use a smaller model")

_TABLE: Sequence[tuple[str, Sequence[Limit]]] = (
    ("YAML", (YAML_BYTES, YAML_VALUES, YAML_DEPTH, YAML_ALIASED, YAML_FILES)),
    ("JSON: manifests, runs, proposals", (JSON_BYTES,)),
    (
        "URDF and MJCF",
        (
            MODEL_BYTES,
            MODEL_ELEMENTS,
            MODEL_DEPTH,
            MODEL_INCLUDES,
            MODEL_INCLUDE_DEPTH,
            MODEL_SIZE,
            MODEL_COMPOSITE,
            MODEL_OCTREE,
        ),
    ),
    ("scenes: MJCF and SDF", (SCENE_PARTS,)),
    ("folders of sources", (FOLDER_ENTRIES,)),
    ("meshes: STL, OBJ, DAE, GLB, glTF, OFF, 3MF, PLY", (MESH_BYTES, MESH_FACES, MESH_NODES, ASSET_BYTES)),
    ("images", (IMAGE_BYTES, IMAGE_PIXELS)),
    ("arrays and heightfields", (ARRAY_BYTES, GROUND_CELLS)),
    ("snapshots and world states", (SNAPSHOT_BYTES, SNAPSHOT_HEADER_BYTES)),
    ("policies", (POLICY_BYTES,)),
)


def table() -> str:
    """All limits as a table in Markdown."""
    rows = ["| input | limit | of | when it is met |", "|---|---|---|---|"]
    for name, limits in _TABLE:
        rows += [f"| {name} | {x.value:,} {x.unit} | {x.thing.rstrip(',')} | {x.remedy} |" for x in limits]
    return "\n".join(rows) + "\n"
