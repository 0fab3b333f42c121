"""Place near: put an object down beside another one."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, Phase, PhasedSkill
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.grasp import Force, Metres, Speed
from anysim_skills.grasping.pick_place import PickPlace
from anysim_skills.grasping.tidy import Names, handles
from anysim_skills.object_shapes import ObjectShapes

SIDES = 8
"""Directions about the other object that are looked at."""


class Beside(Frame):
    """The frame of `target` moved to a place [m] in its own frame that is chosen in each env: `place` (N, 2)."""

    def __init__(self, target: ObjectView, num_envs: int) -> None:
        super().__init__(target.scene, target.name)
        self._target, self.place = target.root, np.zeros((num_envs, 2))

    def _compute(self) -> Array:
        shift = np.zeros((len(self.scene.env_ids), 7))
        shift[:, :2], shift[:, 6] = self.place[self.scene.env_ids], 1.0
        return P.compose(self._target.pose, shift)


class ChooseSide(PhasedSkill):
    """Choose where beside `near` on `target` there is room for `object`; of several places that nearest to it."""

    def __init__(
        self, env: TaskEnv, object: ObjectView, near: ObjectView, target: ObjectView, gap: float, avoid: Sequence[str]
    ) -> None:
        self._object, self._near, self._target, self._gap = object, near, target, gap
        self.beside = Beside(target, env.num_envs)
        self._others = handles(env, avoid, "avoid")
        self._shapes = {thing.name: ObjectShapes(env.scene, thing) for thing in (object, near, target, *self._others)}
        super().__init__(env)

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("choose a side", None, self._choose, 1),)

    def _on_target(self, thing: ObjectView, at: Array) -> Array:
        """(n, 2) [m] where it is in the target's frame."""
        target = self._target.root
        return P.rotate_inverse(target.quaternion[at], thing.root.position[at] - target.position[at])[:, :2]

    def _choose(self, ids: Array, at: Array) -> Array:
        radius = {name: shape.radius(ids) for name, shape in self._shapes.items()}
        own = radius[self._object.name]
        angle = 2 * np.pi / SIDES * np.arange(SIDES)
        away = (radius[self._near.name] + own + self._gap)[:, None, None]
        place = self._on_target(self._near, at)[:, None] + away * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        low, high = self._shapes[self._target.name].box(ids)
        room = own[:, None, None]
        free = ((place - room >= low[:, None, :2]) & (place + room <= high[:, None, :2])).all(axis=-1)
        for thing in self._others:
            apart = P.norm(place - self._on_target(thing, at)[:, None])
            free &= (apart > (own + radius[thing.name] + self._gap)[:, None]) | ~thing.present[at][:, None]
        far = np.where(free, P.norm(place - self._on_target(self._object, at)[:, None]), np.inf)
        self.beside.place[ids] = place[np.arange(len(ids)), far.argmin(axis=1)]
        return np.where(free.any(axis=-1), GO_ON, _NO_ROOM)


class PlaceNear(SkillSequence):
    """Grasp `object` with `robot` and put it down on `target` beside `near`, `gap` from it, clear of `avoid`."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        near: ObjectView,
        target: ObjectView,
        gap: Annotated[float, Field(gt=0, description="[m] between circles about the two, for the fingers")] = 0.05,
        avoid: Names = (),
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        above: Annotated[float, Field(gt=0, description="[m] over the place on the way there and back")] = 0.1,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.03,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
    ) -> None:
        """Where there is no room it fails with `adverse_state` before anything is touched."""
        side = ChooseSide(env, object, near, target, gap, avoid)
        arm = {"robot": robot, "tool": tool, "solver": solver, "hover": hover, "speed": speed}
        pace = {"above": above, "tolerance": tolerance, "max_attempts": max_attempts, "force": force}
        put = PickPlace(env, **arm, **pace, object=object, target=side.beside)
        super().__init__(env, {"side": side, "put": put})


_NO_ROOM = OUTCOMES.index(Outcome.ADVERSE_STATE)
