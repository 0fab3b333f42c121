"""A right family: a paddle that swings about where it was drawn, and a spring that pulls at a ball; and wrong ones.

A wrong one's docstring names the test of the families' suite that must find it.
"""

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.engine.capability import Capability
from anysim.families.base import Family, FamilyPart, FamilyState
from anysim.kinematics.inertia import of_shape
from anysim.model.world import Body, BodyKind, Box, Geom
from anysim.randomization.draw import draw_rows
from anysim_schemas.base import Positive, Spec
from anysim_schemas.values import FloatValue, Range

BLADE = Box((0.05, 0.2, 0.2))


class PaddleSpec(Spec):
    """Parameters of a paddle."""

    speed: Positive = 2.0
    x: FloatValue = Range(range=(-0.6, -0.5))
    stiffness: Positive = 3.0


class OpenSpec(PaddleSpec, extra="allow"):
    """Takes any key."""


class Paddle(Family):
    """A blade that swings, and a spring between the origin and the ball."""

    spec = PaddleSpec
    needs = (Capability.WRENCHES,)
    rate = "physics"

    @classmethod
    def parts(cls, name, spec):
        blade = Body("", BodyKind.FREE, inertial=of_shape(BLADE, 1e5, {}), gravity_compensation=True)
        model = ImportedModel(name, (blade,), geoms=(Geom("blade", 0, BLADE),), geom_links=("",), links={"": 0})
        return [FamilyPart(name, model, "paddle", driven=True)]

    def __init__(self, setting):
        super().__init__(setting)
        entity = setting.engine.world.entities[setting.entities[0]]
        self.drives(range(entity.body_start, entity.body_stop))
        self.x, self.phase = self.remember("x"), self.remember("phase")
        self.ball = np.array([self.body("ball")])

    def pose(self, env_ids):
        pose = np.zeros((len(env_ids), 1, 7))
        pose[:, 0, 0] = self.x[env_ids] + 0.2 * np.sin(self.phase[env_ids])
        pose[:, 0, 2], pose[:, 0, 6] = 0.3, 1.0
        return pose

    def draw(self, env_ids):
        return draw_rows(self.setting.spec.x, "family/it/x", self.setting.streams, env_ids)

    def reset(self, env_ids):
        self.x[env_ids] = self.draw(env_ids)
        self.place(env_ids, self.pose(env_ids))

    def before_step(self, env_ids, duration):
        self.phase[env_ids] += self.setting.spec.speed * duration
        self.drive(env_ids, self.pose(env_ids), duration)
        pull = np.zeros((len(env_ids), 1, 6))
        pull[:, 0, :2] = -self.setting.spec.stiffness * self.engine.get_state().body_pose[env_ids, self.ball[0], :2]
        self.push(env_ids, pull, self.ball)

    def state(self, env_ids):
        points = self.pose(env_ids)[..., :3]
        return FamilyState(points, np.zeros_like(points), np.array([0.2]), np.array([self.setting.entities[0] + 1]))

    def facts(self, env):
        return {self.setting.name: {"phase": float(self.phase[env])}}

    def recorded(self, env_ids):
        return {"phase": self.phase[env_ids]}


class OpenParameters(Paddle):
    """test_parameters"""

    spec = OpenSpec


class ForeignIds(Paddle):
    """test_state"""

    def state(self, env_ids):
        return super().state(env_ids)._replace(ids=np.array([77]))


class WrongRows(Paddle):
    """test_state"""

    def state(self, env_ids):
        return super().state(np.sort(env_ids))


class NoData(Paddle):
    """test_facts"""

    def facts(self, env):
        return {self.setting.name: {"phase": self.phase[env]}, "others": {}}


class Restless(Paddle):
    """test_repeats"""

    rng = np.random.default_rng(0)

    def draw(self, env_ids):
        return self.rng.uniform(-0.6, -0.5, len(env_ids))


class Sociable(Paddle):
    """test_alone"""

    def before_step(self, env_ids, duration):
        super().before_step(env_ids, duration * (1.0 + 0.1 * (self.engine.num_envs - 1)))


class ResetsAll(Paddle):
    """test_partial_reset"""

    def reset(self, env_ids):
        self.phase[:] = 0.0
        super().reset(env_ids)


class Keeps(Paddle):
    """test_partial_reset"""

    def reset(self, env_ids):
        super().reset(env_ids)
        self.phase[env_ids] = getattr(self, "last", 0.0)
        self.last = 1.0


class StepsAll(Paddle):
    """test_partial_step"""

    def before_step(self, env_ids, duration):
        self.phase += self.setting.spec.speed * duration
        self.drive(env_ids, self.pose(env_ids), duration)


class Forgets(Paddle):
    """test_snapshot"""

    def __init__(self, setting):
        super().__init__(setting)
        self.phase = np.zeros(setting.engine.num_envs)
        del self.memory["phase"]

    def reset(self, env_ids):
        self.phase[env_ids] = 0.0
        super().reset(env_ids)


class Elsewhere(Paddle):
    """test_driven"""

    def before_step(self, env_ids, duration):
        super().before_step(env_ids, duration)
        self.memory["driven"][env_ids, 0, 0] += 0.01
