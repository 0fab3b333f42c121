"""The quadratic program of `pink_ik` for one channel: the reduced Pinocchio model, pink's tasks, and its solution."""

from typing import Any

import numpy as np
import pink
import pinocchio as pin  # pyright: ignore[reportMissingImports]  (found by its .pth file)
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import ComTask, FrameTask, LinearHolonomicTask, PostureTask

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.kinematics.pinocchio_model import se3
from anysim_control.tools.frames import ToolFrames

TOOL = "tool: "
UNBOUNDED = 1e6  # [rad], [m]: of joints that do not move anyway; pink refuses a position beyond its limits


class PinkProblem:
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
        self._channel, self._damping = frames.channel, damping
        robot = frames.robot.kinematics
        whole, first = _with_tools(robot.model, frames), 6 if robot.floating else 0
        kept = set(frames.moving.tolist()).union(*(frames.ancestors(name) for name in frames.names))
        if com_cost > 0:
            kept = set(range(len(robot.joints)))
        self._kept = np.array(sorted(kept), dtype=int)
        """(M,) of the robot's J: what moves, and what stands between the base and a tool."""
        joint_of = {whole.joints[j].idx_v - first: j for j in range(1, whole.njoints) if whole.joints[j].nv == 1}
        locked = [j for j in range(1, whole.njoints) if j not in {joint_of[int(k)] for k in self._kept}]
        model = pin.buildReducedModel(whole, locked, robot.q(robot.initial))
        column = {int(k): i for i, k in enumerate(self._kept)}
        self._own = np.array([column[int(k)] for k in self._channel.joint_columns], dtype=int)
        """(K,) of the M: the channel's joints."""
        still = [i for k, i in column.items() if k not in set(frames.moving.tolist())]
        coupled = [column[int(k)] for k in frames.moving if k not in self._channel.joint_columns]
        lower, upper = np.full(model.nv, -UNBOUNDED), np.full(model.nv, UNBOUNDED)
        lower[self._own] = np.maximum(self._channel.lower, -UNBOUNDED)
        upper[self._own] = np.minimum(self._channel.upper, UNBOUNDED)
        model.lowerPositionLimit, model.upperPositionLimit = lower, upper
        self._dt = frames.robot.control_dt
        speed = np.full(model.nv, np.inf)
        speed[self._own] = max_step / self._dt
        self._configuration = pink.Configuration(
            model, model.createData(), np.clip(robot.initial[self._kept], lower, upper), copy_data=False
        )
        self._limits = [ConfigurationLimit(model, 1.0), VelocityLimit(model, speed)]
        self._tools = [
            FrameTask(TOOL + name, position_cost, orientation_cost, lm_damping=1e-6) for name in frames.names
        ]
        weights = np.zeros(model.nv)
        weights[self._own] = 1.0
        self._posture = PostureTask(posture_cost * weights, gain=posture_gain) if posture_cost > 0 else None  # pyright: ignore[reportArgumentType]  (a vector is meant too)
        self._com = ComTask([com_cost, com_cost, 0.0]) if com_cost > 0 else None
        self._tasks = [t for t in (*self._tools, self._posture, self._com) if t is not None]
        self._tie = self._ties(frames, still, coupled, model.nv)

    def _ties(
        self, frames: ToolFrames, still: list[int], coupled: list[int], joints: int
    ) -> LinearHolonomicTask | None:
        """What must not move does not, and what follows follows: A dq = 0."""
        if not still and not coupled:
            return None
        matrix = np.zeros((len(still) + len(coupled), joints))
        matrix[np.arange(len(still)), still] = 1.0
        for row, follower in enumerate(coupled, start=len(still)):
            matrix[row, follower] = 1.0
            matrix[row, self._own] -= frames.spread[self._kept[follower]]
        return LinearHolonomicTask(matrix, np.zeros(len(matrix)), np.zeros(joints), cost=1.0)

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        """(E, K) positions a control step after `joint_pos` (E, J) that bring the tools nearest to (E, T, 7)."""
        answer = np.empty((len(joint_pos), len(self._own)))
        for row, position in enumerate(joint_pos):
            answer[row] = self._solve_one(position[self._kept], targets[row], posture[row])
        return answer

    def _solve_one(self, position: Array, targets: Array, posture: Array) -> Array:
        for task, target in zip(self._tools, targets, strict=True):
            task.set_target(se3(target))
        rest = np.array(position)
        rest[self._own] = posture
        if self._com is not None:
            self._configuration.update(rest)
            self._com.set_target(np.array(pin.centerOfMass(self._configuration.model, self._configuration.data, rest)))
        if self._posture is not None:
            self._posture.set_target(rest)
        self._configuration.update(position)
        constraints = None
        if self._tie is not None:
            self._tie.q_0 = position  # the error is zero where it is, so only its change is tied
            constraints = [self._tie]
        try:
            velocity = pink.solve_ik(
                self._configuration,
                self._tasks,
                self._dt,
                solver="daqp",
                damping=self._damping,
                limits=self._limits,
                constraints=constraints,
            )
        except pink.exceptions.NoSolutionFound as error:
            raise TaskError(f"pink_ik of '{self._channel.robot.name}.{self._channel.name}': {error}") from None
        return position[self._own] + velocity[self._own] * self._dt


def _with_tools(model: Any, frames: ToolFrames) -> Any:
    """A copy with the tools under names that nothing else has: pink finds frames by name."""
    copy = model.copy()
    for name, index in zip(frames.names, frames.frames, strict=True):
        frame = model.frames[int(index)]
        copy.addFrame(pin.Frame(TOOL + name, frame.parentJoint, frame.placement, pin.FrameType.OP_FRAME), False)
    return copy
