"""Colours and surfaces of shapes, from bound materials and from what a shape says itself."""

from dataclasses import replace
from typing import Any

import numpy as np

from anysim.assets.model import ImportNote
from anysim.model.world import Surface
from anysim_usd.library import pxr
from anysim_usd.numbers import authored, given, plain
from anysim_usd.space import Space

GREY = (0.7, 0.7, 0.7, 1.0)
_COLORS = ("inputs:diffuseColor", "inputs:diffuse_color_constant")
_OPACITIES = ("inputs:opacity", "inputs:opacity_constant")
Rgba = tuple[float, float, float, float]


class LookReader:
    """Reads what shapes look and feel like; each material is told of once."""

    def __init__(self, space: Space, notes: list[ImportNote]) -> None:
        self._space, self._notes = space, notes
        self.materials: dict[str, Any] = {}
        """The prims of materials that were met, by path."""
        self._colors: dict[str, Rgba | None] = {}
        self._surfaces: dict[str, Surface] = {}

    def bound(self, prim: Any, purpose: str = "") -> Any:
        """The material that is bound to a prim for a purpose; None without one."""
        shade = pxr().UsdShade
        binding = shade.MaterialBindingAPI(prim)
        found, _ = binding.ComputeBoundMaterial(purpose) if purpose else binding.ComputeBoundMaterial()
        if not found:
            return None
        self.materials[str(found.GetPath())] = found.GetPrim()
        return found

    # ------------------------------------------------------------------ colours

    def color(self, prim: Any) -> Rgba:
        """The colour of a shape: of its material, else its own, else grey."""
        material = self.bound(prim)
        own = None if material is None else self._of_material(material)
        if own is not None:
            return own
        tint, clear = (self._mean(prim, f"primvars:display{what}") for what in ("Color", "Opacity"))
        if tint is None:
            tint = np.array(GREY[:3])
        alpha = 1.0 if clear is None else float(clear[0])
        red, green, blue = (_unit(v) for v in tint)
        return (red, green, blue, _unit(alpha))

    def _mean(self, prim: Any, name: str) -> Any:
        primvar = pxr().UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasValue():
            return None
        value = primvar.ComputeFlattened(pxr().Usd.TimeCode.EarliestTime())
        values = np.array(value, dtype=float).reshape(-1, 3 if name.endswith("Color") else 1)
        if not len(values) or not np.isfinite(values).all():
            return None
        if (values != values[0]).any():
            self._notes.append(ImportNote("info", f"prim '{prim.GetName()}'", "has several colours; the mean is seen"))
            return values.mean(axis=0)
        return np.array([plain(v) for v in values[0]])

    def _of_material(self, material: Any) -> Rgba | None:
        path = str(material.GetPath())
        if path not in self._colors:
            self._colors[path] = self._shaded(material)
        return self._colors[path]

    def _shaded(self, material: Any) -> Rgba | None:
        """The colour of a material's shader; None where it has none that is plain."""
        for context in ("", "mdl"):
            shader, _, _ = material.ComputeSurfaceSource(context)
            if shader:
                break
        else:
            return None
        prim = shader.GetPrim()
        self.materials[str(prim.GetPath())] = prim
        name = next((name for name in _COLORS if prim.GetAttribute(name)), _COLORS[0])
        source = self._source(prim, name)
        if source is None:
            where = f"material '{material.GetPrim().GetName()}'"
            self._notes.append(
                ImportNote("dropped", where, "has a texture, which is left out: surfaces have plain colours")
            )
            return None
        value = source.Get(pxr().Usd.TimeCode.EarliestTime()) if source else None
        if value is None:
            return None if str(shader.GetIdAttr().Get()) != "UsdPreviewSurface" else (0.18, 0.18, 0.18, 1.0)
        alpha = next((given(prim, key) for key in _OPACITIES if authored(prim, key)), None)
        red, green, blue = (_unit(plain(v)) for v in value)
        return (red, green, blue, 1.0 if alpha is None else _unit(alpha))

    @staticmethod
    def _source(prim: Any, name: str) -> Any:
        """The attribute that gives an input its value: its own, or one of the material; None where it is a texture."""
        lib = pxr()
        given_by = lib.UsdShade.Input(prim.GetAttribute(name))
        if not given_by:
            return prim.GetAttribute(name)
        found = list(given_by.GetValueProducingAttributes())
        if not found:
            return prim.GetAttribute(name)
        return found[0] if lib.UsdShade.Input.IsInput(found[0]) else None

    # ------------------------------------------------------------------ surfaces

    def surface(self, prim: Any) -> Surface:
        """How a shape touches: by its physics material, and with the offset of PhysX of its own."""
        material = self.bound(prim, "physics")
        found = Surface()
        if material is not None and material.GetPrim().HasAPI(pxr().UsdPhysics.MaterialAPI):
            path = str(material.GetPath())
            if path not in self._surfaces:
                self._surfaces[path] = self._touching(material.GetPrim())
            found = self._surfaces[path]
        offset = given(prim, "physxCollision:contactOffset")
        if offset is not None and 0 <= offset < 1e6:
            found = replace(found, contact_offset=offset * self._space.metres)
        return found

    def _touching(self, prim: Any) -> Surface:
        where = f"material '{prim.GetName()}'"
        slides, holds = (given(prim, f"physics:{kind}Friction") for kind in ("dynamic", "static"))
        if slides is not None and holds is not None and slides != holds:
            self._notes.append(
                ImportNote("info", where, f"holds by {holds:g} and slides by {slides:g}; its friction is the second")
            )
        friction = slides if slides is not None else holds
        twist, roll = (given(prim, f"newton:{kind}Friction") for kind in ("torsional", "rolling"))
        usual = Surface()
        return Surface(
            friction=max(0.0, friction or 0.0),
            restitution=_unit(given(prim, "physics:restitution") or 0.0),
            torsional_friction=usual.torsional_friction if twist is None else max(0.0, twist),
            rolling_friction=usual.rolling_friction if roll is None else max(0.0, roll),
            torsional=bool(twist),
        )

    def density(self, prim: Any) -> float | None:
        """The density that the physics material of a shape has, in units of the file."""
        material = self.bound(prim, "physics")
        found = None if material is None else given(material.GetPrim(), "physics:density")
        return found or None


def _unit(value: float) -> float:
    return min(1.0, max(0.0, float(value)))
