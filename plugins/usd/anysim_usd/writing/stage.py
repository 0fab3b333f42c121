"""Attributes and prims of a USD file that is written: doubles where a schema takes them, and beside it where not."""

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim_usd.library import pxr


class StageWriter:
    """A layer in the making. Names that USD does not take are changed, and kept in `anysim:name`."""

    def __init__(self, name: str) -> None:
        lib = pxr()
        self.stage = lib.Usd.Stage.CreateInMemory()
        lib.UsdGeom.SetStageMetersPerUnit(self.stage, 1.0)
        lib.UsdGeom.SetStageUpAxis(self.stage, lib.UsdGeom.Tokens.z)
        lib.UsdPhysics.SetStageKilogramsPerUnit(self.stage, 1.0)
        self.types = lib.Sdf.ValueTypeNames
        self._taken: dict[str, set[str]] = {}
        self.root = self.define("/", name, "Xform")
        self.stage.SetDefaultPrim(self.root)

    def define(self, parent: str, name: str, kind: str) -> Any:
        """A prim below another, called so, or like it where USD does not take the name or has it already."""
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
        plain = plain if not plain[0].isdigit() else f"_{plain}"
        taken, free, count = self._taken.setdefault(parent, set()), plain, 0
        while free in taken:
            count += 1
            free = f"{plain}_{count}"
        taken.add(free)
        prim = self.stage.DefinePrim(f"{parent.rstrip('/')}/{free}", kind)
        if free != name:
            self.put(prim, "anysim:name", "String", name)
        return prim

    def put(self, prim: Any, name: str, kind: str, value: Any) -> None:
        """An attribute, which is of a schema where one knows the name, or else the file's own."""
        attribute = prim.GetAttribute(name)
        if not attribute:
            custom = name.partition(":")[0] == "anysim"
            attribute = prim.CreateAttribute(name, getattr(self.types, kind), custom)
        attribute.Set(value)

    def exact(self, prim: Any, name: str, value: float | Iterable[float]) -> None:
        """A number, or numbers, in double precision, in an attribute of anysim's own."""
        if isinstance(value, (int, float)):
            self.put(prim, f"anysim:{name}", "Double", float(value))
        else:
            self.put(prim, f"anysim:{name}", "DoubleArray", pxr().Vt.DoubleArray([float(v) for v in value]))

    def single(self, prim: Any, name: str, exact: str, value: float, unit: float = 1.0) -> None:
        """A number of single precision, divided by a unit, and the number itself beside it where digits are lost."""
        rough = float(value) / unit
        self.put(prim, name, "Float", rough)
        again = float(str(np.float32(rough))) * unit
        if exact and again != float(value):
            self.exact(prim, exact, value)

    def place(
        self, prim: Any, position: Iterable[float], quaternion: Iterable[float], size: Array | None = None
    ) -> None:
        """Where a prim is, in double precision; and how it is stretched."""
        lib = pxr()
        xyz, (x, y, z, w) = [float(v) for v in position], [float(v) for v in quaternion]
        form = lib.UsdGeom.Xformable(prim)
        double = lib.UsdGeom.XformOp.PrecisionDouble
        if any(xyz):
            form.AddTranslateOp(double).Set(lib.Gf.Vec3d(*xyz))
        if (x, y, z) != (0.0, 0.0, 0.0):
            form.AddOrientOp(double).Set(lib.Gf.Quatd(w, x, y, z))
        if size is not None:
            form.AddScaleOp(double).Set(lib.Gf.Vec3d(*[float(v) for v in size]))

    def apply(self, prim: Any, *schemas: str) -> None:
        """Apply schemas by name, also those that usd-core does not know."""
        for name in schemas:
            prim.AddAppliedSchema(name)

    def text(self) -> str:
        """The layer as a .usda file."""
        return self.stage.GetRootLayer().ExportToString()
