"""Places of prims in metres and with z up, whatever a stage measures in."""

from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from anysim.assets.model import ImportNote
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim_usd.library import pxr

IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
_UP = {"Z": np.eye(3), "Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}
_STRAIGHT = 1e-6  # how far from right angles axes may be that are only stretched
_LONG = 1e-9


class Placement:
    """An affine map (3, 4) from a prim's own coordinates, lengths in metres, to the world, z up."""

    def __init__(self, linear: Array, position: Array) -> None:
        self.linear, self.position = linear, position
        lengths = np.linalg.norm(linear, axis=0)
        safe = np.where(lengths > _LONG, lengths, 1.0)
        axes = linear / safe
        if np.linalg.det(axes) < 0:
            axes, lengths = axes * [1.0, 1.0, -1.0], lengths * [1.0, 1.0, -1.0]
        self.straight = bool(np.abs(axes.T @ axes - np.eye(3)).max() < _STRAIGHT)
        if not self.straight:
            left, _, right = np.linalg.svd(linear)
            axes = left @ right * np.sign(np.linalg.det(left @ right))
        self.size: Array = lengths
        """How much (3,) it stretches along its axes; one is negative where it mirrors."""
        self.pose = np.array([*position, *P.from_matrix(axes)])
        """Where it is (7,), without what it stretches."""

    def point(self, local: Array) -> Array:
        """Points (..., 3) [m] of the prim's coordinates in the world."""
        return np.asarray(local) @ self.linear.T + self.position


class Space:
    """The units of a stage, and where its prims are."""

    def __init__(self, stage: Any, path: Path, scale: float, notes: list[ImportNote]) -> None:
        lib = pxr()
        self.unit, self.weight = (
            float(value(stage))
            for value in (lib.UsdGeom.GetStageMetersPerUnit, lib.UsdPhysics.GetStageKilogramsPerUnit)
        )
        for what, value in (("metersPerUnit", self.unit), ("kilogramsPerUnit", self.weight)):
            if not (isfinite(value) and value > 0):
                raise AssetError(f"{path}: its {what} is {value:g}; expected a number above 0")
        self.metres, self.kilograms = self.unit * scale, self.weight * scale**3
        """Of lengths and masses here, where an import scales them."""
        self.upright = str(lib.UsdGeom.GetStageUpAxis(stage)) == "Z"
        self.turn = _UP["Z" if self.upright else "Y"]
        self.up = np.array([*np.zeros(3), *P.from_matrix(self.turn)])
        """The pose (7,) of the stage's coordinates in the world."""
        self.scale = scale
        self._cache = lib.UsdGeom.XformCache(lib.Usd.TimeCode.EarliestTime())
        self._places: dict[str, Placement] = {}
        if not lib.UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            notes.append(ImportNote("info", "stage", "says no metersPerUnit; USD's default is 0.01 m, a centimetre"))
        if not stage.HasAuthoredMetadata("upAxis"):
            notes.append(ImportNote("info", "stage", "says no upAxis; USD's default is y"))

    def of(self, prim: Any) -> Placement:
        """Where a prim is."""
        key = str(prim.GetPath())
        if key not in self._places:
            matrix = np.array(
                self._cache.GetLocalToWorldTransform(prim)
            )  # of rows: points are multiplied from the left
            if not np.isfinite(matrix).all():
                raise AssetError(f"prim '{key}' has a place that is no number")
            self._places[key] = Placement(self.turn @ matrix[:3, :3].T, self.turn @ matrix[3, :3] * self.metres)
        return self._places[key]
