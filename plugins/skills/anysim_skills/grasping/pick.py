"""Pick: grasp an object from above and bring it to a goal.

The hand approaches above the object, descends along a straight line, closes, and carries the object to the goal with
the loop closed on the object's live position. Everything acts through the `arm` and `eef` channels.
"""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.planning.api import inverse_kinematics
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView

APPROACH, DESCEND, CLOSE, CARRY, BACK_OFF = range(5)
ARRIVED = 0.004
"""[m] distance and [rad] angle of the tool at which a straight move counts as done."""
MAX_LEAD = 0.05
"""[m] the commanded tool never runs further ahead of the real one."""
SLIPPED = 0.05
"""[m] an object further than this from the tool is not held."""
CLOSING_STEPS = 20
SETTLED = 0.02
"""[rad/s, m/s] a gripper whose joints are slower has closed on something, or on nothing."""
YAWS = np.pi / 2 * np.arange(4)

Metres = Annotated[float, Field(gt=0)]


class Pick(Skill):
    """Grasp `object` from above with `robot` and bring it to `goal`."""

    phases: ClassVar[tuple[str, ...]] = ("approach", "descend", "close", "carry", "back off")

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Metres = 0.4,
        descend_speed: Metres = 0.2,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
        phase_steps: Annotated[int, Field(ge=1)] = 150,
    ) -> None:
        """`hover` [m] is the height of the approach; speeds [m/s] are of the tool; `phase_steps` bounds each move."""
        super().__init__(env)
        self._object, self._goal, self._robot = object, goal, robot
        self._tool = robot.tool(tool)
        self._arm, self._eef = env.actions.slice_of(robot.name, "arm"), env.actions.slice_of(robot.name, "eef")
        self._chain = Chain.from_world(env.engine.world, robot.name, "arm", tool)
        self._solver = inverse_kinematics(self._chain, solver)
        self._dt = env.engine.world.physics.control_dt
        self._hover, self._speed, self._descend_speed = hover, speed, descend_speed
        self._above = np.array([0.0, 0.0, hover])
        self._max_attempts, self._phase_steps = max_attempts, phase_steps
        self._fingers = np.array(env.engine.index.robot(robot.name).channels["eef"].joints, dtype=int)
        n = env.num_envs
        self._steps = np.zeros(n, dtype=np.int64)
        self._joints = np.zeros((n, len(self._chain)))  # what the arm is told
        self._command = np.zeros((n, 7))  # where the tool is told to be
        self._grasp_turn = np.zeros((n, 4))  # tool orientation of the chosen grasp

    def begin(self, env_ids: Array) -> None:
        super().begin(env_ids)
        self._steps[env_ids] = 0
        self._restart(env_ids)

    def _restart(self, ids: Array) -> None:
        """Start from where the arm is, with the grasp that is best now."""
        if len(ids) == 0:
            return
        self.env.scene.look(ids)
        self.outcome[ids[~self._object.present]] = OUTCOMES.index(Outcome.ADVERSE_STATE)
        ids = ids[self._object.present]
        if len(ids) == 0:
            return
        self.env.scene.look(ids)
        self._command[ids] = self._tool.pose
        self._joints[ids] = self.env.scene.state.joint_pos[np.ix_(ids, self._chain.joints)]
        self._choose_grasp(ids)
        self.phase[ids], self._steps[ids] = APPROACH, 0

    def _choose_grasp(self, ids: Array) -> None:
        """Of four turns about the vertical, the one that reaches pre-grasp, grasp and goal with the least motion."""
        cube, base = self._object.root.pose, self._base(ids)
        yaw = 2.0 * np.arctan2(cube[:, 5], cube[:, 6])
        hands = [_pointing_down(yaw + turn) for turn in YAWS]
        places = cube[:, :3] + self._above, cube[:, :3], self._goal.position
        targets = np.concatenate([np.concatenate([place, hand], axis=1) for hand in hands for place in places])
        count = len(hands) * len(places)
        seeds = np.tile(self._joints[ids], (count, 1))
        keys = np.tile(self.env.streams.episode_seed[ids], count)
        found = self._solver.solve(targets, np.tile(base, (count, 1)), seeds, random_restarts=0, rng_seeds=keys)
        moved = np.where(found.converged, np.abs(found.joint_pos - seeds).max(axis=1), np.inf)
        effort = moved.reshape(len(hands), len(places), len(ids)).max(axis=1)
        best = effort.argmin(axis=0)  # the first of several that are equal
        rows = np.arange(len(ids))
        self._grasp_turn[ids] = np.stack(hands)[best, rows]
        self.outcome[ids[~np.isfinite(effort[best, rows])]] = OUTCOMES.index(Outcome.NO_IK)

    def _base(self, ids: Array) -> Array:
        return self.env.scene.state.body_pose[ids, self._chain.root]

    def act(self, env_ids: Array, action: Array) -> None:
        ids = env_ids[self.outcome[env_ids] == 0]
        if len(ids) == 0:
            return
        self.env.scene.look(ids)
        targets = self._targets(ids)
        if self._advance(ids, targets):
            ids = ids[self.outcome[ids] == 0]
            if len(ids) == 0:
                return
            self.env.scene.look(ids)
            targets = self._targets(ids)
        self._move(ids, targets)
        self._steps[ids] += 1
        action[ids, self._arm.start : self._arm.stop] = self._arm.controller.action_for(self._joints[ids], ids)
        phase = self.phase[ids]
        closed = (phase == CLOSE) | (phase == CARRY)
        action[ids, self._eef.start : self._eef.stop] = np.where(closed, -1.0, 1.0)[:, None]

    # With few envs it is the number of numpy's calls that takes time, so what concerns no row is left out.

    def _targets(self, ids: Array) -> Array:
        """Where the tool should end up in the present phase (n, 7); the scene must be looking at `ids`."""
        cube, phase = self._object.root.position, self.phase[ids]
        targets = np.empty((len(ids), 7))
        targets[:, :3] = cube
        targets[:, 3:] = self._grasp_turn[ids]
        high = (phase == APPROACH) | (phase == BACK_OFF)
        if high.any():
            targets[high, :3] = cube[high] + self._above
        closing, carrying = phase == CLOSE, phase == CARRY
        if closing.any():
            targets[closing, :3] = self._command[ids[closing], :3]
        if carrying.any():
            targets[carrying, :3] = self._goal.position[carrying] + (self._tool.position[carrying] - cube[carrying])
        return targets

    def _move(self, ids: Array, targets: Array) -> None:
        """Advance the commanded tool pose along its line and solve for the joints."""
        near = P.norm(self._command[ids, :3] - self._tool.position) < MAX_LEAD
        rows = ids[near]
        if len(rows):
            distance = np.where(self.phase[rows] == DESCEND, self._descend_speed * self._dt, self._speed * self._dt)
            self._command[rows] = P.step_toward(self._command[rows], targets[near], distance, 5.0 * distance)
        keys = self.env.streams.episode_seed[ids]
        found = self._solver.solve(
            self._command[ids], self._base(ids), self._joints[ids], random_restarts=0, rng_seeds=keys
        )
        solved = ids[found.converged]
        self._joints[solved] = found.joint_pos[found.converged]

    def _advance(self, ids: Array, targets: Array) -> bool:
        """Gates between the phases. Returns whether any env went through one, or gave up."""
        tool, phase, steps = self._tool.pose, self.phase[ids], self._steps[ids]
        closing, carrying = phase == CLOSE, phase == CARRY
        moving = ~(closing | carrying)
        late = moving & (steps >= self._phase_steps)
        arrived = moving & (P.norm(targets[:, :3] - tool[:, :3]) < ARRIVED)
        if arrived.any():
            turn = P.angle_between(tool[arrived, 3:], targets[arrived, 3:])
            arrived[arrived] = turn < 10 * ARRIVED
        gripped, lost = closing, carrying
        if closing.any():
            speed = np.abs(self.env.scene.state.joint_vel[np.ix_(ids[closing], self._fingers)]).max(axis=1)
            gripped = closing.copy()
            gripped[closing] = (steps[closing] >= 5) & (speed < SETTLED) | (steps[closing] >= CLOSING_STEPS)
        if carrying.any():
            lost = carrying & (P.norm(self._object.root.position - tool[:, :3]) > SLIPPED)
        if not (arrived.any() or gripped.any() or lost.any() or late.any()):
            return False
        self._enter(ids[(phase == APPROACH) & arrived], DESCEND)
        self._enter(ids[(phase == DESCEND) & arrived], CLOSE)
        self._enter(ids[gripped], CARRY)
        self._restart(ids[(phase == BACK_OFF) & (arrived | late)])
        self._retry(ids[lost], Outcome.UNSTABLE_GRASP)
        self._retry(ids[late & ((phase == APPROACH) | (phase == DESCEND))], Outcome.TIMEOUT)
        return True

    def _enter(self, ids: Array, phase: int) -> None:
        self.phase[ids], self._steps[ids] = phase, 0

    def _retry(self, ids: Array, why: Outcome) -> None:
        """Open, rise and try again, or give up with the reason."""
        spent = self.attempts[ids] >= self._max_attempts
        self.outcome[ids[spent]] = OUTCOMES.index(why)
        again = ids[~spent]
        self.attempts[again] += 1
        self._enter(again, BACK_OFF)


def _pointing_down(yaw: Array) -> Array:
    """Tool orientations (n, 4) with z down and x turned by `yaw` (n,) [rad] about the vertical."""
    half = 0.5 * yaw
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), np.sin(half), zero, zero], axis=1)
