"""The family `garment`: cloth that is cut to a form, whose edges keep their length, and that hands hold.

A hand that is declared as a pad takes hold of the points nearest to it at the moment when it closes, and lets go of
them when it opens, or where they pull harder than it holds.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError, SpecError, SpecIssue
from anysim.families.base import FamilySetting, FamilyState
from anysim.math import pose as P
from anysim_soft.bending import bending_force, bending_matrix, fastest
from anysim_soft.deformable import on_side
from anysim_soft.family import UP, Soft
from anysim_soft.flex_xml import contact_of, numbers
from anysim_soft.garment_cut import Cut, cut_of
from anysim_soft.garment_spec import GarmentSpec
from anysim_soft.pinch import OPTIONS as PINCH, STEP
from anysim_soft.rope import edges
from anysim_soft.spec import PadSpec, SoftSpec
from anysim_soft.subworld import FlexSource

MOST_POINTS = 1600
"""Of a garment: its bending takes a matrix of so many rows."""
OPTIONS = {"integrator": "implicitfast", "solver": "CG", "iterations": 100, "tolerance": 1e-8, "cone": "elliptic"}
"""With this integrator points and bodies get what constraints gave, however far the solver came."""
EXACT = {**OPTIONS, "solver": "Newton", "iterations": 30}
"""Of garments of few points that meet neither themselves nor blocks. Gradients do not always get to the end: then paths
on two engines part by a millimetre within half a second, where they differ by rounding. Elsewhere it takes three times
as long, and ten times on a block."""
ON_BLOCKS = {**OPTIONS, "iterations": 3000}
"""Of those that meet blocks: where cloth comes down flat, a thousand contacts say the same, and with too few iterations
it is thrown away."""
FEW = 200
"""Points up to which it takes no longer."""
STABLE = 2.0
"""Of the square of a step times the rate of the fastest bending wave, below which cloth does not come apart: 4."""
EDGE = "0.95 0.99 0.001"
"""Impedance of edges: stiffer ones take a solver that is some times slower."""
PINCHED_EDGE = "0.99 0.999 0.001"
"""The same where pads pinch: softer edges give way to them by a third of their length, and pads come through cloth."""


class Garment(Soft):
    """A towel or a shirt, with the mass of its area and the rigidity of its cloth.

    Attributes:
        cut: its form.
    """

    spec = GarmentSpec
    meets_surfaces = True
    label = "garment"
    tint = (0.8, 0.45, 0.35)
    drawn_keys: ClassVar[tuple[str, ...]] = (
        *Soft.drawn_keys,
        "areal_density",
        "bending",
        "damping",
        "folded",
        "turned",
        "tilt",
    )

    def __init__(self, setting: FamilySetting) -> None:
        assert isinstance(setting.spec, GarmentSpec)
        self.cut: Cut = cut_of(setting.spec)
        self._matrix = bending_matrix(self.cut.points, self.cut.hinges)
        self._rate = fastest(self._matrix, self.cut.shares())
        super().__init__(setting)
        if self.pads.pinch and self._step > STEP * (1 + 1e-9):
            least = int(np.ceil(setting.engine.world.physics.dt / STEP - 1e-9))
            raise setting.fault(
                "substeps",
                f"a pinch takes steps of {STEP:g} s at most, these are of {self._step:g} s; give `substeps: {least}` "
                "or more",
            )

    @classmethod
    def pads_of(cls, spec: SoftSpec) -> Mapping[str, PadSpec]:
        assert isinstance(spec, GarmentSpec)
        return spec.pads

    @classmethod
    def count(cls, spec: SoftSpec) -> int:
        assert isinstance(spec, GarmentSpec)
        count = len(cut_of(spec).points)
        if count > MOST_POINTS:
            words = f"it has {count:,} points; {MOST_POINTS:,} at most are possible"
            raise SpecError([SpecIssue("", ".spacing", words)])
        return count

    @property
    def garment(self) -> GarmentSpec:
        """Its parameters."""
        assert isinstance(self.soft, GarmentSpec)
        return self.soft

    @property
    def radius(self) -> float:
        return self.garment.radius

    def drawn_value(self, key: str, env_ids: Array) -> Array:
        found = super().drawn_value(key, env_ids)
        if key == "bending":  # the mass is drawn before
            density = self.values[env_ids, self.drawn_keys.index("areal_density")]
            most = STABLE * density / (self._rate * self._step**2)
            if (found > most).any():
                row = int(np.argmax(found - most))
                raise PluginError(
                    f"world.families.{self.setting.name}.bending: cloth of {found[row]:.3g} N m is too stiff for steps "
                    f"of {self._step:g} s with points {self.garment.spacing:g} m apart, {most[row]:.3g} N m at most; "
                    f"give more `substeps`, or a larger `spacing`"
                )
        return found

    # ------------------------------------------------------------------ the solver

    def source(self, values: Mapping[str, float], pose: Array) -> FlexSource:
        spec, cut = self.garment, self.cut
        flat = np.column_stack([cut.points, cut.side * spec.radius])
        size = np.append(cut.size, 0.0)
        fixed = np.zeros(len(flat), dtype=bool)
        for side in spec.fixed:
            fixed |= on_side(cut.points, size, side)
        mass = values["areal_density"] * cut.shares()
        points = pose[:3] + P.rotate(pose[3:], flat)
        touch = contact_of(values["friction"], self._step, itself=spec.layers)
        xml = (
            f'<flexcomp name="it" type="direct" dim="2" point="{numbers(points.ravel())}" '
            f'element="{" ".join(map(str, cut.faces.ravel()))}" radius="{spec.radius!r}" mass="{float(mass.sum())!r}">'
            f"{edges(self._step, PINCHED_EDGE if self.pads.pinch else EDGE)}{touch}</flexcomp>"
        )
        begins = self._begins(flat, values["folded"], values["turned"], values["tilt"])
        start = None if begins is None else pose[:3] + P.rotate(pose[3:], begins)
        felt = np.where(fixed, np.inf, mass)
        inner = bending_force(self._matrix, values["bending"], values["damping"], felt, self._step)
        sides = {side: on_side(cut.points, size, side) for side in spec.attached}
        few = len(flat) <= FEW and not spec.layers
        options = ON_BLOCKS if self.under else EXACT if few else OPTIONS
        options = OPTIONS | PINCH if self.pads.pinch else options
        return FlexSource(xml, fixed, mass, options, sides, start=start, inner=inner)

    def _begins(self, flat: Array, share: float, turned: float, tilt: float) -> Array | None:
        """(V, 3) [m] where points begin in its frame; None if that is where they are in `flat`.

        Turned in its plane, a share of its extent along x folded back about a line along y, and tilted about y.
        """
        if not (share or turned or tilt):
            return None
        places = P.rotate(P.from_axis_angle(UP, np.array(turned)), flat)
        width = np.ptp(places[:, 0])
        beyond = np.maximum(places[:, 0] - (places[:, 0].max() - share * width), 0.0)
        bend = self.garment.spacing
        turn = np.minimum(beyond / bend, np.pi)
        places[:, 0] += bend * np.sin(turn) - beyond - np.maximum(beyond - np.pi * bend, 0.0)
        places[:, 2] = bend * (1.0 - np.cos(turn)) + np.cos(turn) * places[:, 2]
        if tilt:
            places = P.rotate(P.from_axis_angle(np.array([0.0, -1.0, 0.0]), np.array(tilt)), places)
            places[:, 2] -= places[:, 2].min()
        return places

    def attached_sides(self) -> list[tuple[str, str]]:
        return [*self.garment.attached.items()]

    # ------------------------------------------------------------------ what it looks like and means

    def mass(self, env: int) -> float:
        return self.parameter("areal_density", env) * float(self.cut.areas().sum())

    def state(self, env_ids: Array) -> FamilyState:
        """Fields: `flat` (n, V, 2) [m] where each point is in the garment's own plane, `held` (n, V) by a pad.

        Where a pad pinches it, `pinched` (n, V) too: held by one of these.
        """
        state = super().state(env_ids)
        flat = np.broadcast_to(self.cut.points, (len(env_ids), *self.cut.points.shape))
        fields = {"flat": flat.copy(), "held": self.pads.points(env_ids, len(self.cut.points))}
        if self.pads.pinch:
            fields["pinched"] = self.pads.points(env_ids, len(self.cut.points), pinched=True)
        return state._replace(fields=fields)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        more: dict[str, object] = {"area": float(self.cut.areas().sum()), "pads": self.pads.facts(env)}
        return {name: {**known, **more} for name, known in super().facts(env).items()}
