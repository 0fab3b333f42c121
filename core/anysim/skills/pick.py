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
        seeds = self._joints[ids]
        best = np.full(len(ids), np.inf)
        keys = self.env.streams.episode_seed[ids]
        for turn in YAWS:
            hand = _pointing_down(yaw + turn)
            effort = np.zeros(len(ids))
            for offset, place in ((self._hover, cube), (0.0, cube), (0.0, self._goal.pose)):
                target = np.concatenate([place[:, :3] + [0.0, 0.0, offset], hand], axis=1)
                found = self._solver.solve(target, base, seeds, random_restarts=0, rng_seeds=keys)
                moved = np.abs(found.joint_pos - seeds).max(axis=1)
                effort = np.maximum(effort, np.where(found.converged, moved, np.inf))
            better = effort < best
            best = np.where(better, effort, best)
            self._grasp_turn[ids[better]] = hand[better]
        self.outcome[ids[~np.isfinite(best)]] = OUTCOMES.index(Outcome.NO_IK)

    def _base(self, ids: Array) -> Array:
        return self.env.scene.state.body_pose[ids, self._chain.root]

    def act(self, env_ids: Array, action: Array) -> None:
        ids = env_ids[self.outcome[env_ids] == 0]
        if len(ids) == 0:
            return
        self._advance(ids)
        ids = ids[self.outcome[ids] == 0]
        if len(ids) == 0:
            return
        self.env.scene.look(ids)
        self._move(ids)
        self._steps[ids] += 1
        action[ids, self._arm.start : self._arm.stop] = self._arm.controller.action_for(self._joints[ids], ids)
        closed = (self.phase[ids] == CLOSE) | (self.phase[ids] == CARRY)
        action[ids, self._eef.start : self._eef.stop] = np.where(closed, -1.0, 1.0)[:, None]

    def _targets(self, ids: Array) -> Array:
        """Where the tool should end up in the present phase (n, 7); the scene must be looking at `ids`."""
        tool, cube, goal = self._tool.position, self._object.root.position, self._goal.position
        phase = self.phase[ids][:, None]
        above = cube + np.array([0.0, 0.0, self._hover])
        position = np.where(phase == APPROACH, above, cube)
        position = np.where(phase == CLOSE, self._command[ids, :3], position)
        position = np.where(phase == CARRY, goal + (tool - cube), position)
        position = np.where(phase == BACK_OFF, above, position)
        return np.concatenate([position, self._grasp_turn[ids]], axis=1)

    def _move(self, ids: Array) -> None:
        """Advance the commanded tool pose along its line and solve for the joints."""
        slow = self.phase[ids] == DESCEND
        near = P.norm(self._command[ids, :3] - self._tool.position) < MAX_LEAD
        targets = self._targets(ids)
        for speed, chosen in ((self._speed, ~slow & near), (self._descend_speed, slow & near)):
            rows = ids[chosen]
            if len(rows):
                distance = speed * self._dt
                self._command[rows] = P.step_toward(self._command[rows], targets[chosen], distance, 5.0 * distance)
        keys = self.env.streams.episode_seed[ids]
        found = self._solver.solve(
            self._command[ids], self._base(ids), self._joints[ids], random_restarts=0, rng_seeds=keys
        )
        solved = ids[found.converged]
        self._joints[solved] = found.joint_pos[found.converged]

    def _advance(self, ids: Array) -> None:
        """Gates between the phases."""
        self.env.scene.look(ids)
        tool, cube = self._tool.pose, self._object.root.position
        targets = self._targets(ids)
        arrived = (P.norm(targets[:, :3] - tool[:, :3]) < ARRIVED) & (
            P.angle_between(tool[:, 3:], targets[:, 3:]) < 10 * ARRIVED
        )
        speed = np.abs(self.env.scene.state.joint_vel[np.ix_(ids, self._fingers)]).max(axis=1)
        gripped = (self._steps[ids] >= 5) & (speed < SETTLED) | (self._steps[ids] >= CLOSING_STEPS)
        lost = P.norm(cube - tool[:, :3]) > SLIPPED
        phase, late = self.phase[ids], self._steps[ids] >= self._phase_steps
        self._enter(ids[(phase == APPROACH) & arrived], DESCEND)
        self._enter(ids[(phase == DESCEND) & arrived], CLOSE)
        self._enter(ids[(phase == CLOSE) & gripped], CARRY)
        self._restart(ids[(phase == BACK_OFF) & (arrived | late)])
        self._retry(ids[(phase == CARRY) & lost], Outcome.UNSTABLE_GRASP)
        self._retry(ids[late & ((phase == APPROACH) | (phase == DESCEND))], Outcome.TIMEOUT)

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
