"""The scenes of all envs as planners see them, with versions that tell when an answer was planned in another one."""

import numpy as np

from anysim.conventions import Array
from anysim.model.parts import EntityKind
from anysim.model.world import World
from anysim.planning.motion import PlanAnswer, Scene


class Scenes:
    """Poses of N envs. The version of an env rises when something that is no robot has moved by more than a tolerance.

    Robots move all the time, by the very plans that are made: their poses are in a scene but do not age it.
    """

    def __init__(self, world: World, num_envs: int, tolerance: float = 0.002) -> None:
        """`tolerance` [m]; a turn counts by what it moves a point 0.1 m away."""
        robot = np.array([entity.kind is EntityKind.ROBOT for entity in world.entities] + [False])
        self._watched = (
            np.flatnonzero(~robot[np.array(world.body_entity, dtype=int)]) if world.bodies else np.zeros(0, int)
        )
        self._tolerance = tolerance
        self._known = np.full((num_envs, len(self._watched), 7), np.nan)
        self._body_pose = np.tile(world.initial_body_pose, (num_envs, 1, 1))
        self._present = np.tile(world.initial_presence, (num_envs, 1))
        self.version = np.zeros(num_envs, dtype=np.int64)
        self.update(self._body_pose)

    def update(self, body_pose: Array, present: Array | None = None) -> None:
        """Once a control step: world poses (N, B, 7) of all bodies, and which entities are there (N, E)."""
        here = body_pose[:, self._watched]
        shift = np.abs(here[..., :3] - self._known[..., :3]).max(axis=-1, initial=0.0)
        away = 1.0 - np.abs((here[..., 3:] * self._known[..., 3:]).sum(axis=-1))  # about angle^2 / 8
        same = (shift <= self._tolerance) & (away <= (self._tolerance / 0.1) ** 2 / 8)
        moved = ~same.all(axis=1)  # also of what is not a number, as nothing is known at first
        if present is not None:
            moved |= (present != self._present).any(axis=1)
            self._present = np.array(present, dtype=bool)
        self._known[moved] = here[moved]
        self.version[moved] += 1
        self._body_pose = np.array(body_pose, dtype=float)

    def scene(self, env: int) -> Scene:
        """A copy of what an env looks like now."""
        return Scene(int(self.version[env]), self._body_pose[env].copy(), self._present[env].copy())

    def is_stale(self, env: int, answer: PlanAnswer) -> bool:
        """Whether the env has changed since; such an answer is checked again with `MotionPlanner.is_free`."""
        return answer.world_version != self.version[env]
