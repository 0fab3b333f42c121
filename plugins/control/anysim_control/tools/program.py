"""Tools, posture and centre of mass weighed against each other in one quadratic program a control step.

Each controller of this kind brings the library that sets its program up and solves it.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, Unpack

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.ik_controller import IkController, IkOptions

Cost = Annotated[float, Field(ge=0)]


@dataclass(frozen=True)
class Costs:
    """How the parts of a program are weighed, see the parameters of `ToolProgram`."""

    position: float
    orientation: float
    posture: float
    posture_gain: float
    com: float
    damping: float


class Task(Protocol):
    """A library's task for a tool, the posture or the centre of mass."""

    def set_target(self, target: Any, /) -> None:
        """Lead what the task is about there."""


class Configuration(Protocol):
    """A library's robot model at joint positions."""

    def update(self, q: Array, /) -> None:
        """Go to joint positions (M,)."""


class Program(ABC):
    """One program for all tools of a channel. Not safe for two threads at once.

    The constructor of a subclass sets the attributes, which are its library's.

    Attributes:
        name: of the controller.
        no_solution: what the library raises where the program has none.
        kept: (M,) of the robot's J joints: those of the library's model.
        own: (K,) of the M: the channel's joints.
        configuration: the model, at joint positions.
        tools: a task each.
        posture, com: None where they cost nothing.
    """

    name: str
    no_solution: type[Exception]
    kept: Array | slice
    own: Array
    configuration: Configuration
    tools: Sequence[Task]
    posture: Task | None
    com: Task | None

    def __init__(self, frames: ToolFrames, max_step: Array, costs: Costs) -> None:
        self.channel, self.max_step, self.costs = frames.channel, max_step, costs
        self.dt = frames.robot.control_dt

    @abstractmethod
    def place(self, pose: Array) -> object:
        """A pose (7,) as the library has them."""

    @abstractmethod
    def com_at(self, position: Array) -> Array:
        """(3,) the centre of mass at joint positions (M,), to which `configuration` was updated."""

    @abstractmethod
    def velocity(self, position: Array) -> Array:
        """The joint velocities (M,) that solve the program at joint positions (M,)."""

    @property
    def tasks(self) -> list[Any]:
        """Those that cost anything: the library's, in the order that it adds them up."""
        return [task for task in (*self.tools, self.posture, self.com) if task is not None]

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        """(E, K) positions a control step after `joint_pos` (E, J) that bring the tools nearest to (E, T, 7)."""
        answer = np.empty((len(joint_pos), len(self.own)))
        for row, position in enumerate(joint_pos):
            answer[row] = self._solve_one(position[self.kept], targets[row], posture[row])
        return answer

    def _solve_one(self, position: Array, targets: Array, posture: Array) -> Array:
        for task, target in zip(self.tools, targets, strict=True):
            task.set_target(self.place(target))
        rest = np.array(position)
        rest[self.own] = posture
        if self.com is not None:
            self.configuration.update(rest)
            self.com.set_target(self.com_at(rest))
        if self.posture is not None:
            self.posture.set_target(rest)
        self.configuration.update(position)
        try:
            velocity = self.velocity(position)
        except self.no_solution as error:
            raise TaskError(f"{self.name} of '{self.channel.robot.name}.{self.channel.name}': {error}") from None
        return position[self.own] + velocity[self.own] * self.dt


def tied(rows: Sequence[int], spread: Array, own: Array) -> Array:
    """A (R, M) in A dq = 0: joints `rows` of the M stand still, or move with the channel's as `spread` (M, K) says."""
    matrix = np.zeros((len(rows), len(spread)))
    matrix[np.arange(len(rows)), rows] = 1.0
    matrix[:, own] -= spread[rows]
    return matrix


class ToolProgram(IkController):
    """A controller of tools whose subclass makes the program, once, at build."""

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        position_cost: Annotated[Cost, Field(description="of the tools' positions [cost/m]")] = 1.0,
        orientation_cost: Annotated[Cost, Field(description="of the tools' orientations [cost/rad]")] = 0.3,
        posture_cost: Annotated[
            Cost, Field(description="of motion away from the posture at the reset [cost/rad]")
        ] = 1e-2,
        posture_gain: Annotated[
            float, Field(ge=0, le=1, description="the part of the distance to the posture asked for in a control step")
        ] = 0.02,
        com_cost: Annotated[
            Cost,
            Field(
                description="of the centre of mass's displacement from where it was at the reset, base x and y [cost/m]"
            ),
        ] = 0.0,
        damping: Annotated[Cost, Field(description="of every joint's motion [cost^2/rad^2]")] = 1e-8,
        **options: Unpack[IkOptions],
    ) -> None:
        super().__init__(channel, num_envs, **options)
        orientation = orientation_cost if self.targets.oriented else 0.0
        self._program = self._made(Costs(position_cost, orientation, posture_cost, posture_gain, com_cost, damping))

    @abstractmethod
    def _made(self, costs: Costs) -> Program:
        """The program of `frames`, `max_step` and the costs."""

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        return self._program.solve(joint_pos, targets, posture)
