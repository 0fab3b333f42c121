"""DexTurn: push a lever, a spoke or a tap round its axis with one finger of a hand that has several."""

from typing import Annotated

from pydantic import Field

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.articulated.turn import Turn
from anysim_skills.grasping.hand import Hand


class DexTurn(Turn):
    """Turn `part` by `angle` with the straight `finger` of `robot`, while the others are bent by `synergy`.

    `tool` is at the finger's tip, its z along the finger. It goes in beside the lever or spoke that ends at the frame
    `<part>.handle`, and round with it, however far: the hand does not turn. That frame's z is along the axis, away from
    what the part is mounted on, and its x points away from the axis.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        finger: Annotated[str, Field(description="a group of the hand's channel")] = "index",
        synergy: str = "power",
        tool: str = "index_tip",
        **options: object,
    ) -> None:
        self.hand = Hand.of(env, robot)
        self._posture = self.hand.pointing(finger, synergy)
        super().__init__(env, robot=robot, tool=tool, **options)  # pyright: ignore[reportArgumentType]
        self.movers = (self.arm, self.hand)

    def _choose(self, ids: Array, at: Array) -> None:
        self.hand.go(ids, self._posture)
        super()._choose(ids, at)
