"""InHand: a learned policy turns an object in the fingers of a hand."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.grasping.grasp import Metres
from anysim_skills.learned import Learned

FEATURES = ("turn_x", "turn_y", "turn_z", "object_x", "object_y", "object_z")
"""What a policy may be told: the rotation vector [rad] from the object to the goal, and the place of the object [m];
both in the axes of the frame `palm`."""


class InHand(PhasedSkill):
    """Turn `object` as `goal` is turned, by a policy that drives the channel `hand` of `robot`.

    Ends well once the turn that is left is within `angle` for `hold` control steps, and with `lost` where the object is
    further from `palm` than `reach`.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: Frame,
        goal: Frame,
        palm: Frame,
        options: Annotated[dict[str, Any], Field(description="of the policy, as `{file: package:NAME/turn.yaml}`")],
        policy: Annotated[str, Field(description="an installed kind of policy, as in `anysim list policies`")] = "file",
        hand: Annotated[str, Field(description="the channel of the fingers")] = "eef",
        angle: Annotated[float, Field(gt=0, description="[rad]")] = 0.1,
        reach: Metres = 0.2,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 10,
        steps: Annotated[int, Field(ge=1, description="control steps that it may take")] = 500,
    ) -> None:
        self.fingers = Learned(env, robot, hand, policy, options, FEATURES)
        self._object, self._goal, self._palm = object, goal, palm
        self._angle, self._reach, self._hold, self._late = angle, reach, hold, steps
        self._held = np.zeros(env.num_envs, dtype=np.int64)
        super().__init__(env, [self.fingers])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("turn", self._enter, self._turn, self._late),)

    def retry(self, rung: Rung, env: int) -> int | None:
        """A policy has no other way."""
        del rung, env
        return None

    def _enter(self, ids: Array, at: Array) -> None:
        del at
        self._held[ids] = 0

    def _turn(self, ids: Array, at: Array) -> Array:
        palm, thing = self._palm.pose[at], self._object.pose[at]
        left = P.rotation_vector(P.multiply(self._goal.quaternion[at], P.conjugate(thing[:, 3:])))
        place = P.rotate_inverse(palm[:, 3:], thing[:, :3] - palm[:, :3])
        self.fingers.told[ids] = np.concatenate([P.rotate_inverse(palm[:, 3:], left), place], axis=1)
        self._held[ids] = (self._held[ids] + 1) * (P.norm(left) < self._angle)
        said = np.where(self._held[ids] >= self._hold, GO_ON, STAY)
        return np.where(P.norm(place) > self._reach, _LOST, said)


_LOST = OUTCOMES.index(Outcome.LOST)
