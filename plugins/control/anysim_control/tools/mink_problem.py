"""The quadratic program of `mink_ik` for one channel: mink's tasks on a kinematic MuJoCo model, and its solution."""

import mink
import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.mink_model import kinematic_model


class MinkProblem:
    """Not safe for two threads at once."""

    def __init__(
        self,
        frames: ToolFrames,
        max_step: Array,
        *,
        position_cost: float,
        orientation_cost: float,
        posture_cost: float,
        posture_gain: float,
        com_cost: float,
        damping: float,
    ) -> None:
        robot, channel = frames.robot, frames.channel
        self._where = f"mink_ik of '{robot.name}.{channel.name}'"
        self._own, self._damping, self._dt = channel.joint_columns, damping, robot.control_dt
        self._spread = frames.spread
        model = kinematic_model(robot.world, robot.name)
        still = [j for j in range(model.nv) if j not in set(self._own.tolist())]
        # What does not move of itself may be anywhere: its range must not make the program infeasible.
        model.jnt_limited[still] = 0
        self._configuration = mink.Configuration(model)
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, int(j)) for j in self._own]
        speeds = {name: step / self._dt for name, step in zip(names, max_step, strict=True) if np.isfinite(step)}
        self._limits: list[mink.Limit] = [mink.ConfigurationLimit(model, gain=1.0 - 1e-9)]
        if speeds:
            self._limits.append(mink.VelocityLimit(model, speeds))
        sites = robot.world.sites
        self._tools = [
            mink.FrameTask(
                sites[robot.robot.tools[name]].name, "site", position_cost, orientation_cost, lm_damping=1e-6
            )
            for name in frames.names
        ]
        weights = np.zeros(model.nv)
        weights[self._own] = posture_cost
        self._posture = mink.PostureTask(model, weights, gain=posture_gain) if posture_cost > 0 else None
        self._com = mink.ComTask(np.array([com_cost, com_cost, 0.0])) if com_cost > 0 else None
        self._tasks = [t for t in (*self._tools, self._posture, self._com) if t is not None]
        self._ties = [_Tie(_tied(frames, still, model.nv))] if still else []

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        """(E, K) positions a control step after `joint_pos` (E, J) that bring the tools nearest to (E, T, 7)."""
        answer = np.empty((len(joint_pos), len(self._own)))
        for row, position in enumerate(joint_pos):
            answer[row] = self._solve_one(position, targets[row], posture[row])
        return answer

    def _solve_one(self, position: Array, targets: Array, posture: Array) -> Array:
        for task, target in zip(self._tools, targets, strict=True):
            x, y, z, w = target[3:]
            task.set_target(mink.SE3(np.array([w, x, y, z, *target[:3]])))
        rest = np.array(position)
        rest[self._own] = posture
        if self._com is not None:
            self._configuration.update(rest)
            self._com.set_target(self._configuration.data.subtree_com[1])
        if self._posture is not None:
            self._posture.set_target(rest)
        self._configuration.update(position)
        try:
            velocity = mink.solve_ik(
                self._configuration,
                self._tasks,
                self._dt,
                "daqp",
                damping=self._damping,
                limits=self._limits,
                constraints=self._ties,
            )
        except mink.NoSolutionFound as error:
            raise TaskError(f"{self._where}: {error}") from None
        return position[self._own] + velocity[self._own] * self._dt


def _tied(frames: ToolFrames, still: list[int], joints: int) -> Array:
    """A in A dq = 0: joints that are not the channel's stand still, or move as `frames.spread` says."""
    matrix = np.zeros((len(still), joints))
    matrix[np.arange(len(still)), still] = 1.0
    matrix[:, frames.channel.joint_columns] -= frames.spread[still]
    return matrix


class _Tie(mink.Task):
    """A linear equality of velocities."""

    def __init__(self, matrix: Array) -> None:
        super().__init__(cost=np.ones(len(matrix)))
        self._matrix, self._zero = matrix, np.zeros(len(matrix))

    def compute_error(self, configuration: mink.Configuration) -> Array:
        return self._zero

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        return self._matrix
