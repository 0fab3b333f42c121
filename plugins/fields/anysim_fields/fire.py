"""The family `fire`: flames and their smoke over a burning disc. It pushes nothing and heats nothing."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.families.base import Family, FamilyPart, FamilySetting, FamilyState
from anysim.model.appearance import rgb
from anysim.model.world import Body, BodyKind
from anysim_fields.bodies import drawn
from anysim_fields.laws import PLUME_SPREAD
from anysim_fields.puffs import Puffs
from anysim_fields.spec import FireSpec
from anysim_schemas.base import Spec

UP = np.array([0.0, 0.0, 1.0])


class Fuel(NamedTuple):
    """What burns: heat [J/kg] that is set free, kg of soot per kg, and the colour of its flame from base to tip.

    Heats and yields are those of Tewarson in the SFPE Handbook of Fire Protection Engineering; wood is red oak.
    """

    heat: float
    soot: float
    base: tuple[float, float, float]
    tip: tuple[float, float, float]


FUELS = {
    "wood": Fuel(12.4e6, 0.015, (1.0, 0.85, 0.4), (0.95, 0.3, 0.03)),
    "ethanol": Fuel(25.6e6, 0.008, (0.35, 0.55, 1.0), (0.95, 0.6, 0.35)),
    "propane": Fuel(43.7e6, 0.024, (0.45, 0.6, 1.0), (1.0, 0.6, 0.15)),
    "heptane": Fuel(41.2e6, 0.037, (1.0, 0.9, 0.5), (1.0, 0.4, 0.05)),
    "polystyrene": Fuel(27.0e6, 0.164, (1.0, 0.75, 0.3), (0.75, 0.22, 0.03)),
}
SOOT = 8700.0
"""[m^2/kg] extinction of soot that flames make (Mulholland and Croarkin 2000)."""
SOOT_COLOR = np.array([0.16, 0.15, 0.15])
THICK = (0.4, 1.6)
"""Optical depth through the middle of a puff of flame, at its base and its tip, where there are fewer."""
RIM = 1.2
"""Half widths of the plume from its axis beyond which nothing burns."""
VALUES = ("power", "radius", "flicker", "growth", "turbulence", "diffusion")


class Fire(Family):
    """A fire with a power: its height is Heskestad's, its plume McCaffrey's. It pushes nothing and heats nothing."""

    spec = FireSpec
    drawn = True

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        return [FamilyPart(name, ImportedModel(name, (Body("", BodyKind.STATIC),), links={"": 0}), "fire")]

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, FireSpec)
        self.fire, self.fuel = setting.spec, FUELS[setting.spec.fuel]
        self.puffs = Puffs(self, setting.spec)
        self._values = {key: self.remember(key) for key in VALUES}
        self._position, self._wind = self.remember("position", 3), self.remember("wind", 3)
        self._soot = self.remember("soot")
        self.lit, self.since = self.remember("lit", dtype=np.bool_), self.remember("since")
        self._phase, self._source = self.remember("phase"), self.remember("source", 3)

    # ------------------------------------------------------------------ its life

    def reset(self, env_ids: Array) -> None:
        for key, kept in self._values.items():
            kept[env_ids] = drawn(self.setting, getattr(self.fire, key), key, env_ids)
        for key, kept in (("position", self._position), ("wind", self._wind), ("lit", self.lit)):
            kept[env_ids] = drawn(self.setting, getattr(self.fire, key), key, env_ids)
        soot = self.fuel.soot if self.fire.soot is None else self.fire.soot
        self._soot[env_ids] = drawn(self.setting, soot, "soot", env_ids)
        self.puffs.reset(env_ids)
        self._source[env_ids] = self.puffs.source(env_ids, self._position[env_ids])[0]

    def light(self, env_ids: Array) -> None:
        """Set it on fire in these envs, or anew."""
        self.lit[env_ids], self.since[env_ids] = True, 0.0

    def put_out(self, env_ids: Array) -> None:
        """No flame comes any more; what is in the air goes on."""
        self.lit[env_ids] = False

    def power(self, env_ids: Array) -> Array:
        """(n,) [W] now."""
        full, growth = self._values["power"][env_ids], self._values["growth"][env_ids]
        share = np.clip(self.since[env_ids] / np.where(growth > 0.0, growth, 1.0), 0.0, 1.0) ** 2
        return np.where(self.lit[env_ids], full * np.where(growth > 0.0, share, 1.0), 0.0)

    def height(self, env_ids: Array) -> Array:
        """(n,) [m] of the flame in the mean: Heskestad's 0.235 Q^0.4 - 1.02 D, and a quarter of its radius at least."""
        power, radius = self.power(env_ids), self._values["radius"][env_ids]
        height = np.maximum(0.235 * (power / 1000.0) ** 0.4 - 1.02 * 2.0 * radius, 0.25 * radius)
        return np.where(power > 0.0, height, 0.0)

    def tip(self, env_ids: Array) -> Array:
        """(n,) [m] of the flame now: it swings about its height, 1.5 times a second over the root of its diameter."""
        return self.height(env_ids) * (1.0 + self._values["flicker"][env_ids] * np.sin(self._phase[env_ids]))

    def before_step(self, env_ids: Array, duration: float) -> None:
        self.since[env_ids] += duration
        pace = 1.5 / np.sqrt(2.0 * self._values["radius"][env_ids])  # Cetegen and Ahmed 1993
        self._phase[env_ids] = np.mod(self._phase[env_ids] + 2.0 * np.pi * pace * duration, 2.0 * np.pi)
        source, _, there = self.puffs.source(env_ids, self._position[env_ids])
        self._source[env_ids] = source
        power = self.power(env_ids)
        for row, env in enumerate(env_ids.tolist()):
            self.puffs.advance(
                env,
                duration,
                source=source[row],
                axis=UP,
                wind=self._wind[env],
                heat=float(power[row]),
                speed=0.0,
                radius=float(self._values["radius"][env]),
                turbulence=float(self._values["turbulence"][env]),
                diffusion=float(self._values["diffusion"][env]),
                settling=0.0,
                emission=float(power[row] / self.fuel.heat * self._soot[env]),
                emits=bool(there[row] and power[row] > 0.0),
            )

    # ------------------------------------------------------------------ what it looks like and means

    def burning(self, env_ids: Array) -> Array:
        """(n, K) bool: the puffs that glow; those at the rim burn out at half the height."""
        away = self.puffs.x[env_ids] - self._source[env_ids][:, None]
        half = np.maximum(np.maximum(self._values["radius"][env_ids, None], PLUME_SPREAD * away[..., 2]), 1e-9)
        off = np.hypot(away[..., 0], away[..., 1]) / half
        tip = self.tip(env_ids)[:, None] * (1.0 - np.clip(off - 0.5, 0.0, 0.5))
        return self.puffs.there(env_ids) & (away[..., 2] < tip) & (off < RIM)

    def state(self, env_ids: Array) -> FamilyState:
        """Puffs as points; fields: `there`, `burning`, `size` [m], `mass` [kg] of soot."""
        return self.puffs.state(env_ids, float(self._values["radius"][0]), {"burning": self.burning(env_ids)})

    def fault(self, env_ids: Array) -> Array:
        return self.puffs.fault(env_ids)

    def reaches(self, env: int) -> list[str]:
        """Objects whose frames are in the flame."""
        world, state = self.engine.world, self.engine.get_state()
        height = float(self.height(np.array([env]))[0])
        found = list[str]()
        for number, entity in enumerate(world.entities):
            if number in self.setting.entities or not self.engine.presence[env, number]:
                continue
            away = state.body_pose[env, entity.root, :3] - self._source[env]
            if 0.0 <= away[2] < height and np.hypot(away[0], away[1]) < self._values["radius"][env]:
                found.append(entity.name)
        return found

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        row = np.array([env])
        known: dict[str, object] = {"matter": "fire", "burning": bool(self.power(row)[0] > 0.0), "fuel": self.fire.fuel}
        known |= {"where": self._source[env].tolist(), "at": self.fire.at, "power": float(self.power(row)[0])}
        known |= {"flame_height": float(self.height(row)[0]), "reaches": self.reaches(env), "pushes": []}
        return {self.setting.name: known}

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        return {"power": self.power(env_ids), "tip": self.tip(env_ids), "middle": self.puffs.middle(env_ids)}

    @property
    def color(self) -> tuple[float, float, float]:
        return self.fuel.base if self.fire.color is None else rgb(self.fire.color)

    def looks(self, env: int) -> tuple[Array, Array]:
        """Extinction (K,) [m^2] and colour (K, 3) of the puffs."""
        row = np.array([env])
        flame, size, mass = self.burning(row)[0], self.puffs.size[env], self.puffs.mass[env]
        share = (self.puffs.x[env, :, 2] - self._source[env, 2]) / max(float(self.tip(row)[0]), 1e-9)
        share = np.clip(share, 0.0, 1.0)
        thick = THICK[0] + (THICK[1] - THICK[0]) * share
        amount = np.where(flame, thick * 2.0 * np.pi * size**2, SOOT * mass) * self.puffs.fade(env)
        ends = (self.fuel.base, self.fuel.tip) if self.fire.color is None else (rgb(self.fire.color),) * 2
        glow = (1.0 - share)[:, None] * np.array(ends[0]) + share[:, None] * np.array(ends[1])
        return amount, np.where(flame[:, None], glow, SOOT_COLOR)

    def draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        self.puffs.draw(env_ids, view, images, self.looks)
