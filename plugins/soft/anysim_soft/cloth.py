"""The family `fem_cloth`: a sheet of triangles with the membrane and bending stiffness of its material.

MuJoCo 3.17 has wrong constants for both: a strip gets 3.6 times as much longer under its weight as it should, and its
energy in bending is 3/4 of what it should be, less with Poisson's ratio. They are worked out here, and written into its
model. Those of MuJoCo 4.0 are right.
"""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.errors import PluginError
from anysim.families.base import FamilySetting
from anysim.math import pose as P
from anysim_soft.deformable import OPTIONS, on_side
from anysim_soft.family import Soft
from anysim_soft.flex_xml import contact_of, numbers
from anysim_soft.spec import FemClothSpec, SoftSpec
from anysim_soft.subworld import FAULTY, FlexSource

KNOWN = "3.17", "4.0"
"""The versions of MuJoCo whose constants are known."""
MANY = 150
"""Points of sheets and skins from which on conjugate gradients cost less than Newton's method: 0.6 of it for a balloon
of 162, less than half for a sheet of 400."""
GRADIENTS = {**OPTIONS, "solver": "CG", "tolerance": 1e-13}
"""What is lost of the momentum to this tolerance is a hundred-millionth of what is traded."""
BENT = 4 / 3
"""How much too small the energy of bending is in 3.17 where Poisson's ratio is 0; otherwise 1 + that ratio more."""


class FemCloth(Soft):
    """A sheet with Young's modulus, Poisson's ratio, thickness and density."""

    spec = FemClothSpec
    label = "cloth"
    tint = (0.35, 0.5, 0.75)
    drawn_keys = (*Soft.drawn_keys, "density", "young", "poisson", "damping", "thickness", "bending")

    def __init__(self, setting: FamilySetting) -> None:
        require_constants(setting)
        super().__init__(setting)

    @classmethod
    def count(cls, spec: SoftSpec) -> int:
        assert isinstance(spec, FemClothSpec)
        return int(np.prod(spec.points))

    @property
    def cloth(self) -> FemClothSpec:
        """Its parameters."""
        assert isinstance(self.soft, FemClothSpec)
        return self.soft

    @property
    def radius(self) -> float:
        return self.cloth.radius

    def drawn_value(self, key: str, env_ids: Array) -> Array:
        if key == "bending" and self.cloth.bending is None:
            return np.full(len(env_ids), -1.0)
        return super().drawn_value(key, env_ids)

    def source(self, values: Mapping[str, float], pose: Array) -> FlexSource:
        spec = self.cloth
        size, counts = np.array([*spec.size, 0.0]), np.array(spec.points)
        axes = [np.linspace(-edge / 2, edge / 2, count) for edge, count in zip(spec.size, counts, strict=True)]
        x, y = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
        points = np.stack([x, y, np.zeros_like(x)], axis=1)
        ends = [np.where(np.isin(np.arange(count), [0, count - 1]), 0.5, 1.0) for count in counts]
        share = np.outer(*ends).ravel() / np.prod(counts - 1)
        thickness = values["thickness"]
        mass = values["density"] * thickness * spec.size[0] * spec.size[1] * share
        fixed = np.zeros(len(points), dtype=bool)
        for side in spec.fixed:
            fixed |= on_side(points, size, side)
        words = {
            "count": f"{counts[0]} {counts[1]} 1",
            "spacing": numbers(np.append(size[:2] / (counts - 1), 1.0)),
            "pos": numbers(pose[:3]),
            "quat": numbers(wxyz_from_xyzw(pose[3:])),
            "radius": repr(spec.radius),
            "mass": repr(float(mass.sum())),
        }
        written = " ".join(f'{key}="{value}"' for key, value in words.items())
        young, poisson = values["young"], values["poisson"]
        elastic = f'young="{young!r}" poisson="{poisson!r}" damping="{values["damping"]!r}" thickness="{thickness!r}"'
        xml = (
            f'<flexcomp name="it" type="grid" dim="2" {written}><elasticity {elastic} elastic2d="both"/>'
            f"{contact_of(values['friction'], self._step)}</flexcomp>"
        )
        own = young * thickness**3 / 12
        has = own / (BENT * (1.0 + poisson)) if FAULTY else own / (1.0 - poisson**2)
        more = (own if values["bending"] < 0 else values["bending"]) / has

        def adjust(model: Any) -> None:
            stretch(model, young, poisson, thickness)
            model.flex_bending[:] *= more

        sides = {side: on_side(points, size, side) for side in spec.attached}
        return FlexSource(xml, fixed, mass, solver_of(len(points)), sides, adjust)

    def attached_sides(self) -> list[tuple[str, str]]:
        return [*self.cloth.attached.items()]

    def mass(self, env: int) -> float:
        return self.parameter("density", env) * self.parameter("thickness", env) * float(np.prod(self.cloth.size))


def solver_of(count: int) -> Mapping[str, object]:
    """MuJoCo's options for a sheet or a skin of so many points."""
    return GRADIENTS if count >= MANY else OPTIONS


def require_constants(setting: FamilySetting) -> None:
    """Raises PluginError where the elastic constants of the installed MuJoCo are not known."""
    if not mujoco.__version__.startswith(tuple(f"{version}." for version in KNOWN)):
        raise PluginError(
            f"world.families.{setting.name}: the elastic constants that MuJoCo {mujoco.__version__} has for sheets are "
            f"not known, those of {' and '.join(KNOWN)} are; install mujoco=={KNOWN[0]}.0, or in its place "
            f"mujoco-core=={KNOWN[1]}.1"
        )


def stretch(model: Any, young: float, poisson: float, thickness: float) -> None:
    """Give the triangles of a model the right stiffness, where MuJoCo's is wrong."""
    if FAULTY:
        model.flex_stiffness.reshape(-1, 21)[:, :6] = membrane(model, young, poisson, thickness)


def membrane(model: Any, young: float, poisson: float, thickness: float) -> Array:
    """(F, 6) the stiffness of triangles against stretch, the upper half of a matrix of their three edges.

    A triangle of area A has the energy t A (mu E:E + lambda/2 tr(E)^2) in plane stress. Its Green strain E is the sum
    over edges of half of what their squared lengths gained, times B, where B is dual to the edges' d d^T. MuJoCo takes
    twice the second derivative by these gains.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    places = data.xpos[model.flex_vertbodyid]
    corner = places[model.flex_elem.reshape(-1, 3)]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = P.cross(a, b)
    area = P.norm(normal) / 2
    along = P.normalize(a)
    across = P.cross(P.normalize(normal), along)
    ends = places[model.flex_edge[model.flex_elemedge.reshape(-1, 3)]]
    edge = ends[:, :, 1] - ends[:, :, 0]
    u, v = P.dot(edge, along[:, None]), P.dot(edge, across[:, None])
    dual = np.swapaxes(np.linalg.inv(np.stack([u * u, v * v, 2 * u * v], axis=2)), 1, 2)
    trace = dual[..., 0] + dual[..., 1]
    product = np.einsum("fik,fjk,k->fij", dual, dual, np.array([1.0, 1.0, 2.0]))
    mu, lame = young / (2 * (1 + poisson)), young * poisson / (1 - poisson**2)
    stiffness = 2 * mu * product + lame * trace[:, :, None] * trace[:, None, :]
    i, j = np.triu_indices(3)
    return (thickness * area / 2)[:, None] * stiffness[:, i, j]
