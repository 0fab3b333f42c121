"""Numbers of attributes, in double precision where the file holds them so.

Most attributes of UsdPhysics are of single precision. Such a number is read as the shortest decimal that rounds to it,
which is what was written where it had seven digits. What anysim itself writes has every digit in an attribute
`anysim:NAME` beside it, which is believed as long as it says the same: another program may have changed the first.
"""

from math import inf, isinf
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim_usd.library import pxr

DIRECTIONS = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
SAME = 2e-6
"""Relative difference of two numbers of which one has been through single precision, or through degrees of such."""


def get(prim: Any, name: str) -> Any:
    """The first value of an attribute, authored or of the schema; None without one."""
    attribute = prim.GetAttribute(name)
    return attribute.Get(pxr().Usd.TimeCode.EarliestTime()) if attribute else None


def applied(prim: Any) -> list[str]:
    """The schemas that are applied to a prim, those of other programs among them."""
    return list(map(str, prim.GetPrimTypeInfo().GetAppliedAPISchemas()))


def authored(prim: Any, name: str) -> bool:
    """Whether a file says it."""
    attribute = prim.GetAttribute(name)
    return bool(attribute) and attribute.HasAuthoredValue()


def plain(value: Any, *, single: bool = True) -> float:
    """A number; one of single precision as the shortest decimal that rounds to it."""
    return float(str(np.float32(value))) if single else float(value)


def real(prim: Any, name: str, otherwise: float) -> float:
    """The number of an attribute."""
    value = get(prim, name)
    if value is None or isinstance(value, str):
        return otherwise
    kind = prim.GetAttribute(name).GetTypeName()
    return plain(value, single=kind in ("float", "half"))


def given(prim: Any, name: str) -> float | None:
    """The number of an attribute that a file says; None where none does."""
    return real(prim, name, 0.0) if authored(prim, name) else None


def vector(prim: Any, name: str, otherwise: tuple[float, ...]) -> Array:
    """The numbers of a vector."""
    value = get(prim, name)
    if value is None:
        return np.array(otherwise)
    single = str(prim.GetAttribute(name).GetTypeName()).rstrip("234[]")[-1:] in ("f", "h") or "float" in str(
        prim.GetAttribute(name).GetTypeName()
    )
    return np.array([plain(v, single=single) for v in value])


def quaternion(prim: Any, name: str) -> Array:
    """A unit quaternion (4,) xyzw; the identity for one of length 0."""
    value = get(prim, name)
    if value is None:
        return np.array([0.0, 0.0, 0.0, 1.0])
    single = str(prim.GetAttribute(name).GetTypeName()) != "quatd"
    parts = [plain(v, single=single) for v in (*value.GetImaginary(), value.GetReal())]
    length = float(np.linalg.norm(parts))
    return np.array(parts) / length if length > 0 else np.array([0.0, 0.0, 0.0, 1.0])


def same(exact: Array | float, rough: Array | float, *, least: float = 0.0) -> bool:
    """Whether exact numbers are those that rough ones were rounded from; `least` is a size that counts as none."""
    one, other = np.atleast_1d(np.asarray(exact, dtype=float)), np.atleast_1d(np.asarray(rough, dtype=float))
    if one.shape != other.shape:
        return False
    endless = np.isinf(one) | np.isinf(other)
    if (one[endless] != other[endless]).any():
        return False
    one, other = one[~endless], other[~endless]
    size = np.maximum(np.maximum(np.abs(one), np.abs(other)).max(initial=0.0), least)
    return bool((np.abs(one - other) <= SAME * size).all())


def exact(prim: Any, name: str, rough: float) -> float:
    """The number `anysim:NAME`, where it is there and says the same as the rough one."""
    found = given(prim, f"anysim:{name}")
    return found if found is not None and same(found, rough) else rough


def exact_vector(prim: Any, name: str, rough: Array, least: float = 0.0) -> Array:
    """The numbers `anysim:NAME`, where they are there and say the same as the rough ones."""
    value = get(prim, f"anysim:{name}")
    if value is None:
        return rough
    found = np.array([float(v) for v in value])
    return found if same(found, rough, least=least) else rough


def bound(value: float | None) -> float:
    """A limit of effort or speed: none where it is not there, is 0, or as large as single precision goes."""
    if value is None or not value > 0 or isinf(value) or value >= 3.4e38:
        return inf
    return value


def directions(prim: Any) -> list[tuple[str, float, float]]:
    """The directions that a joint without a type of its own leaves free, with their limits in units of the file."""
    found = []
    for name in DIRECTIONS:
        low, high = (real(prim, f"limit:{name}:physics:{end}", way * inf) for end, way in (("low", -1), ("high", 1)))
        if low < high:
            found.append((name, low, high))
    return found
