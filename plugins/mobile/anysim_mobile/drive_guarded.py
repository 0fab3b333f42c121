"""DriveGuarded: drive to a pose on the ground, and stop in time for people who step into the way."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.env import TaskEnv
from anysim_mobile.guarded_base import GuardedBase, Watch
from anysim_skills.moving.navigate import Navigate


class DriveGuarded(Navigate):
    """Drive the base of `robot` straight to `goal`, and stand still while one of `people` is in the way."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        people: Annotated[tuple[str, ...], Field(min_length=1, description="entities that are watched")],
        clear: Annotated[float, Field(gt=0, description="[m] to a person when it has stopped")] = 0.5,
        braking: Annotated[float, Field(gt=0, description="[m/s^2] of the base's controller")] = 0.7,
        latency: Annotated[float, Field(ge=0, description="[s] from what is seen to what is done")] = 0.1,
        planner: Annotated[str, Field(description="a base that guards")] = "guarded",
        steps: Annotated[int, Field(ge=1, description="control steps that the way may take")] = 3000,
        **options: object,
    ) -> None:
        super().__init__(env, planner=planner, steps=steps, **options)  # pyright: ignore[reportArgumentType]
        if not isinstance(self.base, GuardedBase):
            raise TaskError(f"the planner '{planner}' does not stop for people; expected one that does: guarded")
        self._guard = self.base
        delay = round(latency / env.engine.world.physics.control_dt)
        self._guard.look_out(people, Watch(delay, clear, braking))

    def _held_up(self, ids: Array, at: Array) -> Array:
        """(n,) bool: somebody in the way is not what holds a base up."""
        waits = self._guard.held[ids]
        self._nearest[ids] = np.where(waits, self.steps[ids], self._nearest[ids])
        return super()._held_up(ids, at) & ~waits
