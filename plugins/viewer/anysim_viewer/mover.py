"""Moving things by hand: a gizmo in the page, and what it moves through the engine's and the env's own methods."""

from collections.abc import Callable
from dataclasses import replace
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import BodyKind
from anysim.task.env import TaskEnv
from anysim.task.term_registry import goes_on
from anysim_viewer.drawing import place
from anysim_viewer.page import Page

NOTHING = "nothing"
GOAL, OBJECT = "goal ", "object "


class Movable(NamedTuple):
    """Something that can be moved by hand: a goal by name, or the root body of an entity."""

    label: str
    goal: str = ""
    body: int = -1


def movables(env: TaskEnv) -> dict[str, Movable]:
    """What can be moved in an env, by its label: goals that stay where they are, and objects."""
    task = env.spec.task
    moving = {name for name, term in (task.command if task is not None else {}).items() if goes_on("command", term)}
    found = [Movable(GOAL + name, goal=name) for name in env.scene.poses if name not in moving]
    found += [Movable(OBJECT + entity.name, body=entity.root) for entity in env.engine.index.objects]
    return {one.label: one for one in found}


def put(env: TaskEnv, i: int, thing: Movable, pose: Array) -> None:
    """Put a goal or an object of env `i` to a pose (7,), at rest, and have the env look again.

    Raises:
        CapabilityError: the engine cannot be put into a state.
        AnysimError: the pose is none, or nothing is there to be moved.
    """
    ids, mask = np.array([i]), np.arange(env.num_envs) == i
    if thing.goal:
        now = env.snapshot(mask)
        rows = dict(now.managers["task"])
        rows[f"goal.{thing.goal}"] = np.asarray(pose, dtype=float)[None]
        env.reset_to(replace(now, managers={**now.managers, "task": rows}), ids)
        return
    world = env.engine.world
    if not env.scene.presence[i, world.body_entity[thing.body]]:
        raise TaskError(f"{thing.label} is not there in env {i}")
    free = world.bodies[thing.body].kind is BodyKind.FREE
    twist = np.zeros((1, 1, 6)) if free else None
    env.engine.set_body_state(np.asarray(pose, dtype=float)[None, None], twist, ids, [thing.body])
    env.reset_to(env.snapshot(mask), ids)


def pose_of(env: TaskEnv, i: int, thing: Movable) -> Array:
    """Where a thing is (7,)."""
    return env.scene.poses[thing.goal][i] if thing.goal else env.engine.get_state().body_pose[i, thing.body]


class Mover:
    """The choice of what is moved, and its gizmo. While it is dragged only the latest place counts."""

    def __init__(self, page: Page, things: dict[str, Movable], move: Callable[[Movable, Array], object]) -> None:
        self._page, self._things, self._move = page, things, move
        self._gizmo: Any = None
        self._lock = Lock()
        self._latest: Array | None = None
        self.chosen: Movable | None = None
        """What has the gizmo now."""
        with page.server.gui.add_folder("Move"):
            self.choice = page.server.gui.add_dropdown(
                "what", (NOTHING, *things), hint="objects while time stands still, goals at any time"
            )
        self.choice.on_update(lambda _: page.ask(self._choose))

    def _choose(self) -> None:
        self.chosen = None
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None
        with self._lock:
            self._latest = None  # a drag of what was chosen before
        chosen = self._things.get(str(self.choice.value))
        if chosen is None:
            return
        self._gizmo = self._page.server.scene.add_transform_controls("/gizmo", scale=0.15, depth_test=False)
        self._gizmo.on_update(lambda event: self._dragged(event.target))
        self.chosen = chosen  # from here on drags are heard

    def _dragged(self, gizmo: Any) -> None:
        pose = np.concatenate([gizmo.position, np.asarray(gizmo.wxyz)[[1, 2, 3, 0]]])
        with self._lock:
            waiting, self._latest = self._latest is not None, pose
        if not waiting:
            self._page.ask(self._apply)

    def _apply(self) -> None:
        with self._lock:
            pose, self._latest = self._latest, None
        if pose is not None and self.chosen is not None:
            self._move(self.chosen, pose)

    def follow(self, pose: Array) -> None:
        """Have the gizmo where its thing is, unless it is being dragged."""
        with self._lock:
            dragged = self._latest is not None
        if self._gizmo is not None and not dragged:
            place(self._gizmo, pose)
