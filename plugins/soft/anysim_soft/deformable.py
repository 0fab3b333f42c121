"""The family `deformable`: a block of an elastic solid, in quadratic finite elements."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.errors import SpecError, SpecIssue
from anysim.math import pose as P
from anysim_soft.family import Soft
from anysim_soft.spec import DeformableSpec, SoftSpec
from anysim_soft.subworld import FlexSource

SKIN = 0.001
"""[m] from the surface at which contacts act."""
OPTIONS = {"integrator": "discrete", "solver": "Newton", "iterations": 2000, "tolerance": 1e-15, "cone": "elliptic"}
"""Elastic solids need the integrator that knows their stiffness. Where its iterations end too early, matter is damped
less than it should be; a loose tolerance would lose momentum."""
SOLIMP = "0.99 0.999 0.001"


class Deformable(Soft):
    """A block with Young's modulus, Poisson's ratio and density."""

    spec = DeformableSpec
    label = "soft block"
    tint = (0.85, 0.45, 0.35)
    drawn_keys = (*Soft.drawn_keys, "density", "young", "poisson", "damping")

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
            path = f"world.families.{self.setting.name}.fixed"
            raise SpecError([SpecIssue("", path, "nothing of it can move; fix fewer sides")])
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

    @property
    def radius(self) -> float:
        return SKIN

    def attached_sides(self) -> list[tuple[str, str]]:
        assert isinstance(self.soft, DeformableSpec)
        return [*self.soft.attached.items()]

    def mass(self, env: int) -> float:
        assert isinstance(self.soft, DeformableSpec)
        return self.parameter("density", env) * float(np.prod(self.soft.box))


def contact_of(friction: float, dt: float, *, itself: bool = False) -> str:
    """How a flex touches: as it says, whatever it meets, but that the larger coefficient of friction acts.

    With `itself`, also where parts of it come to lie on each other.
    """
    touches = 'selfcollide="auto" contype="1"' if itself else 'selfcollide="none" contype="0"'
    return (
        f'<contact {touches} conaffinity="1" solmix="1e6" friction="{friction!r}" '
        f'solref="{2 * dt!r} 1" solimp="{SOLIMP}"/>'
    )


def numbers(values: Array) -> str:
    """Numbers in XML, to the bit."""
    return " ".join(repr(float(value)) for value in values)


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
