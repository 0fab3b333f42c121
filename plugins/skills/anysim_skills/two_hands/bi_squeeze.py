"""BiSqueeze: two palms press a wide object from its ends, and lift it in step by friction."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY
from anysim.task.env import TaskEnv
from anysim_skills.arm import LEAD
from anysim_skills.grasping.grasp import Metres
from anysim_skills.two_hands.bi_lift import BiLift

Palms = Annotated[
    tuple[float, float],
    Field(description="[m] along the y axis of each tool to the surface of its palm, which looks that way"),
]
PITCHES = np.array([0.0, 0.35, 0.7, 1.05])
"""[rad] by which the fingers point down; as many as BiLift has turns."""
SQUEEZING_STEPS = 120


class BiSqueeze(BiLift):
    """Lift `object` by `lift` between the palms of `robot` and `partner`, each pressed on one of its two `ends`.

    A tool's z is along the fingers, which point away from the robot. A palm is told to go on behind the surface, and
    the drives press as hard as `press` makes them, for as long as the object is carried.
    """

    closing_steps = SQUEEZING_STEPS + 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        palms: Palms,
        press: Annotated[float, Field(gt=0, description="[m] that a palm is told to be behind the surface")] = 0.05,
        toe_in: Annotated[
            float, Field(ge=0, description="[rad] by which the fingers begin nearer; the press turns the hands out")
        ] = 0.1,
        hover: Metres = 0.06,
        **options: object,
    ) -> None:
        self._palms, self._press, self._toe_in, self._hover = palms, press, toe_in, hover
        super().__init__(env, hover=hover, **options)  # pyright: ignore[reportArgumentType]
        self._lead = press + LEAD
        names = [env.engine.world.bodies[arm.chain.root].name for arm in self.arms]
        self._bases = [env.scene.frame(name) for name in names]

    def before(self, grasps: Array, hand: int) -> Array:
        return along_palm(grasps, -self._hover, self._palms[hand])

    def grasps(self, at: Array, hand: int) -> Array:
        """(n, end, turn, 7) tool poses of a hand with its palm on the ends; the turns are PITCHES of the fingers."""
        thing, palm = self._object.root.pose[at], self._palms[hand]
        ends = [thing[:, :3] + P.rotate(thing[:, 3:], np.broadcast_to(end, (len(at), 3))) for end in self._ends]
        grasps = np.zeros((len(at), 2, len(PITCHES), 7))
        for number, own in enumerate(ends):
            inwards = ends[1 - number] - own
            inwards = inwards / P.norm(inwards)[:, None]
            ahead = P.cross(inwards, np.broadcast_to([0.0, 0.0, 1.0], inwards.shape))
            away = P.dot(ahead, own - self._bases[hand].position[at])
            ahead = ahead * (np.where(away < 0, -1.0, 1.0) / P.norm(ahead))[:, None]
            cosine, sine = np.cos(self._toe_in), np.sin(self._toe_in)
            y = np.sign(palm) * (cosine * inwards - sine * ahead)
            ahead = cosine * ahead + sine * inwards
            for turn, pitch in enumerate(PITCHES):
                z = np.cos(pitch) * ahead - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
                matrices = np.stack([P.cross(y, z), y, z], axis=-1)
                grasps[:, number, turn, :3] = own - palm * y
                grasps[:, number, turn, 3:] = [P.from_matrix(matrix) for matrix in matrices]
        return grasps

    def _open(self, ids: Array, at: Array) -> None:
        for arm in self.arms:
            arm.command[ids] = arm.tool.pose[at]  # the press ends here
        super()._open(ids, at)

    def _close(self, ids: Array, at: Array) -> None:
        for hand, target in enumerate(self._targets(ids, at)):
            inside = along_palm(target, 2 * self._press, self._palms[hand])
            self.arms[hand].go(ids, inside, self._speed / 4, self._press)

    def _closing(self, ids: Array, at: Array) -> Array:
        """Until both palms press."""
        press = self.arms[0].touching(ids, at) & self.arms[1].touching(ids, at)
        return np.where(press, GO_ON, np.where(self.steps[ids] >= SQUEEZING_STEPS, _MISSED, STAY))

    def behind(self, ids: Array, at: Array) -> Array:
        """(n,) [m] upwards: the palms are told to be inside of what they hold."""
        return np.max([arm.command[ids, 2] - arm.tool.position[at, 2] for arm in self.arms], axis=0)

    def up(self, ids: Array, at: Array) -> Array:
        del at
        return np.max([P.norm((arm.target - arm.command)[ids, :3]) for arm in self.arms], axis=0) < 1e-6


def along_palm(poses: Array, distance: float, palm: float) -> Array:
    """Tool poses (..., 7) moved by a distance [m] in the direction that the palm looks."""
    way = np.broadcast_to([0.0, distance * np.sign(palm), 0.0], (*poses.shape[:-1], 3))
    return np.concatenate([poses[..., :3] + P.rotate(poses[..., 3:], way), poses[..., 3:]], axis=-1)


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)
