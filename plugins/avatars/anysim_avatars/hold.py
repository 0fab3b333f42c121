"""The family `avatar_hold`: a hand of an avatar that holds an object, takes one, and lets go of what is pulled away.

A hold is a spring and a damper between the object and where it is in the palm, with a bounded force and torque: a
robot feels it, and what pulls harder for long enough has the object.
"""

from collections.abc import Iterable, Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import listing, suggest
from anysim.families.base import Family, FamilyPart, FamilySetting, FamilyState
from anysim.kinematics import inertia
from anysim.math import matrix as M, pose as P
from anysim_schemas.base import Flag, Number, Positive, Reference, Spec, Vec3

STIFF, STIFF_TURN = 60.0, 40.0
"""[rad/s] of the spring on which an object hangs in a hand, in translation and rotation; both critically damped."""
SHARE = 0.95
"""Of its force at which a hold counts as overcome."""
FREE, HELD, GIVEN = 0, 1, 2
"""What a hold may be: its hand is empty, holds the object, or has let it go."""


class HoldSpec(Spec):
    """What a hand of an avatar does with one object."""

    avatar: Reference = Field(description="whose hand it is, such as `ann` or `ann_0`")
    hand: Literal["left", "right"] = Field(default="right", description="of the avatar")
    object: Reference = Field(description="what it holds, or takes")
    begins: Flag = Field(default=False, description="holds it when an episode begins; otherwise it takes it")
    at: Vec3 = Field(default=(0.0, 0.0, 0.03), description="where it begins, from the palm in its axes [m]")
    yaw: Number = Field(default=0.0, description="and turned about the palm's z, which points out of the skin [rad]")
    near: Positive = Field(default=0.08, description="how near to the palm an object is when the hand takes it [m]")
    slow: Positive = Field(default=0.05, description="and how slow against it [m/s]")
    closing: Positive = Field(default=0.3, description="and for how long [s]")
    force: Positive = Field(default=8.0, description="that it holds with, at most [N]")
    torque: Positive = Field(default=0.4, description="that it holds with, at most [N m]")
    patience: Positive = Field(default=0.06, description="it lets go of what is pulled as hard for so long [s]")


class Hold(Family):
    """A hand that takes an object, holds it with a bounded force, and lets go of what is pulled out of it."""

    spec = HoldSpec
    rate: ClassVar[Literal["control", "physics"]] = "physics"

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        """None: it is about bodies of others."""
        del name, spec
        return ()

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, HoldSpec)
        self.spec_ = spec = setting.spec
        self._hand = self._index(f"{spec.avatar}.{spec.hand}_hand", "avatar", spec.avatar)
        self._thing = self._index(spec.object, "object", spec.object)
        self.body_names = (f"{spec.avatar}.{spec.hand}_hand", spec.object)
        world = setting.engine.world
        palm = next(s for s in world.sites if s.body == self._hand and s.name.endswith(f"{spec.hand}_palm"))
        self._palm = np.array([*palm.position, *palm.quaternion])
        self._both = np.array([self._hand, self._thing])
        self._only = np.array([self._thing])
        half = 0.5 * spec.yaw
        self._begin = P.compose(self._palm[None], np.array([[*spec.at, 0.0, 0.0, np.sin(half), np.cos(half)]]))
        self.holding = self.remember("holding", dtype=np.int64, bounds=(FREE, GIVEN))
        self._grip = self.remember("grip", 7)
        self._clock = self.remember("clock")
        self._mass = self.remember("mass")
        self._com = self.remember("com", 3)
        self._inertia = self.remember("inertia", 6)

    def _index(self, body: str, key: str, said: str) -> int:
        names = [one.name for one in self.engine.world.bodies]
        if body in names:
            return names.index(body)
        roots = [one.name for one in self.engine.world.entities]
        words = f"there is no {'avatar' if key == 'avatar' else 'object'} '{said}'"
        raise self.setting.fault(key, f"{words}{suggest(said, roots)} (there are: {listing(roots)})")

    # ------------------------------------------------------------------ its life

    def reset(self, env_ids: Array) -> None:
        bodies = self._only
        self._mass[env_ids] = self.engine.get_parameters("body.mass", env_ids, bodies)[:, 0]
        self._com[env_ids] = self.engine.get_parameters("body.com", env_ids, bodies)[:, 0]
        self._inertia[env_ids] = self.engine.get_parameters("body.inertia", env_ids, bodies)[:, 0]
        self._grip[env_ids, 6] = 1.0
        if self.spec_.begins:
            self._grip[env_ids] = self._begin
            hand = self.engine.get_state().body_pose[env_ids, self._hand]
            pose = P.compose(hand, self._grip[env_ids])[:, None]
            self.engine.set_body_state(pose, np.zeros((len(env_ids), 1, 6)), env_ids, bodies)
            self.holding[env_ids] = HELD

    def before_step(self, env_ids: Array, duration: float) -> None:
        state = self.engine.get_state()
        pose, twist = state.body_pose[env_ids[:, None], self._both], state.body_twist[env_ids[:, None], self._both]
        self._take(env_ids, pose, twist, duration)
        held = self.holding[env_ids] == HELD
        if held.any() and Capability.WRENCHES in self.engine.capabilities:
            self._pull(env_ids[held], pose[held], twist[held], duration)
        elif held.any():
            self._carry(env_ids[held], pose[held, 0])

    def _carry(self, ids: Array, hand: Array) -> None:
        """On an engine that takes no forces the object is where the hand has it."""
        pose = P.compose(hand, self._grip[ids])[:, None]
        self.engine.set_body_state(pose, np.zeros((len(ids), 1, 6)), ids, self._only)

    def _take(self, ids: Array, pose: Array, twist: Array, duration: float) -> None:
        """The hand closes on what has been at the palm for long enough, and moves with it."""
        free = self.holding[ids] == FREE
        if not free.any():
            return
        own, pose, twist = ids[free], pose[free], twist[free]
        palm = P.compose(pose[:, 0], np.broadcast_to(self._palm, (len(own), 7)))
        near = P.norm(pose[:, 1, :3] - palm[:, :3]) <= self.spec_.near
        moving = P.norm(twist[:, 1, :3] - twist[:, 0, :3] - P.cross(twist[:, 0, 3:], pose[:, 1, :3] - pose[:, 0, :3]))
        self._clock[own] = np.where(near & (moving < self.spec_.slow), self._clock[own] + duration, 0.0)
        closes = self._clock[own] >= self.spec_.closing
        now = own[closes]
        self._grip[now] = P.compose(P.inverse(pose[closes, 0]), pose[closes, 1])
        self.holding[now], self._clock[now] = HELD, 0.0

    def _pull(self, ids: Array, pose: Array, twist: Array, duration: float) -> None:
        """Force and torque on the object of a critically damped spring, its own weight carried; bounded."""
        wanted = P.compose(pose[:, 0], self._grip[ids])
        mass = self._mass[ids, None]
        arm = P.rotate(pose[:, 1, 3:], self._com[ids])
        target = P.rotate(wanted[:, 3:], self._com[ids])
        gap = wanted[:, :3] + target - pose[:, 1, :3] - arm
        spin, turning = twist[:, 0, 3:], twist[:, 1, 3:]
        goes = twist[:, 0, :3] + P.cross(spin, wanted[:, :3] + target - pose[:, 0, :3])
        pace = min(STIFF, 0.35 / duration)
        force = mass * (pace**2 * gap + 2.0 * pace * (goes - twist[:, 1, :3] - P.cross(turning, arm)))
        force, overcome = _bounded(force, self.spec_.force)
        force[:, 2] -= self._mass[ids] * self.engine.world.physics.gravity[2]
        rate = min(STIFF_TURN, 0.35 / duration)
        left = P.rotation_vector(P.multiply(wanted[:, 3:], P.conjugate(pose[:, 1, 3:])))
        asked = rate**2 * left + 2.0 * rate * (spin - turning)
        tensor = inertia.turned(self._inertia[ids], pose[:, 1, 3:])
        torque, _ = _bounded(M.product(tensor, asked[..., None])[..., 0], self.spec_.torque)
        self._clock[ids] = np.where(overcome, self._clock[ids] + duration, 0.0)
        gives = self._clock[ids] >= self.spec_.patience
        self.holding[ids[gives]], self._clock[ids[gives]] = GIVEN, 0.0
        self.push(ids, np.concatenate([force, torque], axis=-1)[:, None] * ~gives[:, None, None], self._only)

    # ------------------------------------------------------------------ what there is to see

    def state(self, env_ids: Array) -> FamilyState:
        """Nothing of its own."""
        none = np.zeros((len(env_ids), 0, 3))
        return FamilyState(none, none, np.zeros(0), np.zeros(0, dtype=np.int32))

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        what = ("empty", "holds", "let go")[int(self.holding[env])]
        return {
            self.setting.name: {"kind": "hold", "hand": self.body_names[0], "object": self.body_names[1], "is": what}
        }

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        return {"holding": self.holding[env_ids].astype(float)}


def _bounded(vector: Array, most: float) -> tuple[Array, Array]:
    """Vectors (n, 3) of at most such a length, and which were near or above it (n,)."""
    size = P.norm(vector)
    return vector * np.minimum(1.0, most / np.maximum(size, 1e-12))[:, None], size >= SHARE * most
