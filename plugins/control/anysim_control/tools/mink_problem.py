"""The quadratic program of `mink_ik` for one channel: mink's tasks on a kinematic MuJoCo model, and its solution."""

import mink
import mujoco
import numpy as np

from anysim.conventions import Array
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.mink_model import kinematic_model
from anysim_control.tools.program import Costs, Program, tied


class MinkProblem(Program):
    """Mink's tasks for all joints of the robot: its own number and order of them are MuJoCo's."""

    name, no_solution, kept = "mink_ik", mink.NoSolutionFound, slice(None)
    configuration: mink.Configuration

    def __init__(self, frames: ToolFrames, max_step: Array, costs: Costs) -> None:
        super().__init__(frames, max_step, costs)
        robot = frames.robot
        self.own = frames.channel.joint_columns
        model = kinematic_model(robot.world, robot.name)
        still = [j for j in range(model.nv) if j not in set(self.own.tolist())]
        # What does not move of itself may be anywhere: its range must not make the program infeasible.
        model.jnt_limited[still] = 0
        self.configuration = mink.Configuration(model)
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, int(j)) for j in self.own]
        speeds = {name: step / self.dt for name, step in zip(names, max_step, strict=True) if np.isfinite(step)}
        self._limits: list[mink.Limit] = [mink.ConfigurationLimit(model, gain=1.0 - 1e-9)]
        if speeds:
            self._limits.append(mink.VelocityLimit(model, speeds))
        sites = [robot.world.sites[robot.robot.tools[name]].name for name in frames.names]
        self.tools = [mink.FrameTask(s, "site", costs.position, costs.orientation, lm_damping=1e-6) for s in sites]
        weights = np.zeros(model.nv)
        weights[self.own] = costs.posture
        self.posture = mink.PostureTask(model, weights, gain=costs.posture_gain) if costs.posture > 0 else None
        self.com = mink.ComTask(np.array([costs.com, costs.com, 0.0])) if costs.com > 0 else None
        self._all = self.tasks
        self._ties = [_Tie(tied(still, frames.spread, self.own))] if still else []

    def place(self, pose: Array) -> mink.SE3:
        x, y, z, w = pose[3:]
        return mink.SE3(np.array([w, x, y, z, *pose[:3]]))

    def com_at(self, position: Array) -> Array:
        return self.configuration.data.subtree_com[1]

    def velocity(self, position: Array) -> Array:
        return mink.solve_ik(
            self.configuration,
            self._all,
            self.dt,
            "daqp",
            damping=self.costs.damping,
            limits=self._limits,
            constraints=self._ties,
        )


class _Tie(mink.Task):
    """A linear equality of velocities."""

    def __init__(self, matrix: Array) -> None:
        super().__init__(cost=np.ones(len(matrix)))
        self._matrix, self._zero = matrix, np.zeros(len(matrix))

    def compute_error(self, configuration: mink.Configuration) -> Array:
        return self._zero

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        return self._matrix
