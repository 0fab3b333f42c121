"""Size of a mesh file from its headers and words, before a parser spends time and memory on it."""

import json
import re
from itertools import islice
from pathlib import Path

from anysim.errors import AssetError
from anysim_schemas.files import RefusedFileError, read_plain
from anysim_schemas.limits import JSON_BYTES, MESH_BYTES, MESH_FACES, MESH_NODES, Limit

_ENCODINGS = frozenset({b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"latin1", b"windows-1252"})
_DAE_FACES = re.compile(
    # with a bound on what lies between, without which the time of the search is quadratic
    rb"""<(?:triangles|polylist|polygons|trifans|tristrips)\b[^>]{0,300}?count\s*=\s*["'](\d+)"""
)
_XML_ENCODING = re.compile(rb"""\s*<\?xml[^>]*?encoding\s*=\s*["']([^"']*)""")


def bounded(path: Path, limit: Limit) -> bytes:
    """The content of an asset's file.

    Raises:
        AssetError: it is missing, no plain file, or larger than the limit.
    """
    try:
        return read_plain(path, limit)
    except RefusedFileError as error:
        raise AssetError(f"{path}: {error.strerror}") from error
    except OSError as error:
        raise AssetError(f"{path}: cannot be read: {error}") from error


def check(path: Path, limit: Limit, found: int) -> None:
    """Raises AssetError where `found` exceeds a limit."""
    if limit.exceeded(found):
        raise AssetError(f"{path}: {limit.sentence(found)}")


def plain_encoding(data: bytes) -> bool:
    """Whether XML is in an encoding in which every parser finds the same elements and entities."""
    found = _XML_ENCODING.match(data.removeprefix(b"\xef\xbb\xbf"))
    return b"\0" not in data[:256] and (found is None or found[1].lower() in _ENCODINGS)


def plain_xml(data: bytes) -> None:
    """Raises ValueError where XML declares entities, or could hide them in its encoding."""
    if not plain_encoding(data):
        raise ValueError("its encoding is not UTF-8, in which XML entities could hide")
    if b"<!ENTITY" in data:
        raise ValueError("declares XML entities, which are not read")


def mesh_bytes(path: Path) -> bytes:
    """The content of a mesh file whose triangles and nodes are within their limits, as far as its words say.

    Raises:
        AssetError: see `bounded`; too many triangles or nodes, XML that declares entities, a damaged header.
    """
    data = bounded(path, MESH_BYTES)
    counts = {".stl": _stl, ".obj": _obj, ".ply": _ply, ".dae": _dae, ".glb": _glb, ".msh": _msh}
    count = counts.get(path.suffix.lower())
    try:
        faces, nodes = (0, 0) if count is None else count(data)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise AssetError(f"{path}: cannot be read as a mesh: {error}") from error
    check(path, MESH_FACES, faces)
    check(path, MESH_NODES, nodes)
    return data


def _stl(data: bytes) -> tuple[int, int]:
    claimed = int.from_bytes(data[80:84], "little")
    if 84 + 50 * claimed == len(data):
        return claimed, 0
    words = data.lower()
    return words.count(b"endfacet"), words.count(b"endsolid")


def _obj(data: bytes) -> tuple[int, int]:
    corners = 0
    for line in re.finditer(rb"^[ \t]*f[ \t][^\r\n]*", data, re.MULTILINE):
        corners += max(1, len(line[0].split()) - 3)
        if MESH_FACES.exceeded(corners):
            break
    points, groups = (
        sum(1 for _ in islice(re.finditer(pattern, data, re.MULTILINE), 3 * MESH_FACES.value + 3))
        for pattern in (rb"^[ \t]*v[ \t]", rb"^[ \t]*(?:usemtl|g|o)[ \t]")
    )
    return max(corners, points // 3), groups


def _ply(data: bytes) -> tuple[int, int]:
    head = data.partition(b"end_header")[0]
    return max((int(n) for n in re.findall(rb"element\s+\w+\s+(\d+)", head)), default=0), 0


def _msh(data: bytes) -> tuple[int, int]:
    numbers = [int.from_bytes(data[i : i + 4], "little", signed=True) for i in range(0, 16, 4)]
    if min(numbers) < 0:
        raise ValueError("its header has a negative count")
    return max(numbers[3], *(n // 3 for n in numbers[:3])), 0


def _glb(data: bytes) -> tuple[int, int]:
    length = int.from_bytes(data[12:16], "little")
    if JSON_BYTES.exceeded(length):
        raise ValueError(f"its JSON {JSON_BYTES.sentence(length)}")
    tree = json.loads(data[20 : 20 + length])
    sizes = [int(accessor.get("count", 0)) for accessor in tree.get("accessors", ())]
    return max(sizes, default=0) // 3, len(tree.get("nodes", ())) + len(sizes)


def _dae(data: bytes) -> tuple[int, int]:
    plain_xml(data)
    faces = sum(int(one[1][:18]) for one in _DAE_FACES.finditer(data))
    return faces, _instances(data) if b"instance_node" in data else data.count(b"<node")


def _instances(data: bytes) -> int:
    """Nodes of the scene with all instances of nodes unfolded."""
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    tree = etree.fromstring(data, parser)
    named = {node.get("id"): node for node in tree.iter("{*}node") if node.get("id")}
    sizes: dict[str, int] = {}

    def size(name: str, above: tuple[str, ...]) -> int:
        if name in above or len(above) > 100:
            raise ValueError(f"the node '{name}' contains itself, or nodes more than 100 deep")
        if name not in sizes and name in named:
            inner = named[name].iter("{*}instance_node")
            sizes[name] = 1 + sum(size((one.get("url") or "").lstrip("#"), (*above, name)) for one in inner)
        return sizes.get(name, 1)

    scene = [one for part in tree.iter("{*}library_visual_scenes") for one in part.iter("{*}instance_node")]
    return data.count(b"<node") + sum(size((one.get("url") or "").lstrip("#"), ()) for one in scene)
