"""A velocity that a base is to have: drawn, observed, rewarded and judged."""

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.scene import RobotView, SceneView
from anysim_schemas.values import FloatValue, Range

Draw = Callable[..., Array]
_EVENLY = Range(range=(0.0, 1.0))


class Velocity:
    """A velocity of a base along the ground, and a rate of turning, in its own axes; drawn anew every so many seconds.

    `goal_velocity` observes it, `velocity_match` rewards it, and `at_velocity` says that the base has it.
    """

    goes_on = 3

    def __init__(
        self,
        scene: SceneView,
        *,
        forward: Annotated[FloatValue, Field(description="[m/s]")] = 0.0,
        left: Annotated[FloatValue, Field(description="[m/s]")] = 0.0,
        turn: Annotated[FloatValue, Field(description="[rad/s]")] = 0.0,
        every: Annotated[float, Field(gt=0, description="[s]; once an episode where left out")] | None = None,
        still: Annotated[float, Field(ge=0, le=1, description="share of the draws that are zero")] = 0.0,
        straight: Annotated[float, Field(ge=0, le=1, description="share of them that are `forward` alone")] = 0.0,
    ) -> None:
        self._scene, self._parts = scene, {"forward": forward, "left": left, "turn": turn}
        self._still, self._straight = still, still + straight
        dt = scene.engine.world.physics.control_dt
        self._every = None if every is None else max(1, round(every / dt))
        self._update = scene.memory(3)

    def __call__(self, draw: Draw) -> Array:
        elapsed = self._scene.elapsed[self._scene.rows]

        def change(before: Array, first: Array) -> Array:
            due = first if self._every is None else first | (elapsed % self._every == 0)
            after = before.copy()
            for column, (name, value) in enumerate(self._parts.items()):
                after[due, column] = draw(name, value, due)
            if self._straight:
                kind = draw("kind", _EVENLY, due)[:, None]
                keeps = (kind >= self._still) & ((kind >= self._straight) | (np.arange(3) == 0))
                after[due] = np.where(keeps, after[due], 0.0)
            return after

        return self._update(change)


class VelocityView:
    """A commanded velocity. In YAML: the key of a command `tasks.velocity`."""

    reference_kind: ClassVar[str] = "commanded velocity"

    def __init__(self, scene: SceneView, name: str) -> None:
        known = [one for one, goal in scene.goals.items() if goal.shape[1] == 3]
        if name not in known:
            raise NameLookupError(
                f"there is no commanded velocity '{name}'{suggest(name, known)} (commanded velocities: "
                f"{listing(known)}); declare it as `task.command.{name}: {{term: tasks.velocity, forward: …}}`"
            )
        self._scene, self._goal = scene, scene.goals[name]

    @property
    def value(self) -> Array:
        """(n, 3) forward and to the left [m/s], and the rate of turning [rad/s], in the axes of the base."""
        return self._goal[self._scene.rows]

    def error(self, robot: RobotView) -> Array:
        """(n, 3) by how much the base is faster than it is commanded to be [m/s, m/s, rad/s]."""
        turn, twist = robot.base.quaternion, robot.base.twist
        linear, rate = P.rotate_inverse(turn, twist[:, :3]), P.rotate_inverse(turn, twist[:, 3:])
        return np.concatenate([linear[:, :2], rate[:, 2:]], axis=1) - self.value


def goal_velocity(scene: SceneView, *, goal: VelocityView) -> Array:
    """The velocity that a base is to have, forward and to the left, and its rate of turning [m/s, m/s, rad/s]."""
    return goal.value


@at_most(1.0)
def velocity_match(
    scene: SceneView,
    *,
    robot: RobotView,
    goal: VelocityView,
    part: Literal["linear", "turn"] = "linear",
    scale: Annotated[float, Field(gt=0, description="error at which it has dropped to 0.37 [m/s, rad/s]")] = 0.5,
) -> Array:
    """exp(-(error / scale)²) of the base's velocity along the ground, or of its rate of turning, in its own axes."""
    wrong = goal.error(robot)
    return np.exp(-np.sum((wrong[:, :2] if part == "linear" else wrong[:, 2:]) ** 2, axis=1) / scale**2)


def at_velocity(
    scene: SceneView,
    *,
    robot: RobotView,
    goal: VelocityView,
    speed: Annotated[float, Field(gt=0, description="[m/s]")] = 0.1,
    rate: Annotated[float, Field(gt=0, description="[rad/s]")] = 0.2,
) -> Array:
    """The base moves and turns as it is commanded to, within `speed` and `rate`, in its own axes."""
    wrong = goal.error(robot)
    return (P.norm(wrong[:, :2]) <= speed) & (np.abs(wrong[:, 2]) <= rate)


class Tracked:
    """The base has moved as it was commanded to: the root mean squares of its errors are within `speed` and `rate`.

    They are of the episode so far, less the first second after each change of the command. It does not hold before
    `after`.
    """

    SETTLES = 1.0
    """[s]"""

    def __init__(
        self,
        scene: SceneView,
        *,
        robot: RobotView,
        goal: VelocityView,
        after: Annotated[float, Field(gt=0, description="since the episode's beginning [s]")],
        speed: Annotated[float, Field(gt=0, description="[m/s]")] = 0.1,
        rate: Annotated[float, Field(gt=0, description="[rad/s]")] = 0.25,
    ) -> None:
        dt = scene.engine.world.physics.control_dt
        self._scene, self._robot, self._goal, self._most = scene, robot, goal, np.array([speed, rate]) ** 2
        self._after, self._settles = round(after / dt), round(self.SETTLES / dt)
        self._update = scene.memory(7)  # the command, steps since it changed, steps that count, sums of squared errors

    def __call__(self) -> Array:
        seen = self._update(self._pass)
        close = (seen[:, 5:] <= self._most * seen[:, 4:5]).all(axis=1)
        return close & (seen[:, 4] > 0) & (self._scene.elapsed[self._scene.rows] >= self._after)

    def _pass(self, before: Array, first: Array) -> Array:
        command, wrong = self._goal.value, self._goal.error(self._robot)
        since = np.where(first | (command != before[:, :3]).any(axis=1), 0.0, before[:, 3] + 1.0)
        counts = since >= self._settles
        squares = np.stack([counts, (wrong[:, :2] ** 2).sum(axis=1), wrong[:, 2] ** 2], axis=1) * counts[:, None]
        return np.concatenate([command, since[:, None], before[:, 4:] + squares], axis=1)
