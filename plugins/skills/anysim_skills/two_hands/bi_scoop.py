"""BiScoop: two hands go under one wide object at its ends, and lift it in step."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.grasping.candidates import TOP_DOWN
from anysim_skills.grasping.hand import Hand
from anysim_skills.two_hands.bi_lift import BiLift


class BiScoop(BiLift):
    """Lift `object` by `lift` on the open hands of `robot` and `partner`, each under one of its two `ends`.

    A tool's z is out of the palm and its y along the fingers; a palm looks up and its fingers towards the other end,
    which has to be free from below. `place` is where an end comes to lie in a tool's frame. Nothing is held but by its
    weight: the object never tilts by more than `tilt`, else it is put down as unstable.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        partner: RobotView,
        place: Annotated[tuple[float, float, float], Field(description="[m] in the tool's frame")],
        hand: Annotated[str, Field(description="the channel of the fingers")] = "eef",
        hover: Annotated[float, Field(gt=0, description="[m] below the ends, from where the hands come")] = 0.05,
        **options: object,
    ) -> None:
        self.hands = tuple(Hand.of(env, one, channel=hand) for one in (robot, partner))
        self._place = np.array(place)
        super().__init__(env, robot=robot, partner=partner, hover=hover, **options)  # pyright: ignore[reportArgumentType]
        self._back = -self._back
        self.movers = (*self.arms, *self.hands)

    def grasps(self, at: Array, hand: int) -> Array:
        """(n, end, turn, 7) tool poses under the ends; all turns are the same, and those of both hands."""
        del hand
        thing = self._object.root.pose[at]
        ends = [thing[:, :3] + P.rotate(thing[:, 3:], np.broadcast_to(end, (len(at), 3))) for end in self._ends]
        grasps = np.zeros((len(at), 2, TOP_DOWN, 7))
        for number, own in enumerate(ends):
            other = ends[1 - number]
            fingers = np.arctan2(other[:, 1] - own[:, 1], other[:, 0] - own[:, 0]) - 0.5 * np.pi
            turn = P.from_axis_angle(np.tile([0.0, 0.0, 1.0], (len(at), 1)), fingers)
            place = own - P.rotate(turn, np.broadcast_to(self._place, own.shape))
            grasps[:, number] = np.concatenate([place, turn], axis=1)[:, None]
        return grasps
