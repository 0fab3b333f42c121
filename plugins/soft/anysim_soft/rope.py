"""The family `rope`: points that edges of fixed length join."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.families.base import FamilyState
from anysim.math import pose as P
from anysim_soft.family import Soft
from anysim_soft.flex_xml import contact_of, numbers
from anysim_soft.spec import PadSpec, RopeSpec, SoftSpec
from anysim_soft.subworld import STIFF, FlexSource

OPTIONS = {"integrator": "implicitfast", "solver": "Newton", "iterations": 100, "tolerance": 1e-12, "cone": "elliptic"}
BETWEEN = 4
"""Balls that are drawn for a point."""


class Rope(Soft):
    """A rope with a length, a radius and a density."""

    spec = RopeSpec
    meets_surfaces = True
    label = "rope"
    tint = (0.8, 0.65, 0.4)
    drawn_keys = (*Soft.drawn_keys, "density")

    @classmethod
    def count(cls, spec: SoftSpec) -> int:
        assert isinstance(spec, RopeSpec)
        return spec.segments + 1

    @classmethod
    def pads_of(cls, spec: SoftSpec) -> Mapping[str, PadSpec]:
        assert isinstance(spec, RopeSpec)
        return spec.pads or {}

    @property
    def rope(self) -> RopeSpec:
        """Its parameters."""
        assert isinstance(self.soft, RopeSpec)
        return self.soft

    @property
    def radius(self) -> float:
        return self.rope.radius

    def length(self) -> float:
        """[m]."""
        return float(P.norm(np.diff(np.array(self.rope.path), axis=0)).sum())

    def source(self, values: Mapping[str, float], pose: Array) -> FlexSource:
        spec, path = self.rope, np.array(self.rope.path)
        along = np.concatenate([[0.0], np.cumsum(P.norm(np.diff(path, axis=0)))])
        places = np.linspace(0.0, along[-1], spec.segments + 1)
        local = np.stack([np.interp(places, along, path[:, i]) for i in range(3)], axis=1)
        points = pose[:3] + P.rotate(pose[3:], local)
        count = len(points)
        share = np.ones(count)
        share[[0, -1]] = 0.5
        mass = values["density"] * np.pi * spec.radius**2 * along[-1] / spec.segments * share
        elements = " ".join(f"{i} {i + 1}" for i in range(count - 1))
        ends = {"start": np.arange(count) == 0, "end": np.arange(count) == count - 1}
        xml = (
            f'<flexcomp name="it" type="direct" dim="1" point="{numbers(points.ravel())}" element="{elements}" '
            f'radius="{spec.radius!r}" mass="{float(mass.sum())!r}">{edges(self._step)}'
            f"{contact_of(values['friction'], self._step)}</flexcomp>"
        )
        fixed = np.zeros(count, dtype=bool)
        for end in spec.fixed:
            fixed |= ends[end]
        return FlexSource(xml, fixed, mass, OPTIONS, ends)

    def attached_sides(self) -> list[tuple[str, str]]:
        return [*self.rope.attached.items()]

    def state(self, env_ids: Array) -> FamilyState:
        """Fields: `along` (n, V) [m] where each point is on it from its start, `held` (n, V) by a pad."""
        state, count = super().state(env_ids), self.rope.segments + 1
        along = np.broadcast_to(np.linspace(0.0, self.length(), count), (len(env_ids), count))
        return state._replace(fields={"along": along.copy(), "held": self.pads.points(env_ids, count)})

    def mass(self, env: int) -> float:
        return self.parameter("density", env) * np.pi * self.radius**2 * self.length()

    def carries(self, env: int) -> float:
        """[N] the tension beyond which its segments swing faster than substeps can follow: it would come apart."""
        count = self.rope.segments
        return self.mass(env) / count * self.length() / count / self._step**2

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        x = self.x[env]
        ends: dict[str, object] = {"start": x[0].tolist(), "end": x[-1].tolist()}
        ends |= {"length": float(P.norm(np.diff(x, axis=0)).sum()), "carries": self.carries(env)}
        if len(self.pads):
            ends["pads"] = self.pads.facts(env)
        return {name: {**known, **ends} for name, known in super().facts(env).items()}

    def draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        from anysim_particles.draw import draw_spheres

        mark, places = self.setting.entities[0] + 1, np.arange(self.x.shape[1])
        finer = np.linspace(0.0, places[-1], BETWEEN * places[-1] + 1)
        for row, env in enumerate(env_ids.tolist()):
            points = np.stack([np.interp(finer, places, self.x[env, :, i]) for i in range(3)], axis=1)
            draw_spheres(points, self.radius, self.color, mark, view, row, images)


def edges(dt: float, impedance: str = "") -> str:
    """Edges of fixed length, as stiff as a step of `dt` [s] allows."""
    return f'<edge equality="true" solref="{2 * dt!r} 1" solimp="{impedance or numbers(np.array(STIFF[:3]))}"/>'
