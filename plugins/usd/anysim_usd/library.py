"""The library usd-core, loaded when a USD file is read or written and not before, and kept to one thread."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import SimpleNamespace
from typing import Any

from anysim.errors import AssetError

_MODULES = ("Ar", "Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdLux", "UsdPhysics", "UsdShade", "UsdUtils", "Vt", "Work")


@cache
def pxr() -> Any:
    """The modules of usd-core that are used here, as attributes.

    Raises:
        AssetError: it is not installed.
    """
    try:
        package = __import__("pxr", fromlist=_MODULES)
        modules = {name: __import__(f"pxr.{name}", fromlist=[name]) for name in _MODULES}
    except ImportError as error:
        raise AssetError(
            f"USD files are read and written by the package usd-core, which is not here ({error}): "
            "pip install 'anysim-usd[usd]'"
        ) from error
    assert package is not None
    return SimpleNamespace(**modules)


@contextmanager
def quiet() -> Iterator[list[str]]:
    """One thread, and what the library warns of, which it would print, in a list that is filled at the end."""
    lib, told = pxr(), list[str]()
    before = lib.Work.GetConcurrencyLimit()
    lib.Work.SetConcurrencyLimit(1)
    delegate = lib.UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield told
    finally:
        told += [one.commentary for one in delegate.TakeUncoalescedDiagnostics()]
        del delegate
        lib.Work.SetConcurrencyLimit(before)
