"""TaskEnv: the loop. No autoreset here; gymnasium's modes and other dialects are views on it."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeVar

import numpy as np

from anysim import registry
from anysim.controllers.action_space import ActionSpaces
from anysim.conventions import Array
from anysim.engine import arguments
from anysim.engine.base import SimEngine
from anysim.engine.snapshots.row_checks import damaged, refuse_range
from anysim.errors import AnysimError, PluginError, SnapshotError, TaskError
from anysim.hooks import Observing
from anysim.managers.action import ActionManager
from anysim.managers.base import RESET_ORDER, Manager
from anysim.managers.camera import CaptureManager
from anysim.managers.curriculum import CurriculumManager
from anysim.managers.families import FamilyManager
from anysim.managers.sensors import SensorManager
from anysim.managers.terrain import TerrainManager
from anysim.math import arrays
from anysim.sensors.base import Sensor
from anysim.task.bindings import Bindings
from anysim.task.contract import FAILED, RUNNING, STATUS_NAMES, SUCCESS, TRUNCATED, Obs, StepResult
from anysim.task.overrides import Counterfactuals
from anysim.task.scene import SceneView
from anysim.task.snapshot import EnvSnapshot, refuse_foreign, spec_hash
from anysim.task.term_registry import bind_function
from anysim.task.terms_runtime import Mdp
from anysim_schemas.run import RunSpec

_Kind = TypeVar("_Kind", bound=Manager)
NO_TASK = "this file has no `task`; a world alone can be run through `create_simulation`"

Overriding = Mapping[str, Any] | Sequence[Mapping[str, Any]] | None
"""Values by dotted path, for all envs alike or for each."""


class TaskEnv:
    """`num_envs` environments of one task on one engine.

    An env must be reset before it is stepped, and again when it has ended. Env i's episodes depend on its own seed
    alone: not on the number of envs, nor on when the others are reset.
    """

    def __init__(
        self,
        spec: RunSpec,
        engine: SimEngine,
        managers: Sequence[Manager],
        name: str = "task",
        *,
        strict_observers: bool = False,
        located: Callable[[str], str] = str,
    ) -> None:
        """`engine` has its world, `managers` are configured and built; `anysim.make` does all of this.

        `located` puts the file, line and column of its key before a dotted path, for what terms and controllers raise.
        """
        if spec.task is None:
            raise TaskError(NO_TASK)
        self.spec, self.engine, self.name = spec, engine, name
        self.num_envs = engine.num_envs
        order = {manager: place for place, manager in enumerate(RESET_ORDER)}
        self.managers = sorted(managers, key=lambda m: order[m.name])
        self.located = located
        for manager in self.managers:
            manager.located = located
            manager.bind(engine)
        self.streams, self._episodes = self.managers[0].streams, self.managers[0].episodes
        self.actions, self.capture = self._manager(ActionManager), self._manager(CaptureManager)
        self.action_dim = self.actions.dim
        self.scene = SceneView(engine, self._episodes, self._manager(TerrainManager))
        self.scene.capture = self.capture
        self.families = next((manager for manager in self.managers if isinstance(manager, FamilyManager)), None)
        self.scene.families = self.families
        self.sensors = next((manager for manager in self.managers if isinstance(manager, SensorManager)), None)
        if self.sensors is not None:
            self.sensors.attach(self._sensor, self.scene.look)
            self.scene.sensors = self.sensors
        self.scene.action_columns = {name: slice(s.start, s.stop) for name, s in self.action_spaces.items()}
        self.bindings = Bindings(spec.collect, self.num_envs, self.streams)
        self.mdp = Mdp(spec.task, self.scene, self.streams, located, self.bindings)
        self.capture.goals = self.scene.poses
        self.scene.last_action = np.zeros((self.num_envs, self.action_dim))
        self.counterfactuals = Counterfactuals(self.managers, self.mdp, engine, self.streams)
        for manager in self.managers:
            if isinstance(manager, CurriculumManager):
                manager.narrow(self.counterfactuals.paths)
        self._task = spec.task
        self._code, self._success = self._episodes.code, self._episodes.succeeded
        self._fault = np.zeros(self.num_envs, dtype=bool)
        self._closed = False
        self.physics_seconds = 0.0
        """Wall time [s] of the engine's steps so far, for tables of where time goes; nothing else depends on it."""
        self._obs: Obs = {}
        self._observers = Observing(strict_observers)
        self.scene.look(None)
        self.observation_sizes = {group: rows.shape[1] for group, rows in self.mdp.observe().items()}
        """Components of each observation group."""
        self.image_shapes = self.capture.image_shapes
        """The shape of each observed image, by `images/CAMERA`."""
        self._observers.call("after_build", env=self)

    def _sensor(self, kind: str, params: Mapping[str, Any], path: str) -> Sensor:
        made, who = registry.load("sensors", kind), f"the sensor '{kind}'"
        with registry.Blame(f"{self.located(path)}: {who}", registry.origin(made)):
            sensor: object = bind_function(made, who.removeprefix("the "), params, self.scene, path)
        if isinstance(sensor, Sensor):
            return sensor
        raise PluginError(f"{who} of {registry.origin(made)} is no Sensor; derive it from anysim.sensors.base.Sensor")

    def _manager(self, kind: type[_Kind]) -> _Kind:
        return next(manager for manager in self.managers if isinstance(manager, kind))

    # ------------------------------------------------------------------ facts

    @property
    def action_bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds (A,) of the action."""
        return self.actions.low.copy(), self.actions.high.copy()

    @property
    def action_spaces(self) -> ActionSpaces:
        """What each channel takes, by `robot.channel`, in the order of the flat action."""
        return self.actions.spaces

    @property
    def obs(self) -> Obs:
        """The latest observation of all envs, as after the last reset or step. Reading it changes nothing."""
        return {group: rows.copy() for group, rows in self._obs.items()}

    @property
    def status(self) -> Array:
        """(N,) the word of `Status` for each env."""
        return STATUS_NAMES[np.maximum(self._code, 0)]

    @property
    def info(self) -> dict[str, Array]:
        """Info of all envs now, as in `StepResult.info`."""
        return self._info()

    @property
    def running(self) -> Array:
        """(N,) bool: reset, and not ended."""
        return self._code == RUNNING

    def sensor_rows(self, env_ids: Array) -> dict[str, Array]:
        """What is recorded of sensors and families (n, …), by the names of the arrays."""
        rows = {} if self.sensors is None else self.sensors.recorded(env_ids)
        return rows if self.families is None else rows | self.families.recorded(env_ids)

    def instruction(self, env: int) -> str:
        """The task in words, as it is in an env's episode."""
        return self.bindings.said(self._task.description, env)

    # ------------------------------------------------------------------ reset

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        mask: Array | None = None,
        episode_seeds: Sequence[int] | Array | None = None,
        overrides: Overriding = None,
    ) -> tuple[Obs, dict[str, Array]]:
        """Start new episodes in all envs, or where `mask` (N,) is true.

        Args:
            seed: an int seeds env i with (seed, i), whatever N; a sequence gives each chosen env its own seed; None
                goes on with the generators as they are, at first those of the spec's seed.
            episode_seeds: draw exactly these episodes instead (for replay).
            overrides: for these episodes, values in place of those that the spec has drawn or fixed, by dotted path, as
                in `{"layout.cube.x": 0.4}`; or a list of such mappings, one for each env. Nothing else moves.

        Returns:
            Observations and info of the chosen envs only, in order.
        """
        ids = arrays.chosen(mask, self.num_envs, TaskError)
        plan = self.counterfactuals.checked(overrides, len(ids), midway=False)
        if episode_seeds is not None:  # before anything moves
            episode_seeds = arrays.wholes("episode_seeds", episode_seeds, len(ids), TaskError)
        if len(ids) == 0:  # managers need not know how to reset no env
            return {g: r[:0] for g, r in self.mdp.observe().items()}, {k: v[ids] for k, v in self._info().items()}
        if seed is not None:
            self.streams.seed(seed, ids)
        self.counterfactuals.over(ids)
        self.streams.begin(ids, episode_seeds)
        self.counterfactuals.begin(ids, plan)
        self.engine.reset(ids)
        self._episodes.elapsed[ids] = 0
        for manager in self.managers:
            manager.reset(ids)
        self.counterfactuals.settle(ids, plan)
        self.scene.last_action[ids] = 0.0
        self._code[ids], self._fault[ids], self._success[ids] = RUNNING, False, False
        self.scene.meet()
        self.scene.look(ids)
        self.mdp.reset(ids)
        if self.sensors is not None:
            self.sensors.begin(ids)
        self.counterfactuals.mark(ids, plan)
        rows = self._observe(ids)
        self._store(rows, ids)
        self._observers.call("before_episode", env=self, env_ids=ids)
        return {g: r.copy() for g, r in rows.items()}, {k: v[ids] for k, v in self._info().items()}

    def retire(self, env_ids: Array) -> None:
        """End episodes that are given up: these envs are truncated now if they were running."""
        running = env_ids[self._code[env_ids] == RUNNING]
        self._code[running] = TRUNCATED

    def _rows(self, env_ids: Sequence[int] | Array | None) -> Array:
        return np.arange(self.num_envs) if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")

    def _observe(self, ids: Array | None) -> Obs:
        """All groups and images of all envs, or of those in `ids`."""
        rows = self.mdp.observe()
        if self.image_shapes:
            rows |= self.capture.observe(np.arange(self.num_envs) if ids is None else ids)
        return rows

    def _store(self, rows: Obs, ids: Array | None) -> None:
        """Keep the latest observation: a fresh array for a full batch, rows written into the present one otherwise."""
        if ids is None or np.array_equal(ids, np.arange(self.num_envs)):  # all of them may come in another order
            self._obs = rows
            return
        for group, values in rows.items():
            kept = self._obs.get(group)
            # copied before it is written to: earlier results may still hold the array
            fresh = np.zeros((self.num_envs, *values.shape[1:]), values.dtype) if kept is None else kept.copy()
            fresh[ids] = values
            self._obs[group] = fresh

    # ------------------------------------------------------------------ step

    def step(self, action: Any, mask: Array | None = None) -> StepResult:
        """One control step of all envs, or only where `mask` (N,) is true.

        The order is fixed: actions, physics, status, reward, interval events, observation, hooks. Observations thus
        show the state that the reward and the status were judged by. Envs that are not stepped keep their status and
        observation and have reward 0.

        Args:
            action: (N, A), or an array (N, k) for each of `action_spaces` by its name; clipped to the bounds. Rows of
                envs that are not stepped are ignored.

        Raises:
            TaskError: an env has not been reset since it ended (with `ended: hold` and no mask it is left out instead).
        """
        running = self._code == RUNNING
        ids = self._stepped(running, mask)
        clipped = self.actions.validated(action)
        self.actions.act(clipped, ids)
        if ids is None:
            self.scene.last_action = clipped
        else:
            self.scene.last_action[ids] = clipped[ids]
        self._advance(ids)
        rows = slice(None) if ids is None else ids
        self._episodes.elapsed[rows] += 1
        self.scene.look(ids)
        if self.sensors is not None:
            self.sensors.sample(self.scene.env_ids)
        self._evaluate(rows)
        reward = self._reward(ids)
        self.mdp.interval_events()
        observed = self._observe(ids)
        self._store(observed, ids)
        result = StepResult(self._full(observed, ids), reward, STATUS_NAMES[self._code], self._info())
        self._observers.stepped(self, result, ids)
        return result

    def _advance(self, ids: Array | None) -> None:
        """The physics of a control step, in as many parts as controllers want."""
        schedule, advance = (
            self.actions.schedule,
            (self.engine.step if self.families is None else self.families.advance),
        )
        for part, steps in enumerate(schedule):
            if part:
                self.actions.update(part)
            began = time.perf_counter()
            advance(steps, ids, keep_wrench=part + 1 < len(schedule))
            self.physics_seconds += time.perf_counter() - began

    def _stepped(self, running: Array, mask: Array | None) -> Array | None:
        """The envs to step: None for all of them."""
        if mask is None and np.count_nonzero(running) == self.num_envs:
            return None
        wanted = arrays.chosen(mask, self.num_envs, TaskError)
        ended = wanted[~running[wanted]]
        if len(ended) == 0 and len(wanted) == self.num_envs:
            return None
        hold = mask is None and self._task.ended == "hold" and running.any() and (self._code >= 0).all()
        if len(ended) and not hold:
            words = {
                int(i): "not reset yet" if self._code[i] < 0 else str(STATUS_NAMES[self._code[i]]) for i in ended[:8]
            }
            raise TaskError(f"envs {words} cannot be stepped; call reset(mask=...) before step()")
        return np.flatnonzero(running) if hold else wanted

    def _evaluate(self, rows: Any) -> None:
        success, failure = self.mdp.judge()
        fault = self.engine.get_state().fault[rows]
        if self.families is not None:
            fault = fault | self.families.fault(self.scene.env_ids)
        self._fault[rows] = fault
        self._success[rows] = success & ~fault
        self._code[rows] = RUNNING
        wins = success if self._task.on_success == "end" else None
        late = self._episodes.elapsed[rows] >= self._task.horizon
        for where, word in ((late, TRUNCATED), (failure, FAILED), (wins, SUCCESS), (fault, FAILED)):
            if where is not None and np.count_nonzero(where):
                self._code[self.scene.env_ids[where]] = word

    def _reward(self, ids: Array | None) -> Array:
        if ids is None:
            return self.mdp.reward(self._fault)
        reward = np.zeros(self.num_envs, dtype=np.float32)
        reward[ids] = self.mdp.reward(self._fault[ids])
        return reward

    def _full(self, observed: Obs, ids: Array | None) -> Obs:
        return {g: rows.copy() for g, rows in observed.items()} if ids is None else self.obs

    def _info(self) -> dict[str, Array]:
        return {
            "is_success": self._success.copy(),
            "fault": self._fault.copy(),
            "elapsed_steps": self._episodes.elapsed.copy(),
            "episode_seed": self.streams.episode_seed.copy(),
        }

    # ------------------------------------------------------------------ snapshots, images, end

    def snapshot(self, mask: Array | None = None) -> EnvSnapshot:
        """Envs at this moment. Continuing from it equals the uninterrupted run, bit for bit."""
        ids = arrays.chosen(mask, self.num_envs, TaskError)
        return EnvSnapshot(
            self.engine.snapshot(ids), self._managed(ids), self.streams.snapshot(ids), self.name, spec_hash(self.spec)
        )

    def _managed(self, ids: Array) -> dict[str, Mapping[str, Array]]:
        """The rows of all managers and of the task."""
        managers: dict[str, Mapping[str, Array]] = {m.name: m.snapshot(ids) for m in self.managers}
        managers["task"] = self.mdp.snapshot(ids) | {
            "elapsed": self._episodes.elapsed[ids],
            "last_action": self.scene.last_action[ids],
            "code": self._code[ids],
            "fault": self._fault[ids],
            "success": self._success[ids],
        }
        return managers

    def reset_to(
        self, snapshot: EnvSnapshot, env_ids: Sequence[int] | Array | None = None, overrides: Overriding = None
    ) -> Obs:
        """Put a snapshot's envs into `env_ids` (default: all, in order); returns their observations.

        Args:
            overrides: values to go on with in place of those of the snapshot, by dotted path, as in
                `{"objects.cube.friction": 0.2}`; or a list of such mappings, one for each env. Nothing else moves.

        Raises:
            SnapshotError: it was taken in another world or task, engine or version, or of another number of envs.
            TaskError: something cannot be overridden, or not in the middle of an episode.

        Whatever is raised, nothing was changed: all of it is checked before the first row is written.
        """
        if not isinstance(snapshot, EnvSnapshot):
            raise SnapshotError(f"reset_to() takes what snapshot() of an env gives, got a {type(snapshot).__name__}")
        ids = self._rows(env_ids)
        self._refuse(snapshot, ids)
        plan = self.counterfactuals.checked(overrides, len(ids), midway=True)
        before, streams = self._managed(ids), self.streams.snapshot(ids)
        try:
            self._put(ids, snapshot.managers, snapshot.streams)
            self.engine.restore(snapshot.engine, ids, checked=True)
        except BaseException:
            self._put(ids, before, streams)
            raise
        self.counterfactuals.change(ids, plan)
        self.scene.meet()
        self.scene.look(ids)
        rows = self._observe(ids)
        self._store(rows, ids)
        return {g: r.copy() for g, r in rows.items()}

    def _refuse(self, snapshot: EnvSnapshot, ids: Array) -> None:
        """Refuse what cannot be put into these envs; a snapshot may come from a file of any origin."""
        self.engine.refuse_snapshot(snapshot.engine, ids)
        managed = self._managed(np.array([0]))
        refuse_foreign(snapshot, self.name, spec_hash(self.spec), managed, len(ids))
        task, streams = snapshot.managers["task"], snapshot.streams
        refuse_range("elapsed", task["elapsed"], 0, self._task.horizon)
        refuse_range("code", task["code"], RUNNING - 1, TRUNCATED)
        self.mdp.refuse_rows(task)
        for manager in self.managers:
            manager.refuse_rows(snapshot.managers[manager.name])
        try:
            self.counterfactuals.refuse_restored(streams["overridden"])
        except AnysimError as error:
            raise damaged(str(error)) from error

    def _put(self, ids: Array, managers: Mapping[str, Mapping[str, Array]], streams: Mapping[str, Any]) -> None:
        """Write the rows of managers, task and streams."""
        for manager in self.managers:
            manager.restore(ids, managers[manager.name])
        task = managers["task"]
        self.mdp.restore(ids, task)
        self._episodes.elapsed[ids], self.scene.last_action[ids] = task["elapsed"], task["last_action"]
        self._code[ids], self._fault[ids] = task["code"], task["fault"]
        self._success[ids] = task["success"]
        self.streams.restore(ids, streams)

    def render(
        self,
        camera: str | None = None,
        env_ids: Sequence[int] | Array | None = None,
        *,
        size: tuple[int | None, int | None] = (None, None),
        markers: bool = True,
    ) -> Array:
        """Images (E, H, W, 3) uint8 of a camera (default: the world's first, else an overview), for people.

        Goals are marked in them unless `markers` is false; `size` is width and height [px] in place of the camera's.
        """
        cameras = self.engine.world.cameras
        name = (cameras[0].name if cameras else "default") if camera is None else camera
        if not isinstance(size, Sequence) or len(size) != 2:
            raise TaskError("size is a width and a height [px], such as (640, 480), or None for that of the camera")
        images = self.engine.render(name, size[0], size[1], env_ids=env_ids)["rgb"]
        ids = self._rows(env_ids)
        return self.capture.mark(images, name, ids) if markers else images

    def close(self) -> None:
        """Free the engine. May be called twice."""
        if not self._closed:
            self._closed = True
            try:
                self._observers.call("on_close", env=self)
                self._observers.closed()
            finally:
                self.engine.destroy()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
