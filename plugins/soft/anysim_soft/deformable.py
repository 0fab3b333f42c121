"""The family `deformable`: a block of an elastic solid, in quadratic finite elements."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.families.base import FamilySetting
from anysim.math import pose as P
from anysim_soft.flex_xml import contact_of, numbers
from anysim_soft.shell_matter import ShellMatter
from anysim_soft.spec import DeformableSpec, SoftSpec
from anysim_soft.subworld import FlexSource
from anysim_soft.surfaces import Surface, point_areas

SKIN = 0.001
"""[m] from the surface at which contacts act."""
OPTIONS = {"integrator": "discrete", "solver": "Newton", "iterations": 2000, "tolerance": 1e-15, "cone": "elliptic"}
"""Elastic solids need the integrator that knows their stiffness. Where its iterations end too early, matter is damped
less than it should be; a loose tolerance would lose momentum."""


class Deformable(ShellMatter):
    """A block with Young's modulus, Poisson's ratio and density."""

    spec = DeformableSpec
    label = "soft block"
    tint = (0.85, 0.45, 0.35)
    drawn_keys = (*ShellMatter.drawn_keys, "density", "young", "poisson", "damping")

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, DeformableSpec)
        counts = np.array(setting.spec.points)
        rest, faces = _lattice(np.array(setting.spec.box), counts)[self.shell], np.searchsorted(self.shell, self.faces)
        areas = point_areas(rest, faces)
        self._surface = Surface(rest, faces, areas / areas.sum(), SKIN, 0.0)
        self._shares = _shares(counts, np.array(setting.spec.cells))[self.shell].T

    @classmethod
    def count(cls, spec: SoftSpec) -> int:
        assert isinstance(spec, DeformableSpec)
        return int(np.prod(spec.points))

    def source(self, values: Mapping[str, float], pose: Array) -> FlexSource:
        spec = self.soft
        assert isinstance(spec, DeformableSpec)
        box, counts = np.array(spec.box), np.array(spec.points)
        middle = pose[:3] + P.rotate(pose[3:], np.array([0.0, 0.0, box[2] / 2]))
        nodes = _lattice(box, 2 * np.array(spec.cells) + 1)
        fixed = np.zeros(len(nodes), dtype=bool)
        for side in spec.fixed:
            fixed |= on_side(nodes, box, side)
        if fixed.all():
            raise self.setting.fault("fixed", "nothing of it can move; fix fewer sides")
        words = {
            "count": " ".join(map(str, spec.points)),
            "spacing": numbers(box / (counts - 1)),
            "pos": numbers(middle),
            "quat": numbers(wxyz_from_xyzw(pose[3:])),
            "radius": repr(SKIN),
            "mass": repr(float(values["density"] * box.prod())),
            "cellcount": " ".join(map(str, spec.cells)),
        }
        written = " ".join(f'{key}="{value}"' for key, value in words.items())
        elastic = f'young="{values["young"]!r}" poisson="{values["poisson"]!r}" damping="{values["damping"]!r}"'
        xml = (
            f'<flexcomp name="it" type="grid" dim="3" dof="quadratic" {written}><elasticity {elastic}/>'
            f"{contact_of(values['friction'], self._step)}</flexcomp>"
        )
        sides = {side: on_side(nodes, box, side) for side in spec.attached}
        return FlexSource(xml, fixed, np.zeros(0), OPTIONS, sides)

    # ------------------------------------------------------------------ what lies on it

    @property
    def pinned(self) -> bool:
        assert isinstance(self.soft, DeformableSpec)
        return bool(self.soft.fixed)

    def surface(self, env: int) -> Surface:
        """What garments meet of it in the episode of an env: all of its mass is there."""
        return self._surface._replace(
            mass=self.mass(env) * self._surface.mass, friction=self.parameter("friction", env)
        )

    def on_nodes(self, forces: Array) -> Array:
        return self._shares @ forces

    def moving(self, env: int) -> tuple[Array, Array]:
        """(S, 3) [m], [m/s] the points of that surface now."""
        return self.x[env, self.shell], self.v[env, self.shell]

    @property
    def radius(self) -> float:
        return SKIN

    def attached_sides(self) -> list[tuple[str, str]]:
        assert isinstance(self.soft, DeformableSpec)
        return [*self.soft.attached.items()]

    def mass(self, env: int) -> float:
        assert isinstance(self.soft, DeformableSpec)
        return self.parameter("density", env) * float(np.prod(self.soft.box))


def on_side(points: Array, size: Array, side: str) -> Array:
    """(V,) bool: which points of a box about the origin are on a face, edge or corner, as `-x+y`."""
    found = np.ones(len(points), dtype=bool)
    for sign, axis in zip(side[::2], side[1::2], strict=True):
        i = "xyz".index(axis)
        place = points[:, i] * (1.0 if sign == "+" else -1.0)
        found &= place > size[i] / 2 - 1e-6 * max(size[i], 1e-9)
    return found


def _lattice(box: Array, counts: Array) -> Array:
    """(V, 3) [m] about the middle, z fastest, as MuJoCo has the nodes of a grid."""
    axes = [np.linspace(-edge / 2, edge / 2, count) for edge, count in zip(box, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _shares(points: Array, cells: Array) -> Array:
    """(V, nodes) how much of each point of a lattice moves with each node of quadratic cells, z fastest in both."""
    axes = []
    for count, number in zip(points.tolist(), cells.tolist(), strict=True):
        at = np.linspace(0.0, number, count)
        cell = np.minimum(at.astype(int), number - 1)
        along, found = at - cell, np.zeros((count, 2 * number + 1))
        rows = np.arange(count)
        found[rows, 2 * cell] = (2 * along - 1) * (along - 1)
        found[rows, 2 * cell + 1] = 4 * along * (1 - along)
        found[rows, 2 * cell + 2] = along * (2 * along - 1)
        axes.append(found)
    return np.kron(np.kron(axes[0], axes[1]), axes[2])
