"""The quadratic program of `pink_ik` for one channel: the reduced Pinocchio model, pink's tasks, and its solution."""

from typing import Any

import numpy as np
import pink
import pinocchio as pin  # pyright: ignore[reportMissingImports]  (found by its .pth file)
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import ComTask, FrameTask, LinearHolonomicTask, PostureTask

from anysim.conventions import Array
from anysim.kinematics.pinocchio_model import se3
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.program import Costs, Program, tied

TOOL = "tool: "
UNBOUNDED = 1e6  # [rad], [m]: of joints that do not move anyway; pink refuses a position beyond its limits


class PinkProblem(Program):
    """Pink's tasks for what moves, and what stands between the base and a tool; all joints where their mass counts."""

    name, no_solution = "pink_ik", pink.exceptions.NoSolutionFound
    kept: Array
    configuration: pink.Configuration

    def __init__(self, frames: ToolFrames, max_step: Array, costs: Costs) -> None:
        super().__init__(frames, max_step, costs)
        robot, moving = frames.robot.kinematics, set(frames.moving.tolist())
        whole, first = _with_tools(robot.model, frames), 6 if robot.floating else 0
        kept = moving.union(*(frames.ancestors(name) for name in frames.names))
        if costs.com > 0:
            kept = set(range(len(robot.joints)))
        self.kept = np.array(sorted(kept), dtype=int)
        joint_of = {whole.joints[j].idx_v - first: j for j in range(1, whole.njoints) if whole.joints[j].nv == 1}
        locked = [j for j in range(1, whole.njoints) if j not in {joint_of[int(k)] for k in self.kept}]
        model = pin.buildReducedModel(whole, locked, robot.q(robot.initial))
        column = {int(k): i for i, k in enumerate(self.kept)}
        self.own = np.array([column[int(k)] for k in self.channel.joint_columns], dtype=int)
        lower, upper = np.full(model.nv, -UNBOUNDED), np.full(model.nv, UNBOUNDED)
        lower[self.own] = np.maximum(self.channel.lower, -UNBOUNDED)
        upper[self.own] = np.minimum(self.channel.upper, UNBOUNDED)
        model.lowerPositionLimit, model.upperPositionLimit = lower, upper
        speed = np.full(model.nv, np.inf)
        speed[self.own] = max_step / self.dt
        self.configuration = pink.Configuration(
            model, model.createData(), np.clip(robot.initial[self.kept], lower, upper), copy_data=False
        )
        self._limits = [ConfigurationLimit(model, 1.0), VelocityLimit(model, speed)]
        self.tools = [FrameTask(TOOL + n, costs.position, costs.orientation, lm_damping=1e-6) for n in frames.names]
        weights = np.zeros(model.nv)
        weights[self.own] = 1.0
        self.posture = PostureTask(costs.posture * weights, gain=costs.posture_gain) if costs.posture > 0 else None  # pyright: ignore[reportArgumentType]  (a vector is meant too)
        self.com = ComTask([costs.com, costs.com, 0.0]) if costs.com > 0 else None
        self._all = self.tasks
        still = [i for k, i in column.items() if k not in moving]
        followers = [column[int(k)] for k in frames.moving if k not in self.channel.joint_columns]
        matrix = tied([*still, *followers], frames.spread[self.kept], self.own)
        self._tie: LinearHolonomicTask | None = None
        if len(matrix):
            self._tie = LinearHolonomicTask(matrix, np.zeros(len(matrix)), np.zeros(model.nv), cost=1.0)

    def place(self, pose: Array) -> Any:
        return se3(pose)

    def com_at(self, position: Array) -> Array:
        return np.array(pin.centerOfMass(self.configuration.model, self.configuration.data, position))

    def velocity(self, position: Array) -> Array:
        constraints = None
        if self._tie is not None:
            self._tie.q_0 = position  # the error is zero where it is, so only its change is tied
            constraints = [self._tie]
        return pink.solve_ik(
            self.configuration,
            self._all,
            self.dt,
            solver="daqp",
            damping=self.costs.damping,
            limits=self._limits,
            constraints=constraints,
        )


def _with_tools(model: Any, frames: ToolFrames) -> Any:
    """A copy with the tools under names that nothing else has: pink finds frames by name."""
    copy = model.copy()
    for name, index in zip(frames.names, frames.frames, strict=True):
        frame = model.frames[int(index)]
        copy.addFrame(pin.Frame(TOOL + name, frame.parentJoint, frame.placement, pin.FrameType.OP_FRAME), False)
    return copy
