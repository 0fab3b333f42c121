"""The unit and the up axis that a COLLADA file (.dae) declares."""

import io
from math import inf, nan
from pathlib import Path
from typing import NamedTuple

from anysim.assets.mesh_budget import plain_xml
from anysim.errors import AssetError


class ColladaHead(NamedTuple):
    """The head of a file: metres in its unit, and the axis that points up, `X`, `Y` or `Z`."""

    metres: float = 1.0
    up: str = "Y"


def declared(path: Path, data: bytes) -> ColladaHead:
    """What `<asset>` says of the whole file; COLLADA's defaults, metres and y, where it says nothing.

    Read as XML and not by a pattern: quotes of either kind, blanks around `=` and comments are all in use.

    Raises:
        AssetError: no XML, XML that declares entities, a unit that is no positive number of metres.
    """
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
        return ColladaHead()
    unit, up = asset.find("{*}unit"), asset.findtext("{*}up_axis", "").strip()
    said = "1" if unit is None else unit.get("meter", "1")
    try:
        metres = float(said)
    except ValueError:
        metres = nan
    if not 0.0 < metres < inf:
        raise AssetError(f"{path}: <unit meter='{said[:30]}'> is not the number of metres of its unit, such as 0.001")
    return ColladaHead(metres, up[0] if up in ("X_UP", "Y_UP", "Z_UP") else "Y")
