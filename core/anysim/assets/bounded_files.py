"""Files of assets, read within their limits: bytes, images, XML, and meshes by their headers and words.

What a parser would spend time and memory on is refused before the parser runs.
"""

import io
import json
import re
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from anysim.errors import AssetError
from anysim_schemas.files import RefusedFileError, read_plain
from anysim_schemas.limits import (
    IMAGE_BYTES,
    IMAGE_PIXELS,
    JSON_BYTES,
    MESH_BYTES,
    MESH_FACES,
    MESH_NODES,
    MODEL_BYTES,
    MODEL_DEPTH,
    MODEL_ELEMENTS,
    Limit,
)

_ENCODINGS = frozenset({b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"latin1", b"windows-1252"})
_DAE_FACES = re.compile(
    # with a bound on what lies between, without which the time of the search is quadratic
    rb"""<(?:triangles|polylist|polygons|trifans|tristrips)\b[^>]{0,300}?count\s*=\s*["'](\d+)"""
)
_XML_ENCODING = re.compile(rb"""\s*<\?xml[^>]*?encoding\s*=\s*["']([^"']*)""")
_DECLARATION = re.compile(rb"""<\?xml\s+version\s*=\s*["'][^"'?]*["']([^?>]*)\?>""")
_IMAGE_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM", "GIF", "WEBP", "TGA")
"""Others run programs (EPS) or have parsers without maintainers."""


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


@contextmanager
def opened_image(path: Path, limit: Limit = IMAGE_PIXELS) -> Iterator[Any]:
    """An image (`PIL.Image.Image`) of at most `limit` pixels, not decoded yet.

    Raises:
        AssetError: no plain file, too large, or no image; also for what decoding in the `with` block raises.
    """
    from PIL import Image

    data = bounded(path, IMAGE_BYTES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(data), formats=_IMAGE_FORMATS)
        with image:
            check(path, limit, image.width * image.height)
            yield image
    except AssetError:
        raise
    except Image.DecompressionBombError as error:
        raise AssetError(f"{path}: {limit.sentence()}") from error
    except Exception as error:  # decoders of eight formats raise what they like
        raise AssetError(
            f"{path}: cannot be read as an image ({type(error).__name__}); expected PNG, JPEG, TIFF or BMP"
        ) from error


def _declared(found: re.Match[bytes]) -> bytes:
    """An XML declaration of version 1.0 at the beginning, elsewhere spaces."""
    return b'<?xml version="1.0"' + found[1] + b"?>" if found.start() == 0 else b" " * len(found[0])


def xml_root(path: Path) -> tuple[Any, bytes]:
    """The root element (`lxml.etree`) of a file without comments, entities and DTDs; and the file's bytes.

    Files in use declare versions of XML that there are not, or begin with something else: neither counts.

    Raises:
        AssetError: see `bounded`; not well-formed, a document type declaration, an encoding that hides elements, too
            many elements or levels.
    """
    from lxml import etree

    data = bounded(path, MODEL_BYTES).rstrip(b"\0 \t\r\n")
    parser = etree.XMLParser(
        resolve_entities=False, load_dtd=False, no_network=True, huge_tree=False, remove_comments=True, remove_pis=True
    )
    if not plain_encoding(data):
        raise AssetError(f"{path}: its encoding is not UTF-8; save it as UTF-8")
    check(path, MODEL_ELEMENTS, len(re.findall(rb"<[A-Za-z_]", data)))
    try:
        root = etree.fromstring(_DECLARATION.sub(_declared, data), parser)
    except etree.XMLSyntaxError as error:
        if "Excessive depth" in str(error):
            raise AssetError(f"{path}: {MODEL_DEPTH.sentence()}") from error
        raise AssetError(f"{path}: not well-formed XML: {error.msg}") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise AssetError(f"{path}: has a document type declaration (entities), which a model does not need")
    return root, data


def mesh_bytes(path: Path) -> bytes:
    """The content of a mesh file whose triangles and nodes are within their limits, as far as its words say.

    Raises:
        AssetError: see `bounded`; too many triangles or nodes, XML that declares entities, a damaged header.
    """
    data = bounded(path, MESH_BYTES)
    counts = {".stl": _stl, ".obj": _obj, ".ply": _ply, ".dae": _dae, ".glb": _glb, ".msh": _msh}
    counts |= {".gltf": _gltf, ".off": _off, ".3mf": _3mf}
    count = counts.get(path.suffix.lower())
    try:
        faces, nodes = (0, 0) if count is None else count(data)
    except AssetError:
        raise
    except Exception as error:  # a damaged archive alone raises six kinds
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
    return _gltf(data[20 : 20 + length])


def _gltf(data: bytes) -> tuple[int, int]:
    tree = json.loads(data)
    sizes = [int(accessor.get("count", 0)) for accessor in tree.get("accessors", ())]
    return max(sizes, default=0) // 3, len(tree.get("nodes", ())) + len(sizes)


def _off(data: bytes) -> tuple[int, int]:
    words = re.sub(rb"#[^\r\n]*", b"", data[:4096]).split()
    numbers = [int(word) for word in words[1 if words[:1] and not words[0].isdigit() else 0 :][:2]]
    if len(numbers) < 2 or min(numbers) < 0:
        raise ValueError("it has no count of vertices and faces")
    return max(numbers[1], numbers[0] // 3, data.count(b"\n") // 4), 0


def _3mf(data: bytes) -> tuple[int, int]:
    """Triangles and parts of the models in the package; what it unpacks to is within the limit of a mesh file."""
    with zipfile.ZipFile(io.BytesIO(data)) as package:
        if MESH_BYTES.exceeded(sum(one.file_size for one in package.infolist())):
            raise ValueError(f"what is in it {MESH_BYTES.sentence()}")
        models = [one for one in package.infolist() if one.filename.lower().endswith(".model")]
        texts = [package.open(one).read(MESH_BYTES.value + 1) for one in models]
    for text in texts:
        plain_xml(text)
        if b"component" in text:
            raise ValueError("its objects are made of other objects, which is not read; export it as one mesh")
    return sum(text.count(b"triangle ") for text in texts), sum(text.count(b"<item") for text in texts)


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
