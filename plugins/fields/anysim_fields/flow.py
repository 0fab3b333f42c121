"""The family `flow`: wind, jets and plumes, the smoke, steam or dust in them, and the drag of bodies."""

from collections.abc import Iterable, Mapping

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.families.base import FamilyPart, FamilySetting, FamilyState, body_of
from anysim.families.cosolver import CoSolver, MetBodies
from anysim.math import pose as P
from anysim.model.appearance import rgb
from anysim.model.world import Body, BodyKind
from anysim_fields.bodies import drawn, must_collide
from anysim_fields.puffs import Puffs
from anysim_fields.spec import FlowSpec
from anysim_schemas.base import Spec

LOOKS = {
    "smoke": ((0.3, 0.3, 0.31), 8700.0, 0.0),
    "steam": ((0.93, 0.94, 0.95), 300.0, 0.003),
    "dust": ((0.72, 0.6, 0.43), 58.0, 0.031),
}
"""Colour, extinction [m^2/kg] and settling [m/s]: of soot (Mulholland and Croarkin 2000), of drops of 5 um and of
grains of 10 um in radius (twice their outline, and Stokes' law)."""
VALUES = ("speed", "heat", "radius", "emission", "turbulence", "diffusion", "fluid_density")


class Flow(CoSolver):
    """Air that moves as it says, whatever it meets: bodies with `drag` are pushed, and it is not slowed by them.

    So it has no momentum to lose: what it gives to bodies is what it `received` from elsewhere.
    """

    spec = FlowSpec
    drawn = True

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        assert isinstance(spec, FlowSpec)
        label = spec.look if spec.emission != 0.0 else "wind"
        return [FamilyPart(name, ImportedModel(name, (Body("", BodyKind.STATIC),), links={"": 0}), label)]

    def __init__(self, setting: FamilySetting) -> None:
        assert isinstance(setting.spec, FlowSpec)
        self.flow = setting.spec
        self._pushed = [body_of(setting, name, f"drag.{name}") for name in setting.spec.drag]
        super().__init__(setting)
        for name, body in zip(self.flow.drag, self._pushed, strict=True):
            must_collide(setting, body, self.met, f"drag.{name}")
        self._slot = np.searchsorted(self.met, self._pushed)
        self.puffs = Puffs(self, setting.spec)
        self._values = {key: self.remember(key) for key in VALUES}
        self._look = {key: self.remember(key) for key in ("extinction", "settling")}
        self._vectors = {key: self.remember(key, 3) for key in ("position", "direction", "wind")}
        self._source, self._axis = self.remember("source", 3), self.remember("axis", 3)
        self._drag = self.remember("drag_area", len(self._pushed))

    def meets(self, body: int) -> bool:
        return super().meets(body) and body in self._pushed

    # ------------------------------------------------------------------ its life

    def fill(self, env_ids: Array) -> None:
        for key, kept in (*self._values.items(), *self._vectors.items()):
            kept[env_ids] = drawn(self.setting, getattr(self.flow, key), key, env_ids)
        for key, own in zip(self._look, LOOKS[self.flow.look][1:], strict=True):
            given = getattr(self.flow, key)
            self._look[key][env_ids] = drawn(self.setting, own if given is None else given, key, env_ids)
        for place, (name, one) in enumerate(self.flow.drag.items()):
            area, share = (
                drawn(self.setting, value, f"drag.{name}.{key}", env_ids)
                for key, value in (("area", one.area), ("coefficient", one.coefficient))
            )
            self._drag[env_ids, place] = area * share
        self.puffs.reset(env_ids)
        self._place(env_ids)

    def _place(self, env_ids: Array) -> Array:
        """Where the source is and blows to; (n,) whether it is there."""
        source, turn, there = self.puffs.source(env_ids, self._vectors["position"][env_ids])
        self._source[env_ids] = source
        self._axis[env_ids] = P.normalize(P.rotate(turn, self._vectors["direction"][env_ids]))
        return there

    def velocity(self, env: int, points: Array, *, there: bool = True) -> Array:
        """(P, 3) [m/s] of the air at points (P, 3) [m], without gusts."""
        from anysim_fields.kernels.air import air_velocity

        found = np.zeros(points.shape)
        heat, speed, radius = (float(self._values[key][env]) for key in ("heat", "speed", "radius"))
        for place, out in zip(np.ascontiguousarray(points), found, strict=True):
            source, axis, wind = self._source[env], self._axis[env], self._vectors["wind"][env]
            air_velocity(place, source, axis, wind, heat * there, speed * there, radius, out)
        return found

    def solve(self, env_ids: Array, bodies: MetBodies, duration: float) -> Array:
        there = self._place(env_ids)
        impulse = np.zeros((len(env_ids), len(self.met), 6))
        for row, env in enumerate(env_ids.tolist()):
            value = {key: float(kept[env]) for key, kept in self._values.items()}
            self.puffs.advance(
                env,
                duration,
                source=self._source[env],
                axis=self._axis[env],
                wind=self._vectors["wind"][env],
                heat=value["heat"] * there[row],
                speed=value["speed"] * there[row],
                radius=value["radius"],
                turbulence=value["turbulence"],
                diffusion=value["diffusion"],
                settling=float(self._look["settling"][env]),
                emission=value["emission"],
                emits=bool(there[row] and value["emission"] > 0.0),
            )
            if len(self._slot):
                slots = self._slot
                air = self.velocity(env, bodies.com[row, slots], there=bool(there[row])) - bodies.twist[row, slots, :3]
                push = 0.5 * value["fluid_density"] * self._drag[env] * P.norm(air)
                mass = bodies.mass[row, slots]
                # as if the drag slowed it within the step: light things take the air's speed, and never more
                light = np.where(np.isfinite(mass), push * duration / np.where(mass > 0.0, mass, np.inf), 0.0)
                np.add.at(impulse[row, :, :3], slots, (duration * push / (1.0 + light) * (mass > 0.0))[:, None] * air)
        given = impulse.copy()
        given[..., 3:] += P.cross(bodies.com, impulse[..., :3])
        self.received[env_ids] += given.sum(axis=1)
        return impulse

    def momentum(self, env_ids: Array) -> Array:
        return np.zeros((len(env_ids), 6))

    # ------------------------------------------------------------------ what it looks like and means

    def mass(self, env: int) -> float:
        """[kg] of what is seen in the air, without what has faded."""
        return float((self.puffs.mass[env] * self.puffs.fade(env)).sum())

    def state(self, env_ids: Array) -> FamilyState:
        """Puffs as points; fields: `there`, `size` [m], `mass` [kg]."""
        return self.puffs.state(env_ids, float(self._values["radius"][0]), {})

    def fault(self, env_ids: Array) -> Array:
        return self.puffs.fault(env_ids)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        value = {key: float(kept[env]) for key, kept in self._values.items()}
        wind = self._vectors["wind"][env]
        known: dict[str, object] = {"matter": self.flow.look if value["emission"] else "air", "mass": self.mass(env)}
        known |= {"where": self._source[env].tolist(), "at": self.flow.at, "wind": wind.tolist()}
        known |= {"speed": value["speed"], "direction": self._axis[env].tolist(), "heat": value["heat"]}
        known |= {"blowing": bool(value["speed"] > 0.0 or P.norm(wind) > 0.0), "pushes": [*self.flow.drag]}
        if self.puffs.there(np.array([env])).any():
            known["middle"] = self.puffs.middle(np.array([env]))[0].tolist()
        return {self.setting.name: known}

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        mass = np.array([self.mass(env) for env in env_ids.tolist()])
        return {"mass": mass, "middle": self.puffs.middle(env_ids), "received": self.received[env_ids]}

    @property
    def color(self) -> tuple[float, float, float]:
        return LOOKS[self.flow.look][0] if self.flow.color is None else rgb(self.flow.color)

    def looks(self, env: int) -> tuple[Array, Array]:
        """Extinction (K,) [m^2] and colour (K, 3) of the puffs."""
        amount = float(self._look["extinction"][env]) * self.puffs.mass[env] * self.puffs.fade(env)
        return amount, np.tile(np.array(self.color, dtype=float), (len(amount), 1))

    def draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        self.puffs.draw(env_ids, view, images, self.looks)
