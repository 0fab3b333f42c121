"""HoldOut: bring a held object to where another arm is to take it, while that arm goes there, in one plan for both."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_skills.arm import Arm
from anysim_skills.grasping.bring import Bring
from anysim_skills.grasping.candidates import DOWN, across, from_above
from anysim_skills.grasping.grasp import ROOM, Offset
from anysim_skills.grasping.held import turned_about
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.two_hands.arm_pair import ArmPair


class HoldOut(Bring):
    """Bring the held object to `goal`, and `taker` before a grasp of it from above at an offset there."""

    def __init__(self, env: TaskEnv, taker: Arm, offset: Offset, hover: float, **options: Any) -> None:
        """`hover` [m] is how far above its grasp `taker` ends; `options` are those of `Bring`, with a planner."""
        super().__init__(env, **options)
        self._taker, self._offset, self._back = taker, np.array(offset), np.array([*(-hover * DOWN), 0, 0, 0, 0])
        self._shapes = ObjectShapes(env.scene, self._object)
        self._together = ArmPair.of(self.arm, taker, options["planner"], options["latency"])
        self.movers = (self.arm, taker)

    def _plan(self, ids: Array, at: Array) -> None:
        """Each way to turn the object with each grasp of it that the fingers span."""
        tool, thing = self.arm.tool.pose[at], self._object.root.pose[at]
        brought = turned_about(tool, thing[:, :3], self._goal.position[at])
        held = P.compose(P.inverse(tool), thing)
        spans = across(self._shapes.size(ids)) <= self._taker.aperture - ROOM
        goals: list[Array] = []
        for poses, grip, fits in zip(brought, held, spans, strict=True):
            things = P.compose(poses, np.broadcast_to(grip, poses.shape))
            takes = from_above(things)
            offset = P.rotate(things[:, 3:], np.broadcast_to(self._offset, (len(things), 3)))
            takes[..., :3] = (things[:, :3] + offset)[:, None]
            takes = (takes + self._back)[:, fits if fits.any() else slice(None)]
            gives = np.broadcast_to(poses[:, None], takes.shape)
            goals.append(np.stack([gives.reshape(-1, 7), takes.reshape(-1, 7)]))
        self._together.plan(ids, goals, held=self._object)

    def planned(self, ids: Array) -> Array:
        return self._together.plans.said(ids)
