"""Follow: keep a distance behind a person who walks, and look at them."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.moving.base import Base, Pace

CRUMBS, SPACING = 256, 0.05
"""Places that are remembered of a person's trail, and how far they are apart [m]."""
STANDS = 0.05
"""[m/s] below which a person, and the base, stand still."""


class Follow(PhasedSkill):
    """Follow `person` with the base of `robot` along the trail that they leave, `distance` away, and face them.

    Where the person comes nearer the base draws back, straight. It is done once both have stood still for `patience`.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        person: Frame,
        distance: Annotated[float, Field(gt=0, description="[m] that is kept, over the ground")] = 1.55,
        lead: Annotated[float, Field(ge=0, description="[s] by which the person's motion is foreseen")] = 0.45,
        speed: Annotated[float, Field(gt=0, description="[m/s]")] = 1.0,
        rate: Annotated[float, Field(gt=0, description="[rad/s]")] = 1.5,
        braking: Annotated[float, Field(gt=0, description="[m/s^2]")] = 1.0,
        channel: str = "base",
        link: Annotated[str, Field(description="of the robot, that is driven there; its own frame where empty")] = "",
        patience: Annotated[int, Field(ge=1, description="control steps")] = 150,
        steps: Annotated[int, Field(ge=1, description="control steps that it may take")] = 3000,
    ) -> None:
        self.base = Base.of(env, robot, channel=channel, link=link)
        self._person, self._distance, self._lead = person, distance, lead
        self._pace, self._patience, self._late = Pace(speed, rate, braking, 2.0), patience, steps
        n = env.num_envs
        self._trail = np.zeros((n, CRUMBS, 2))
        """(N, CRUMBS, 2) [m] the person's trail, the latest last."""
        self._stood = np.zeros(n, dtype=np.int64)
        super().__init__(env, [self.base])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("follow", self._enter, self._follow, self._late),)

    def _enter(self, ids: Array, at: Array) -> None:
        self.base.pace, self.base.close = self._pace, 0.02
        self._trail[ids] = self._person.position[at, None, :2]
        self._stood[ids] = 0

    def _follow(self, ids: Array, at: Array) -> Array:
        place, velocity = self._person.position[at, :2], self._person.twist[at, :2]
        self._remember(ids, place)
        here = self.base.pose(at)
        away = here[:, :2] - place
        apart = P.norm(away)
        ahead = place + self._lead * velocity
        target = np.where(
            (apart < self._distance)[:, None],
            ahead + away * (self._distance / np.maximum(apart, 1e-6))[:, None],
            self._behind(ids, ahead, here[:, :2]),
        )
        yaw = np.arctan2(place[:, 1] - here[:, 1], place[:, 0] - here[:, 0])
        self.base.go(ids, np.concatenate([target, yaw[:, None]], axis=1))
        still = (P.norm(velocity) < STANDS) & (self.base.speed(at)[0] < STANDS)
        self._stood[ids] = np.where(still, self._stood[ids] + 1, 0)
        return np.where(self._stood[ids] >= self._patience, GO_ON, STAY)

    def _remember(self, ids: Array, place: Array) -> None:
        moved = P.norm(place - self._trail[ids, -1]) > SPACING
        rows = ids[moved]
        self._trail[rows] = np.concatenate([self._trail[rows, 1:], place[moved, None]], axis=1)

    def _behind(self, ids: Array, person: Array, base: Array) -> Array:
        """(n, 2) the latest place of the trail that is as far from the person (n, 2) as it is to be.

        Straight towards the base (n, 2) where the trail is not that long yet.
        """
        trail = self._trail[ids]
        far = P.norm(trail - person[:, None]) >= self._distance
        last = CRUMBS - 1 - far[:, ::-1].argmax(axis=1)
        way = base - person
        straight = person + way * (self._distance / np.maximum(P.norm(way), 1e-6))[:, None]
        return np.where(far.any(axis=1, keepdims=True), trail[np.arange(len(ids)), last], straight)
