"""A skill that brings a tool to a goal."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.kinematics.chain import Chain
from anysim.planning.api import inverse_kinematics
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView

MOVE, HOLD = range(2)


class Reach(Skill):
    """Solve for the joints once, with the tool turned as it is, then move there and hold still."""

    phases: ClassVar[tuple[str, ...]] = ("move", "hold")

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        patience: Annotated[int, Field(ge=1, description="control steps until it gives up")] = 200,
    ) -> None:
        super().__init__(env)
        self._goal, self._tool, self._patience = goal, robot.tool(tool), patience
        self._arm = env.actions.slice_of(robot.name, "arm")
        self._chain = Chain.from_world(env.engine.world, robot.name, "arm", tool)
        self._solver = inverse_kinematics(self._chain, solver)
        self._joints = np.zeros((env.num_envs, len(self._chain)))
        self._steps = np.zeros(env.num_envs, dtype=np.int64)

    def begin(self, env_ids: Array) -> None:
        """Solve in these envs; where there is no solution the skill has failed before it moved."""
        super().begin(env_ids)
        self._steps[env_ids] = 0
        scene = self.env.scene
        scene.look(env_ids)
        target = np.concatenate([self._goal.position, self._tool.pose[:, 3:]], axis=1)
        base = scene.state.body_pose[env_ids, self._chain.root]
        now = scene.state.joint_pos[np.ix_(env_ids, self._chain.joints)]
        # no restarts from random positions: the arm would swing through what is beside it
        seeds = self.env.streams.episode_seed[env_ids]
        found = self._solver.solve(target, base, now, random_restarts=0, rng_seeds=seeds)
        self._joints[env_ids] = found.joint_pos
        self.outcome[env_ids[~found.converged]] = OUTCOMES.index(Outcome.NO_IK)

    def act(self, env_ids: Array, action: Array) -> None:
        """Ask the arm's controller for the joints; the phase follows from where the tool is."""
        ids = env_ids[self.outcome[env_ids] == OUTCOMES.index(Outcome.RUNNING)]
        self.env.scene.look(ids)
        near = np.linalg.norm(self._goal.position - self._tool.position, axis=1) < 0.02
        self.phase[ids] = np.where(near, HOLD, MOVE)
        self._steps[ids] += 1
        self.outcome[ids[self._steps[ids] > self._patience]] = OUTCOMES.index(Outcome.TIMEOUT)
        action[ids, self._arm.start : self._arm.stop] = self._arm.controller.action_for(self._joints[ids], ids)
