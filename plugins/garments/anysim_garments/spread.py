"""Spreading of cloth: again and again the corner that lies worst is laid where it belongs, until the cloth is flat."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim.task.slot_frames import CategoryView
from anysim_garments.carry import ClothCarry
from anysim_garments.cloth import Cloth, Spot, covered
from anysim_garments.grasp import ClothGrasp, Speed
from anysim_skills.arm import Arm
from anysim_skills.grasping.release import Release

CORNERS: tuple[Spot, ...] = ((-1, -1), (-1, 1), (1, -1), (1, 1))
SETTLING = 15
"""Control steps after which it is judged how cloth lies."""


class ClothSpread(SkillSequence):
    """Spread `cloth` with one hand of `robot`, corner by corner.

    The corner that lies worst is taken to where it would lie flat, as most of the cloth does; again, until such a
    `share` of its area is covered, or `rounds` are over.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        cloth: CategoryView,
        share: Annotated[float, Field(gt=0, le=1, description="of its flat area, seen from above")] = 0.92,
        rounds: Annotated[int, Field(ge=1, description="corners that are moved at most")] = 6,
        beyond: Annotated[float, Field(description="[m] that a corner is drawn on along its way")] = 0.0,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.2,
    ) -> None:
        arm = {"robot": robot, "tool": tool, "solver": solver}
        grasp = ClothGrasp(env, **arm, cloth=cloth, at=CORNERS[0])
        carry = ClothCarry(env, **arm, cloth=cloth, at=CORNERS[0], beyond=beyond, speed=speed)
        it, hand = Cloth(env.scene, cloth), Arm.of(env, robot, tool=tool, solver=solver)
        carry.numbers = grasp.numbers
        self._choice = _WorstCorner(env, hand, it, grasp.numbers)
        members = {
            "choose": self._choice,
            "grasp": grasp,
            "carry": carry,
            "release": Release(env, **arm),
            "judge": _Flatness(env, hand, it, share),
        }
        lost = (("grasp", Outcome.NO_IK), ("grasp", Outcome.MISSED_CONTACT))
        failures = (*lost, ("carry", Outcome.UNSTABLE_GRASP), ("carry", Outcome.TIMEOUT))
        again = dict.fromkeys([*failures, ("judge", Outcome.ADVERSE_STATE)], "choose")
        super().__init__(env, members, back=again, max_attempts=rounds)

    def start(self, env_ids: Array) -> None:
        self._choice.moved[env_ids] = 0.0
        super().start(env_ids)


class _WorstCorner(PhasedSkill):
    """Write the corner that lies farthest from its place into `numbers`; one that was moved before counts less.

    Attributes:
        moved: (N, corners) how often each was.
    """

    def __init__(self, env: TaskEnv, arm: Arm, cloth: Cloth, numbers: Array) -> None:
        self._cloth, self._numbers, self._corners = cloth, numbers, cloth.nearest(CORNERS)
        self.moved = np.zeros((env.num_envs, len(CORNERS)))
        super().__init__(env, [arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("choose", None, self._choose, 1),)

    def _choose(self, ids: Array, at: Array) -> Array:
        points = self._cloth.state().points[at]
        away = P.norm(points - self._cloth.as_most_lies(points))[:, self._corners]
        chosen = np.argmax(away / (1.0 + self.moved[ids]), axis=1)
        self.moved[ids, chosen] += 1.0
        self._numbers[ids] = self._corners[chosen]
        return np.full(len(ids), GO_ON)


class _Flatness(PhasedSkill):
    """Wait, and fail with `adverse_state` where cloth covers less than a share of its area."""

    def __init__(self, env: TaskEnv, arm: Arm, cloth: Cloth, share: float) -> None:
        self._cloth, self._share = cloth, share
        super().__init__(env, [arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("settle", None, self._look, SETTLING + 1),)

    def _look(self, ids: Array, at: Array) -> Array:
        share = covered(self._cloth.state().points[at], self._cloth.faces) / self._cloth.area
        said = np.where(share >= self._share, GO_ON, _ADVERSE)
        return np.where(self.steps[ids] >= SETTLING, said, STAY)


_ADVERSE = OUTCOMES.index(Outcome.ADVERSE_STATE)
