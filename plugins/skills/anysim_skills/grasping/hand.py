"""A hand with several fingers as skills close it: along a grasp posture, each finger until it touches something.

A synergy of the catalogue is a posture q; a finger goes from `opened` along s in [0, 1] to opened + s (q - opened). It
stops where it touches, and then goes on by `press`: that far beyond contact is how hard it presses. A skill that knows
where each joint is to be says that instead.
"""

from collections.abc import Mapping
from typing import Self

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.math import pose as P
from anysim.skills.phases import Mover
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.env_lifetime import PerEnv

TOUCH = 0.5
"""[N] at which a finger touches."""

_HANDS: PerEnv[tuple[str, str], "Hand"] = PerEnv()


class Hand(Mover):
    """The hand of a robot in all envs.

    Attributes:
        fingers: their names, F groups of the channel's joints.
        synergies: names of the postures.
        closing: (N,) bool; the others open.
        synergy: (N,) index of the posture.
        rate: [1/s] of s.
        press: of s, beyond contact.
        s: (N, F) how far each finger is closed.
        joints: (K,) world indices of the channel's joints.
        names: (K,) of these, without the robot's.
        opened: (K,) [rad] where they are open.
        told: (N, K) where the joints are to be, in envs that are told so; NaN in the others.
        stopped: (N, F) bool: it has touched something, or is closed.
    """

    def __init__(self, env: TaskEnv, robot: RobotView, channel: str) -> None:
        self.env = env
        self._slice = env.actions.slice_of(robot.name, channel)
        view, world = self._slice.controller.channel, env.engine.world
        entry = view.robot.entry.channels[channel]
        if not entry.groups or not entry.synergies or view.opened is None:
            raise TaskError(
                f"channel '{channel}' of '{robot.name}' has no fingers in the catalogue, which are its `groups`, with "
                f"the postures `opened` and `synergies`; '{view.robot.entry.name}' has the groups "
                f"{listing(list(entry.groups))} and the synergies {listing(list(entry.synergies))}"
            )
        self.fingers, self.synergies = tuple(entry.groups), tuple(entry.synergies)
        joints = [world.actuators[a].joint for a in view.actuators]
        self.joints = np.array(joints, dtype=np.int64)
        self.names = tuple(world.joints[j].name.removeprefix(f"{robot.name}.") for j in joints)
        owner = {name: f for f, group in enumerate(entry.groups.values()) for name in group}
        self._finger = np.array([owner.get(name, -1) for name in self.names], dtype=int)
        """(K,) the finger of each drive."""
        self.opened = np.array(view.opened, dtype=float)
        self._ways = np.array([np.array(q, dtype=float) - self.opened for q in entry.synergies.values()])
        self._of_body = _fingers_of_bodies(
            env, robot.name, {j: f for j, f in zip(joints, self._finger.tolist(), strict=True) if f >= 0}
        )
        n = env.num_envs
        self.closing, self.synergy = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.int64)
        self.s, self.stopped = np.zeros((n, len(self.fingers))), np.zeros((n, len(self.fingers)), dtype=bool)
        self.told = np.full((n, len(joints)), np.nan)
        self.rate, self.press = 1.5, 0.25
        self._fresh = np.ones(n, dtype=bool)

    @classmethod
    def of(cls, env: TaskEnv, robot: RobotView, *, channel: str = "eef") -> Self:
        """The hand of an env, shared by all skills that close it.

        Raises:
            TaskError: the channel has no controller, or no fingers.
        """
        made = _HANDS.of(env, (robot.name, channel), lambda: cls(env, robot, channel))
        return made  # pyright: ignore[reportReturnType]

    def named(self, synergy: str) -> int:
        """The index of a posture.

        Raises:
            TaskError: the hand has no such one.
        """
        return _index("synergy", synergy, self.synergies)

    def postures(self) -> dict[str, Array]:
        """The synergies (K,) [rad] by name."""
        return {name: self.opened + way for name, way in zip(self.synergies, self._ways, strict=True)}

    def pointing(self, finger: str, synergy: str) -> Array:
        """(K,) joint positions of a posture in which one finger is open.

        Raises:
            TaskError: the hand has no such finger or posture.
        """
        bent = self._finger != _index("finger", finger, self.fingers)
        return self.opened + bent * self._ways[self.named(synergy)]

    def renew(self, ids: Array) -> None:
        """These envs have just been reset."""
        self._fresh[ids] = True

    def prepare(self, ids: Array) -> None:
        """Open, in envs that have been reset."""
        fresh = ids[self._fresh[ids]]
        self.open(fresh)
        self._fresh[fresh] = False

    def open(self, ids: Array) -> None:
        """Open all fingers."""
        self.closing[ids], self.s[ids], self.stopped[ids], self.told[ids] = False, 0.0, False, np.nan

    def close(self, ids: Array, synergy: int | Array) -> None:
        """Close towards a posture, or to one in each env (n,)."""
        self.closing[ids], self.synergy[ids], self.told[ids] = True, synergy, np.nan

    def go(self, ids: Array, targets: Array) -> None:
        """Bring the joints to positions (n, K), whatever the fingers touch."""
        self.told[ids] = targets

    def closed(self, ids: Array) -> Array:
        """(n,) bool: no finger moves on."""
        return np.logical_and.reduce(self.stopped[ids], axis=1)

    def touches(self, ids: Array) -> tuple[Array, Array]:
        """(n, F) [N] on each finger by other things than its robot, and (n,) how many links of fingers are touched."""
        points = self.env.engine.contacts(ids)
        row = np.full(self.env.num_envs, -1)
        row[ids] = np.arange(len(ids))
        first, second = self._of_body[points.body_a], self._of_body[points.body_b]
        one = (first >= 0) ^ (second >= 0)  # a finger against the palm or another finger holds nothing
        one &= (first >= -1) & (second >= -1)
        force = np.zeros((len(ids), len(self.fingers)))
        own = row[points.env[one]]
        size = P.norm(points.force[one])
        np.add.at(force, (own, np.maximum(first, second)[one]), size)
        links = np.zeros((len(ids), len(self._of_body)), dtype=bool)
        link = np.where(first >= 0, points.body_a, points.body_b)[one]
        links[own[size > 0.1 * TOUCH], link[size > 0.1 * TOUCH]] = True
        return force, links.sum(axis=1)

    def act(self, ids: Array, action: Array) -> None:
        """Write the action of these envs: one step of the fingers."""
        own = ids[self.closing[ids]]
        if len(own):
            touched = self.touches(own)[0] > TOUCH
            fresh = touched & ~self.stopped[own]
            step = self.rate * self.env.engine.world.physics.control_dt
            s = np.where(fresh, self.s[own] + self.press, self.s[own] + np.where(self.stopped[own], 0.0, step))
            self.s[own] = np.minimum(s, 1.0)
            self.stopped[own] |= touched | (self.s[own] >= 1.0)
        share = np.where(self._finger >= 0, self.s[ids][:, self._finger], self.s[ids].min(axis=1)[:, None])
        targets = self.opened + share * self._ways[self.synergy[ids]]
        targets = np.where(np.isnan(self.told[ids]), targets, self.told[ids])
        action[ids, self._slice.start : self._slice.stop] = self._slice.controller.action_for(targets, ids)


def _index(what: str, name: str, known: tuple[str, ...]) -> int:
    if name not in known:
        raise TaskError(f"the hand has no {what} '{name}'{suggest(name, list(known))} (it has: {listing(list(known))})")
    return known.index(name)


def _fingers_of_bodies(env: TaskEnv, robot: str, fingers: Mapping[int, int]) -> Array:
    """(B + 1,) the finger of each body by the joint that moves it; -2 of the robot's others, -1 of all else."""
    world, entity = env.engine.world, env.engine.index.entity(robot)
    found = np.full(len(world.bodies) + 1, -1)
    for body in range(entity.body_start, entity.body_stop):
        found[body] = -2
        at = body
        while at >= 0 and found[body] == -2:
            found[body] = fingers.get(world.body_joint[at], -2)
            at = world.bodies[at].parent
    return found
