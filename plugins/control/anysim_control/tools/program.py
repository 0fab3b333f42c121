"""Tools, posture and centre of mass weighed against each other in one quadratic program a control step.

What the controllers of this kind have in common; each brings the library that sets its program up and solves it.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Protocol

from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.link_effort import CarryWeight
from anysim_control.tools.servo import FeedForward, ToolServo, VelocityScale
from anysim_control.tools.target import (
    CommandName,
    FrameName,
    Speed,
    StepAngle,
    StepLength,
    ToolNames,
    ToolTargets,
    TurnRate,
)

Cost = Annotated[float, Field(ge=0)]


class Program(Protocol):
    """One program for all tools of a channel."""

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        """See `anysim_control.tools.servo.Solve`."""
        ...


class ToolProgram(Controller):
    """A controller of tools whose subclass makes the program, once, at build."""

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        tool: ToolNames = None,
        frame: FrameName = "base",
        command: CommandName = "pose",
        step_length: StepLength = 0.02,
        step_angle: StepAngle = 0.1,
        speed: Speed = 0.5,
        turn_rate: TurnRate = 1.5,
        velocity_scale: VelocityScale = 1.0,
        feed_forward: FeedForward = "effort",
        carry_weight: CarryWeight = None,
        position_cost: Annotated[Cost, Field(description="of the tools' positions [cost/m]")] = 1.0,
        orientation_cost: Annotated[Cost, Field(description="of the tools' orientations [cost/rad]")] = 0.3,
        posture_cost: Annotated[
            Cost, Field(description="of motion that is not on the way to the posture at the reset [cost/rad]")
        ] = 1e-2,
        posture_gain: Annotated[
            float, Field(ge=0, le=1, description="the part of the way to the posture asked for in a control step")
        ] = 0.02,
        com_cost: Annotated[
            Cost, Field(description="of the centre of mass's way from where it was at the reset, base x and y [cost/m]")
        ] = 0.0,
        damping: Annotated[Cost, Field(description="of every joint's motion [cost^2/rad^2]")] = 1e-8,
    ) -> None:
        super().__init__(channel, num_envs)
        frames = ToolFrames(channel, tool)
        targets = ToolTargets(
            frames,
            num_envs,
            command=command,
            frame=frame,
            step_length=step_length,
            step_angle=step_angle,
            speed=speed,
            turn_rate=turn_rate,
        )
        self._servo = ToolServo(
            frames,
            targets,
            self._solve,
            num_envs,
            feed_forward=feed_forward,
            velocity_scale=velocity_scale,
            carry_weight=carry_weight,
        )
        self.dim, self.low, self.high, self.labels = targets.dim, targets.low, targets.high, targets.labels
        costs = {
            "position_cost": position_cost, "orientation_cost": orientation_cost if targets.oriented else 0.0,
            "posture_cost": posture_cost, "posture_gain": posture_gain, "com_cost": com_cost, "damping": damping,
        }  # fmt: skip
        self._program = self._made(frames, self._servo.max_step, costs)

    @abstractmethod
    def _made(self, frames: ToolFrames, max_step: Array, costs: Mapping[str, float]) -> Program:
        """The program, with the costs by the names of the parameters; `max_step` (K,) a control step."""

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._servo.reset(env_ids, targets)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return self._servo.apply(action, env_ids)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        return self._servo.action_for(targets, env_ids)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return self._servo.snapshot(env_ids)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._servo.restore(env_ids, data)

    def _solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        return self._program.solve(joint_pos, targets, posture)
