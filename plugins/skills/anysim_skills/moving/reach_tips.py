"""ReachTips: bring the finger tips of a hand to a goal each, and keep them there."""

from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import NameLookupError, SpecError, SpecIssue
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.planning.api import InverseKinematics, inverse_kinematics
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.grasping.grasp import Metres
from anysim_skills.grasping.hand import Hand

RESTARTS = 8
"""Random postures of a finger from which its inverse kinematics is tried where the posture of now leads nowhere."""
POSITION_ONLY = (0.0, 0.0, 0.0)

Goals = Annotated[dict[str, str], Field(min_length=1, description="`TOOL: FRAME`, a tool at a finger tip and its goal")]


class Finger(NamedTuple):
    """A finger tip and what moves it."""

    tip: Frame
    goal: Frame
    chain: Chain
    solver: InverseKinematics
    columns: Array
    """Of its joints, in the channel."""


class ReachTips(PhasedSkill):
    """Bring tools of `robot` that are at its finger tips to the frames in `goals`, each by the joints of its finger.

    Only the place of a tip matters. Fingers that have no goal stay where they are. Ends with `no_ik` where a goal is
    out of the reach of its finger.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goals: Goals,
        hand: Annotated[str, Field(description="the channel of the fingers")] = "eef",
        solver: str = "numba_ik",
        tolerance: Metres = 0.005,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 10,
        steps: Annotated[int, Field(ge=1, description="control steps that a try may take")] = 60,
    ) -> None:
        self.hand = Hand.of(env, robot, channel=hand)
        self._fingers = [
            _finger(env, robot, hand, tool, goal, self.hand.joints, solver) for tool, goal in goals.items()
        ]
        self._root = self._fingers[0].chain.root
        self._tolerance, self._hold, self._late = tolerance, hold, steps
        self._held = np.zeros(env.num_envs, dtype=np.int64)
        self._reached = np.zeros(env.num_envs, dtype=bool)
        super().__init__(env, [self.hand])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("move", self._enter, self._move, self._late),)

    def _enter(self, ids: Array, at: Array) -> None:
        """Solve each finger for its goal, at first from where it is, then from its home; none moves another."""
        self._held[ids], self._reached[ids] = 0, True
        state = self.env.scene.state
        base, seeds = state.body_pose[ids, self._root], state.joint_pos[np.ix_(ids, self.hand.joints)]
        targets = seeds.copy()
        for finger in self._fingers:
            again = (self.attempts[ids] > 1)[:, None]
            found = finger.solver.solve(
                finger.goal.pose[at],
                base,
                np.where(again, finger.chain.initial, seeds[:, finger.columns]),
                random_restarts=RESTARTS,
                rng_seeds=self.env.streams.episode_seed[ids],
                rotation_weight=POSITION_ONLY,
            )
            targets[:, finger.columns] = found.joint_pos
            self._reached[ids] &= found.position_error < self._tolerance
        self.hand.go(ids, targets)

    def _move(self, ids: Array, at: Array) -> Array:
        left = [P.norm(finger.goal.position[at] - finger.tip.position[at]) for finger in self._fingers]
        there = np.max(left, axis=0) < self._tolerance
        self._held[ids] = (self._held[ids] + 1) * there
        return np.where(~self._reached[ids], _NO_IK, np.where(self._held[ids] >= self._hold, GO_ON, STAY))


def _finger(env: TaskEnv, robot: RobotView, channel: str, tool: str, goal: str, joints: Array, solver: str) -> Finger:
    world = env.engine.world
    try:
        tip, frame = robot.tool(tool), env.scene.frame(goal)
        site = world.sites[env.engine.index.robot(robot.name).tools[tool]]
    except NameLookupError as error:
        raise SpecError([SpecIssue("", f"goals.{tool}", str(error))]) from None
    above: list[int] = []
    body = site.body
    while body >= 0:
        above.append(world.body_joint[body])
        body = world.bodies[body].parent
    chain = Chain.from_world(world, robot.name, channel, tool, joints=[j for j in joints.tolist() if j in above])
    column: Mapping[int, int] = {joint: k for k, joint in enumerate(joints.tolist())}
    columns = np.array([column[joint] for joint in chain.joints.tolist()], dtype=np.int64)
    return Finger(tip, frame, chain, inverse_kinematics(chain, solver), columns)


_NO_IK = OUTCOMES.index(Outcome.NO_IK)
