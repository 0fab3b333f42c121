"""The family `inflatable`: a closed elastic skin with gas in it, whose pressure follows its volume.

A skin is light and gas is stiff: the law of gases, asked once a step, would throw the skin apart. So the pressure takes
the share of what is due that an implicit step would take, with the mass that the skin has, and half of the speed at
which the skin breathes is taken out of it in each step. At rest the law holds exactly.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.errors import PluginError
from anysim.families.base import FamilySetting
from anysim.math import pose as P
from anysim_particles.skins import Skin
from anysim_soft.cloth import require_constants, solver_of, stretch
from anysim_soft.flex_xml import contact_of, numbers
from anysim_soft.shell_matter import ShellMatter
from anysim_soft.spec import InflatableSpec, SoftSpec
from anysim_soft.subworld import FlexSource
from anysim_soft.surfaces import point_areas

AIR = 101_325.0
"""[Pa] around it."""
DAMPED = 0.5
"""Of the speed at which it breathes, in a step."""
MOST_STRAIN = 0.1
"""Of the skin, up to which it is taken to be as stiff as at first."""


class Inflatable(ShellMatter):
    """A balloon: a thin elastic ball that holds gas at one temperature.

    Attributes:
        pressure: (N,) [Pa] of the gas above that of the air, as it acts.
        gas: (N,) [J] its pressure times its volume, n R T.
    """

    spec = InflatableSpec
    label = "balloon"
    tint = (0.85, 0.25, 0.3)
    drawn_keys = ("density", "drag", "friction", "young", "poisson", "damping", "thickness", "pressure")

    def __init__(self, setting: FamilySetting) -> None:
        require_constants(setting)
        assert isinstance(setting.spec, InflatableSpec)
        self._spec = setting.spec
        self._points, self._faces = sphere(self._spec.subdivisions)
        super().__init__(setting)
        self.pressure, self.gas = self.remember("gas_pressure"), self.remember("gas")

    @classmethod
    def count(cls, spec: SoftSpec) -> int:
        assert isinstance(spec, InflatableSpec)
        return 10 * 4**spec.subdivisions + 2

    @property
    def radius(self) -> float:
        return self._spec.skin

    def source(self, values: Mapping[str, float], pose: Array) -> FlexSource:
        spec, points, faces = self._spec, self._spec.radius * self._points, self._faces
        young, poisson, thickness = values["young"], values["poisson"], values["thickness"]
        mass = values["density"] * thickness * point_areas(points, faces)
        middle = pose[:3] + np.array([0.0, 0.0, spec.radius])
        words = {
            "point": numbers(points.ravel()),
            "element": " ".join(map(str, faces.ravel().tolist())),
            "pos": numbers(middle),
            "quat": numbers(wxyz_from_xyzw(pose[3:])),
            "radius": repr(spec.skin),
            "mass": repr(float(mass.sum())),
        }
        written = " ".join(f'{key}="{value}"' for key, value in words.items())
        elastic = f'young="{young!r}" poisson="{poisson!r}" damping="{values["damping"]!r}" thickness="{thickness!r}"'
        xml = (
            f'<flexcomp name="it" type="direct" dim="2" {written}><elasticity {elastic} elastic2d="stretch"/>'
            f"{contact_of(values['friction'], self._step)}</flexcomp>"
        )

        def adjust(model: Any) -> None:
            stretch(model, young, poisson, thickness)

        def press(env: int, x: Array, v: Array) -> Array:
            h = self._step
            now, slope = volume(x, faces), slopes(x, faces)
            yields = h * h * float((P.dot(slope, slope) / mass).sum())  # [m^3/Pa] by inertia alone, in a step
            swells = float((slope * v).sum())
            absolute = AIR + self.pressure[env]
            share = now / (now + absolute * yields)
            due = self.gas[env] / now - absolute - absolute / now * swells * h
            self.pressure[env] += share * due
            acts = self.pressure[env] - DAMPED * h / yields * swells
            return acts * slope

        return FlexSource(xml, np.zeros(len(points), dtype=bool), mass, solver_of(len(points)), {}, adjust, inner=press)

    # ------------------------------------------------------------------ its life

    def fill(self, env_ids: Array) -> None:
        super().fill(env_ids)
        for env in env_ids.tolist():
            young, poisson, thickness, pressure = (
                self.parameter(key, env) for key in ("young", "poisson", "thickness", "pressure")
            )
            strain = pressure * self._spec.radius * (1.0 - poisson) / (2.0 * young * thickness)
            if strain > MOST_STRAIN:
                raise PluginError(
                    f"world.families.{self.setting.name}: {pressure:g} Pa would stretch the skin by {100 * strain:.3g} "
                    f"%, and its law holds up to {100 * MOST_STRAIN:g} %; take a lower `pressure`, or more of `young` "
                    f"or `thickness`"
                )
            sub = self.sub_world(env)
            sub.load(self.state_row[env])
            sub.stretch(1.0 + strain)
            self.state_row[env], self.x[env] = sub.state(), sub.points()
            self.pressure[env] = pressure
            self.gas[env] = (AIR + pressure) * volume(self.x[env], self._faces)

    # ------------------------------------------------------------------ liquids

    def skin(self, env: int) -> Skin:
        """What liquids meet of it in an env."""
        return Skin(self.x[env], self.v[env], self.sub_world(env).mass, self._faces, self._spec.skin)

    # ------------------------------------------------------------------ what it means

    def volume(self, env: int) -> float:
        """[m^3] within its points."""
        return volume(self.x[env], self._faces)

    def mass(self, env: int) -> float:
        return self.parameter("density", env) * self.parameter("thickness", env) * 4.0 * np.pi * self._spec.radius**2

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        more = {"pressure": float(self.pressure[env]), "volume": self.volume(env), "gas": float(self.gas[env])}
        return {name: {**known, **more} for name, known in super().facts(env).items()}

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        return {**super().recorded(env_ids), "pressure": self.pressure[env_ids]}


def sphere(subdivisions: int) -> tuple[Array, Array]:
    """Points (V, 3) on the unit sphere and its triangles (F, 3), outward: an icosahedron whose edges are halved."""
    g = (1 + 5**0.5) / 2
    points = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    points += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2)]
    faces += [(10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5)]
    faces += [(2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    places = [*P.normalize(np.array(points, dtype=float))]
    for _ in range(subdivisions):
        halves: dict[tuple[int, int], int] = {}
        finer = list[tuple[int, int, int]]()
        for a, b, c in faces:
            ab, bc, ca = (_half(places, halves, i, j) for i, j in ((a, b), (b, c), (c, a)))
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return np.array(places), np.array(faces, dtype=np.intp)


def _half(places: list[Array], halves: dict[tuple[int, int], int], i: int, j: int) -> int:
    key = (min(i, j), max(i, j))
    if key not in halves:
        halves[key] = len(places)
        places.append(P.normalize(places[i] + places[j]))
    return halves[key]


def volume(points: Array, faces: Array) -> float:
    """[m^3] within a closed surface of triangles, outward."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    return float(P.dot(a, P.cross(b, c)).sum() / 6)


def slopes(points: Array, faces: Array) -> Array:
    """(V, 3) [m^2] what the volume gains where each point moves; they sum up to nothing."""
    middle = points.mean(axis=0)
    a, b, c = (points[faces[:, i]] - middle for i in range(3))
    found = np.zeros_like(points)
    for i, (p, q) in enumerate(((b, c), (c, a), (a, b))):
        np.add.at(found, faces[:, i], P.cross(p, q) / 6)
    return found
