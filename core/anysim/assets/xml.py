"""XML of models, parsed safely and within a budget of bytes, elements and levels."""

import re
from pathlib import Path
from typing import Any

from anysim.assets.mesh_budget import bounded, check, plain_encoding
from anysim.errors import AssetError
from anysim_schemas.limits import MODEL_BYTES, MODEL_DEPTH, MODEL_ELEMENTS

_DECLARATION = re.compile(rb"""<\?xml\s+version\s*=\s*["'][^"'?]*["']([^?>]*)\?>""")


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
