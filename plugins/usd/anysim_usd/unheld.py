"""Notes of what a stage says and the neutral model does not hold.

`anysim_usd.coverage` has the fate of each type, schema and attribute; one that is left out, or not in it, is noted.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from anysim.assets.model import Fate, ImportNote
from anysim.errors import listing
from anysim_usd.coverage import JOINTS, attribute, schema
from anysim_usd.library import pxr
from anysim_usd.numbers import applied
from anysim_usd.structure import BASE, Structure

_HOLDERS = frozenset(("", "Xform", "Scope"))
_AROUND = frozenset(("PhysicsScene", "Camera", "Material", "Shader", "NodeGraph"))


def notes_of(
    structure: Structure, mine: Iterable[Any], materials: Mapping[str, Any], *, whole: bool
) -> list[ImportNote]:
    """A note for each kind of prim, schema and attribute that is there in vain, with how often and where.

    `mine` are the prims of the model, `materials` those that it is bound to; with `whole` the rest of the stage is
    looked at too, but for what other trees are made of.
    """
    prims = {str(prim.GetPath()): prim for prim in mine} | dict(materials)
    if whole:
        for prim in structure.prims:
            here = str(prim.GetPath())
            kind = str(prim.GetTypeName())
            if structure.owner[here] == BASE and kind not in JOINTS and not _is_shape(kind):
                prims.setdefault(here, prim)
        prims |= {str(prim.GetPath()): prim for prim in structure.prims if str(prim.GetTypeName()) in JOINTS}
    return told(line for prim in prims.values() for line in unread(prim))


def told(lines: Iterable[tuple[str, str, str]]) -> list[ImportNote]:
    """Notes of what is not read (what, why, of which prim), one for each kind."""
    found: dict[tuple[str, str], list[str]] = {}
    for what, why, owner in lines:
        found.setdefault((what, why), []).append(owner)
    return [
        ImportNote("dropped", what, f"{why} ({len(owners)}: {listing(dict.fromkeys(owners), 3)})")
        for (what, why), owners in found.items()
    ]


def unread(prim: Any, *, world: bool = False) -> Iterator[tuple[str, str, str]]:
    """What of a prim is not read, why, and its name; in a `world` lights, cameras and the scene are read."""
    kind, owner = str(prim.GetTypeName()), prim.GetName()
    row = schema(kind) if kind else None
    if kind and (row is None or row.fate is Fate.LEFT_OUT):
        yield f"prim {kind}", _left_out(row.text if row else "no type of prim that is known"), owner
        return
    if not world and (kind == "Camera" or kind.endswith("Light")):
        yield f"prim {kind}", "is left out: those of a world are its own", owner
        return
    for listed in applied(prim):
        name = listed.partition(":")[0]
        row = schema(name)
        if row is None or row.fate is Fate.LEFT_OUT:
            yield f"schema {name}", _left_out(row.text if row else "it is not known"), owner
    for found in prim.GetAuthoredProperties():
        yield from _property(prim, found, owner)


def _property(prim: Any, found: Any, owner: str) -> Iterator[tuple[str, str, str]]:
    name = str(found.GetName())
    row = attribute(name, str(prim.GetTypeName()))
    is_attribute = isinstance(found, pxr().Usd.Attribute)
    if is_attribute and row is not None and row.fate is not Fate.HARMLESS and found.ValueMightBeTimeVarying():
        yield f"time samples of {name}", "are left out but for the first", owner
    if row is not None and row.fate is not Fate.LEFT_OUT:
        return
    if is_attribute:
        if not found.HasAuthoredValue() and not found.HasAuthoredConnections():
            return
        usual = prim.GetPrimDefinition().GetAttributeFallbackValue(name)
        if usual is not None and found.Get() == usual:
            return
    elif not found.HasAuthoredTargets():
        return
    yield name, _left_out(row.text if row else "it is not known"), owner


def _left_out(why: str) -> str:
    return f"is left out: {why}" if why else "is left out"


def _is_shape(kind: str) -> bool:
    from anysim_usd.shapes import KINDS

    return kind in KINDS
