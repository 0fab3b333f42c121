"""Homing: how arms recover once all else has failed: let go, straight back, up, and to the posture they began in."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.scene import ObjectView
from anysim_skills.arm import Arm
from anysim_skills.grasping.hand import Hand
from anysim_skills.moving.retract import RetractMoveL
from anysim_skills.planned_moves import PLANNED_STEPS
from anysim_skills.recovery.other_stand import OtherStand, Ways

OPENING_STEPS = 25
BACK, UP = 0.06, 0.1
"""[m] against the way that the tool comes, and then up."""
SPEED = 0.2
"""[m/s]"""
RETRACT_STEPS, HOMING_STEPS = 60, 300
"""Control steps; what has not got there by then goes on from where it is."""
LAG = 0.15
"""[rad] an arm may be behind what it is told: what is in its way is not pressed on any harder."""
NEAR = 0.05
"""[rad] from the posture it began in at which an arm that is slow is home."""
SLOW = 0.1
"""[rad/s]"""


def still_held(arm: Arm, env: int, failure: Outcome) -> bool:
    """Whether what a skill has begun with in its hand is still there after a failure, and not yet let go of."""
    return failure is not Outcome.UNSTABLE_GRASP and bool(arm.closed[env])


class Homing:
    """The phases in which the arms of a skill recover, all at once.

    An arm whose moves are planned has its way home planned, and stays where it is if there is none. Every other one
    goes home joint by joint, and waits where something holds it up.
    """

    def __init__(
        self,
        skill: PhasedSkill,
        *arms: Arm,
        hand: Hand | None = None,
        opens: bool = True,
        held: ObjectView | None = None,
        onto: Sequence[float] = (0.0, 0.0, 1.0),
        ways: Ways | None = None,
    ) -> None:
        """Recover `skill`, with `onto` the direction in the tool's frame in which the hand comes.

        Fingers open unless `opens` is false; what they then keep is `held`, which a planned way takes into account.
        A base below the arm drives to another stand from which the arm goes one of `ways`.
        """
        self._skill, self._arms, self._hand, self._opens, self._held = skill, arms, hand, opens, held
        self._onto = np.array(onto)
        self._stand = None if ways is None else OtherStand(skill, arms[0], ways)
        self._retracts = [RetractMoveL(arm, speed=SPEED) for arm in arms]

    def phases(self) -> Sequence[Phase]:
        """For `PhasedSkill.make_recovery`."""
        let_go = Phase("let go", self._open, self._opening, OPENING_STEPS + 1)
        return (
            *((let_go,) if self._opens else ()),
            Phase("draw back", self._back, self._retracting, RETRACT_STEPS + 1),
            Phase("draw up", self._up, self._retracting, RETRACT_STEPS + 1),
            Phase("go home", self._leave, self._homing, PLANNED_STEPS + 1),
            *(() if self._stand is None else (self._stand.phase(),)),
        )

    def _open(self, ids: Array, at: Array) -> None:
        for arm in self._arms:
            arm.command[ids] = arm.tool.pose[at]  # whatever is pressed on
            arm.stay(ids)
            arm.closed[ids] = False
        if self._hand is not None:
            self._hand.open(ids)

    def _opening(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._skill.steps[ids] >= OPENING_STEPS, GO_ON, STAY)

    def _back(self, ids: Array, at: Array) -> None:
        for arm, retract in zip(self._arms, self._retracts, strict=True):
            onto = np.broadcast_to(self._onto, (len(ids), 3))
            retract.begin(ids, at, -BACK * P.rotate(arm.tool.quaternion[at], onto))

    def _up(self, ids: Array, at: Array) -> None:
        for retract in self._retracts:
            retract.begin(ids, at, np.tile([0.0, 0.0, UP], (len(ids), 1)))

    def _retracting(self, ids: Array, at: Array) -> Array:
        """Until all of them are there, or held up by what is behind them."""
        done = np.all([retract.step(ids, at) != STAY for retract in self._retracts], axis=0)
        return np.where(done | (self._skill.steps[ids] >= RETRACT_STEPS), GO_ON, STAY)

    def _leave(self, ids: Array, at: Array) -> None:
        del at
        for arm in self._arms:
            if arm.plans is not None:
                arm.plan(ids, arm.home(ids)[:, None], held=self._held)

    def _homing(self, ids: Array, at: Array) -> Array:
        del at
        done = np.all([self._planned(arm, ids) if arm.plans else self._turned(arm, ids) for arm in self._arms], axis=0)
        return np.where(done, GO_ON, STAY)

    def _planned(self, arm: Arm, ids: Array) -> Array:
        """(n,) bool: the planned move has ended, one way or the other, or takes too long."""
        return (arm.planned(ids) != STAY) | (self._skill.steps[ids] >= PLANNED_STEPS)

    def _turned(self, arm: Arm, ids: Array) -> Array:
        """(n,) bool: home, or as far as it gets."""
        home, told = arm.chain.initial, arm.joints[ids]
        state, columns = arm.env.scene.state, np.ix_(ids, arm.chain.joints)
        actual, speed = state.joint_pos[columns], np.abs(state.joint_vel[columns]).max(axis=1)
        late = self._skill.steps[ids] >= HOMING_STEPS
        waits = (np.abs(told - actual).max(axis=1) > LAG) | late
        arm.turn_to(ids, np.where(waits[:, None], told, home))
        return late | ((np.abs(actual - home).max(axis=1) < NEAR) & (speed < SLOW))
