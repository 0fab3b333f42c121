"""Screw: turn a cap or a knob further than a wrist turns, by grasping it again and again."""

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.joints import RangedJointView
from anysim_skills.arm import TURN_RATE
from anysim_skills.articulated.handle import AtHandle, Share
from anysim_skills.choice import turns_against
from anysim_skills.grasping.grasp import Force

AHEAD = 0.3
"""[rad] the hand is told to be at most this far ahead of the part: what bounds the torque."""
LEFT = 0.1
"""[rad] that may be left of the whole way: no other stroke is begun for it."""
YAWS = 16
"""Turns of the hand about the axis that are tried for each stroke."""
SLIP = 0.02
"""[m] a hand that has left the part's axis by more than this does not hold it any more."""
_CHOOSE = 1


class Screw(AtHandle):
    """Turn `part` to `fraction` of its range with `robot`, which grasps it from above its frame `<part>.handle`.

    That frame is on the axis, in the middle of what is grasped, and its z points to where the hand comes from. The hand
    turns with the part by at most `stroke`, lets go, rises, and takes hold again further back, as often as it takes. It
    begins each stroke with the turn from which the wrist gets through it with the least motion; the part is round, so
    that each serves.
    """

    turns: ClassVar[Array] = turns_against(np.array([[0.0, 0.0, 0.0, 1.0]]), YAWS)[0]

    def __init__(
        self,
        env: TaskEnv,
        *,
        part: RangedJointView,
        fraction: Share = 0.97,
        stroke: Annotated[float, Field(gt=0, le=np.pi, description="[rad] of the part with one grasp")] = 2.3,
        part_speed: Annotated[float, Field(gt=0, description="[rad/s] of the part")] = 1.2,
        force: Force = None,
        **options: object,
    ) -> None:
        if part.found[0].type is not JointType.REVOLUTE:
            raise TaskError(
                f"'{part.name}' does not turn, it is a {part.found[0].type.value} joint; `open` moves a slide"
            )
        self.share, self._stroke, self.force = fraction, stroke, force
        self._goal, self._way = np.zeros((2, env.num_envs))
        """[rad] where the part is to be at the end of the stroke, and the sign of the turn to there."""
        super().__init__(env, part=part, part_speed=part_speed, **options)  # pyright: ignore[reportArgumentType]

    def make_phases(self) -> Sequence[Phase]:
        return (
            *self.approach_phases(),
            self.closing_phase(),
            Phase("turn", self.take, self._turning, self.late),
            *self.phases_away(),
        )

    def to_go(self, at: Array) -> Array:
        """(n,) [rad] of the next stroke: what is left, in equal parts."""
        left = super().to_go(at)
        return left / np.maximum(np.ceil(np.abs(left) / self._stroke), 1.0)

    def take(self, ids: Array, at: Array) -> None:
        super().take(ids, at)
        to_go = self.to_go(at)
        self._goal[ids], self._way[ids] = self.part.position(at) + to_go, np.sign(to_go)

    def _turning(self, ids: Array, at: Array) -> Array:
        """Round with the part, ahead of it by a bounded angle; the stroke ends where the part has done it."""
        left, way = self._goal[ids] - self.part.position(at), self._way[ids]
        held = P.compose(self.part.pose(at), self._grip[ids])
        target = self.part.moved(at, held[:, None], AHEAD * way[:, None])[:, 0]
        self.arm.go(ids, target, self.part_speed / TURN_RATE, self.lead)
        slipped = P.norm(self.arm.tool.position[at] - held[:, :3]) > SLIP
        said = np.where(self.jammed(ids, at), _JAMMED, np.where(slipped, _UNSTABLE, STAY))
        return np.where(left * way <= 0.0, GO_ON, said)

    def _leave(self, number: int, ids: Array, at: Array) -> None:
        """After the last phase comes the next stroke, as long as something is left of the whole way."""
        if number == self.last:
            more = np.abs(super().to_go(at)) > LEFT
            self._choice.again(ids[more])
            self._go(ids[more], _CHOOSE)
            ids, at = ids[~more], at[~more]
            if len(ids) == 0:
                return
        super()._leave(number, ids, at)


_JAMMED, _UNSTABLE = OUTCOMES.index(Outcome.JAMMED), OUTCOMES.index(Outcome.UNSTABLE_GRASP)
