"""BiPlace: put what two palms hold down on something below, and take both hands away at once."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.arm import LEAD, Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.two_hands.bi_squeeze import Palms, along_palm

DOWN = 0.002
"""[m] above the support at which the object counts as put down."""
OFF = 0.01
"""[m] from its height on the support within which it rests there."""


class BiPlace(PhasedSkill):
    """Lower `object`, which the palms of `robot` and `partner` hold, onto `target` below it, and let go of it."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        partner: RobotView,
        object: ObjectView,
        target: ObjectView,
        palms: Palms,
        tool: str = "tool",
        partner_tool: Annotated[
            str, Field(description="the tool of the partner; named as the robot's where empty")
        ] = "",
        solver: str = "numba_ik",
        lower_speed: Speed = 0.06,
        retreat: Metres = 0.08,
        speed: Speed = 0.2,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 300,
    ) -> None:
        tools = (robot, tool), (partner, partner_tool or tool)
        self.arms = tuple(Arm.of(env, one, tool=name, solver=solver) for one, name in tools)
        self._object, self._target, self._palms = object, target, palms
        self._shapes, self._support = ObjectShapes(env.scene, object), env.scene.entity_shape(target.name)
        self._lower_speed, self._retreat, self._speed, self._late = lower_speed, retreat, speed, steps
        self._dt = env.engine.world.physics.control_dt
        self._begun = np.zeros((env.num_envs, 2, 7))
        self._sunk = np.zeros(env.num_envs)
        super().__init__(env, self.arms)

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("lower", self._take, self._lowering, self._late),
            Phase("let go", self._open, self._opening, self._late),
            Phase("settle", None, self._settling, 25),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        """None: what is not held any more has to be lifted again."""
        del rung, env
        return None

    def _above(self, ids: Array, at: Array) -> Array:
        """(n,) [m] from the top of the support to the lowest point of the object."""
        pose = self._object.root.pose[at]
        return pose[:, 2] - self._shapes.below(ids, pose) - self._support.top_height(self._target.root.pose[at])

    def _take(self, ids: Array, at: Array) -> None:
        for hand, arm in enumerate(self.arms):
            arm.take(ids, at, self._object.root)
            self._begun[ids, hand] = arm.command[ids]
        self._sunk[ids] = 0.0

    def _lowering(self, ids: Array, at: Array) -> Array:
        """Both commands sink by the same height, with what they press as it is."""
        self._sunk[ids] += self._lower_speed * self._dt
        for hand, arm in enumerate(self.arms):
            target = self._begun[ids, hand]
            target[:, 2] -= self._sunk[ids]
            arm.go(ids, target, 1.5 * self._lower_speed, np.inf)
        held = self.arms[0].holds(ids, at, self._object.root) & self.arms[1].holds(ids, at, self._object.root)
        return np.where(held, np.where(self._above(ids, at) < DOWN, GO_ON, STAY), _UNSTABLE)

    def _open(self, ids: Array, at: Array) -> None:
        for hand, arm in enumerate(self.arms):
            pose = arm.tool.pose[at]
            arm.command[ids] = pose  # the press ends here
            arm.go(ids, along_palm(pose, -self._retreat, self._palms[hand]), self._speed, LEAD)

    def _opening(self, ids: Array, at: Array) -> Array:
        there = self.arms[0].arrived(ids, at, 0.02, 0.2) & self.arms[1].arrived(ids, at, 0.02, 0.2)
        return np.where(there, GO_ON, STAY)

    def _settling(self, ids: Array, at: Array) -> Array:
        slow = P.norm(self._object.root.twist[at, :3]) < DOWN
        return np.where(slow | (self.steps[ids] >= 25), GO_ON, STAY)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(np.abs(self._above(env_ids, at)) < OFF, GO_ON, _LOST)


_LOST, _UNSTABLE = OUTCOMES.index(Outcome.LOST), OUTCOMES.index(Outcome.UNSTABLE_GRASP)
