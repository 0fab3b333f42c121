"""The family `magnet`: dipoles on bodies, which pull, push and turn each other, and iron between them."""

from collections.abc import Iterable, Mapping

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import WORLD, Array
from anysim.families.base import FamilyPart, FamilySetting, FamilyState, body_of
from anysim.families.cosolver import CoSolver, MetBodies
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind
from anysim_fields.bodies import drawn, must_collide
from anysim_fields.spec import MagnetSpec
from anysim_schemas.base import Spec

DRAWN = {"position": 3, "moment": 3, "strength": 0, "radius": 0, "permeability": 0}
"""What is drawn of a dipole, and how many numbers it has."""


class Magnet(CoSolver):
    """D dipoles in each env. A field has no momentum of its own: what one dipole gets, the others give.

    Attributes:
        names: of the dipoles, in the order of the file.
        strength: (N, D) factors on their moments, which may be written at any time.
    """

    spec = MagnetSpec

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        return [FamilyPart(name, ImportedModel(name, (Body("", BodyKind.STATIC),), links={"": 0}), "magnets")]

    # ------------------------------------------------------------------ made

    def __init__(self, setting: FamilySetting) -> None:
        assert isinstance(setting.spec, MagnetSpec)
        self.magnets, self.names = setting.spec, [*setting.spec.dipoles]
        world = setting.engine.world
        self._body = np.array(
            [
                WORLD if one.body is None else body_of(setting, one.body, f"dipoles.{name}.body")
                for name, one in setting.spec.dipoles.items()
            ],
            dtype=np.intp,
        )
        super().__init__(setting)
        slots = np.full(len(world.bodies) + 1, len(self.met), dtype=np.intp)
        slots[self.met] = np.arange(len(self.met))
        self._slot, self._fixed = slots[self._body], self._body == WORLD
        entity = np.array(world.body_entity, dtype=np.intp)
        self._carrier = np.where(self._fixed, setting.entities[0], entity[self._body])
        for place, name in enumerate(self.names):
            if (body := int(self._body[place])) != WORLD and world.bodies[body].kind is not BodyKind.STATIC:
                must_collide(setting, body, self.met, f"dipoles.{name}.body")
        d = len(self.names)
        self._values = {key: self.remember(key, d, *([size] if size else [])) for key, size in DRAWN.items()}
        self.strength, self._uniform = self._values["strength"], self.remember("uniform", 3)
        self._acts = {key: self.remember(key, d, 3) for key in ("magnetised", "field", "force", "torque")}

    def meets(self, body: int) -> bool:
        return super().meets(body) and body in self._body

    # ------------------------------------------------------------------ its life

    def fill(self, env_ids: Array) -> None:
        for place, (name, one) in enumerate(self.magnets.dipoles.items()):
            for key, kept in self._values.items():
                kept[env_ids, place] = drawn(self.setting, getattr(one, key), f"dipoles.{name}.{key}", env_ids)
        self._uniform[env_ids] = drawn(self.setting, self.magnets.field, "field", env_ids)
        bodies, there = self.engine.get_state().body_pose[env_ids], self.engine.presence[env_ids]
        self._work_out(env_ids, bodies, there)

    def _frames(self, env_ids: Array, body_pose: Array) -> tuple[Array, Array]:
        """Where the dipoles are (n, D, 3) [m], and how their bodies are turned (n, D, 4)."""
        frame = body_pose[:, self._body].copy()
        frame[:, self._fixed, :3] = self.setting.origin[env_ids][:, None]
        frame[:, self._fixed, 3:] = [0.0, 0.0, 0.0, 1.0]
        return frame[..., :3] + P.rotate(frame[..., 3:], self._values["position"][env_ids]), frame[..., 3:]

    def _work_out(self, env_ids: Array, body_pose: Array, there: Array) -> Array:
        """Forces and torques now; the places (n, D, 3) [m] at which they act."""
        from anysim_fields.kernels.dipoles import K, interact

        place, turn = self._frames(env_ids, body_pose)
        value = {key: kept[env_ids] for key, kept in self._values.items()}
        moment = P.rotate(turn, value["moment"] * value["strength"][..., None])
        share = (value["permeability"] - 1.0) / (value["permeability"] + 2.0)
        induced = value["radius"] ** 3 * share / K
        present, reach = there[:, self._carrier], self.magnets.range or np.inf
        acts = {key: np.zeros_like(moment) for key in ("field", "force", "torque")}
        for row, env in enumerate(env_ids.tolist()):
            interact(
                place[row],
                moment[row],
                induced[row],
                value["radius"][row],
                present[row],
                self._uniform[env],
                reach,
                *(rows[row] for rows in acts.values()),
            )
        for key, rows in (*acts.items(), ("magnetised", moment)):
            self._acts[key][env_ids] = rows
        return place

    def solve(self, env_ids: Array, bodies: MetBodies, duration: float) -> Array:
        place = self._work_out(env_ids, bodies.body_pose, bodies.there)
        force, torque = (duration * self._acts[key][env_ids] for key in ("force", "torque"))
        impulse = np.zeros((len(env_ids), len(self.met), 6))
        for i, slot in enumerate(self._slot.tolist()):
            if slot < len(self.met):
                impulse[:, slot, :3] += force[:, i]
                impulse[:, slot, 3:] += torque[:, i] + P.cross(place[:, i] - bodies.com[:, slot], force[:, i])
            else:  # what stands still gives what it gets
                self.received[env_ids, :3] -= force[:, i]
                self.received[env_ids, 3:] -= torque[:, i] + P.cross(place[:, i], force[:, i])
        turned = P.cross(self._acts["magnetised"][env_ids], self._uniform[env_ids][:, None])
        self.received[env_ids, 3:] += duration * np.where(bodies.there[:, self._carrier, None], turned, 0.0).sum(axis=1)
        return impulse

    def momentum(self, env_ids: Array) -> Array:
        return np.zeros((len(env_ids), 6))

    # ------------------------------------------------------------------ what it looks like and means

    def state(self, env_ids: Array) -> FamilyState:
        """Dipoles as points; fields: `moment` [A m^2], `field` [T], `force` [N], `torque` [N m], world axes."""
        now = self.engine.get_state()
        place, _ = self._frames(env_ids, now.body_pose[env_ids])
        twist = now.body_twist[env_ids][:, self._body].copy()
        twist[:, self._fixed] = 0.0
        arm = place - now.body_pose[env_ids][:, self._body, :3]
        arm[:, self._fixed] = 0.0
        ids = np.full(len(self.names), self.setting.entities[0] + 1, dtype=np.int32)
        fields = {"moment": self._acts["magnetised"], "field": self._acts["field"]}
        fields |= {"force": self._acts["force"], "torque": self._acts["torque"]}
        return FamilyState(
            place,
            twist[..., :3] + P.cross(twist[..., 3:], arm),
            self._values["radius"][0].copy(),
            ids,
            fields={key: rows[env_ids] for key, rows in fields.items()},
        )

    def fault(self, env_ids: Array) -> Array:
        return np.array([not np.isfinite(self._acts["force"][env]).all() for env in env_ids], dtype=bool)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        bodies = [b.name for b in self.engine.world.bodies]
        found = {
            name: {
                "body": None if self._fixed[i] else bodies[self._body[i]],
                "moment": self._acts["magnetised"][env, i].tolist(),
                "on": bool(self.strength[env, i]) or bool(self._values["permeability"][env, i] > 1.0),
                "force": float(P.norm(self._acts["force"][env, i])),
            }
            for i, name in enumerate(self.names)
        }
        return {self.setting.name: {"matter": "magnets", "dipoles": found}}

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        acts = {key: self._acts[key][env_ids] for key in ("force", "torque")}
        return {**acts, "moment": self._acts["magnetised"][env_ids]}
