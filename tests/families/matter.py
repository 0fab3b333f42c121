"""A right co-solver: a lump of matter on a spring to the ball; and a wrong one, named for the test that finds it."""

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.families.base import FamilyPart, FamilyState
from anysim.families.cosolver import CoSolver
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind
from anysim.randomization.draw import draw_rows
from anysim_schemas.base import Positive, Spec
from anysim_schemas.values import PositiveValue, Range


class LumpSpec(Spec):
    """Parameters of a lump."""

    mass: PositiveValue = Range(range=(0.1, 0.2))
    stiffness: Positive = 20.0


class Lump(CoSolver):
    """A point that a spring of no length holds to the middle of the ball."""

    spec = LumpSpec

    @classmethod
    def parts(cls, name, spec):
        return [FamilyPart(name, ImportedModel(name, (Body("", BodyKind.STATIC),), links={"": 0}))]

    def __init__(self, setting):
        super().__init__(setting)
        self.mass, self.x, self.v = self.remember("mass"), self.remember("x", 3), self.remember("v", 3)

    def fill(self, env_ids):
        self.mass[env_ids] = draw_rows(self.setting.spec.mass, "family/it/mass", self.setting.streams, env_ids)
        self.x[env_ids] = [0.5, 0.0, 0.6]

    def solve(self, env_ids, bodies, duration):
        mass, weight = self.mass[env_ids, None], np.array(self.engine.world.physics.gravity)
        pull = self.setting.spec.stiffness * (self.x[env_ids] - bodies.com[:, 0]) * duration
        got = mass * weight * duration
        self.received[env_ids] += np.concatenate([got, P.cross(self.x[env_ids], got)], axis=1)
        self.v[env_ids] += (got - pull) / mass
        self.x[env_ids] += self.v[env_ids] * duration
        impulse = np.zeros((len(env_ids), len(self.met), 6))
        impulse[:, 0, :3] = pull
        return impulse

    def momentum(self, env_ids):
        p = self.mass[env_ids, None] * self.v[env_ids]
        return np.concatenate([p, P.cross(self.x[env_ids], p)], axis=1)

    def state(self, env_ids):
        ids = np.array([self.setting.entities[0] + 1], dtype=np.int32)
        return FamilyState(self.x[env_ids, None], self.v[env_ids, None], np.array([0.02]), ids)


class Loses(Lump):
    """test_balance"""

    def solve(self, env_ids, bodies, duration):
        return 0.999 * super().solve(env_ids, bodies, duration)
