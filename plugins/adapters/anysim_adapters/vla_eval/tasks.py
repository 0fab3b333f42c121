"""Tasks as vla-eval's harness steps them: one env, an episode at a time, the seeds of a split."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim.api import load, make
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math.arrays import numbers
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim_evaluation.driver import episode_seeds

IMAGES, STATE = "images/", "policy"


class EvalStep(NamedTuple):
    """One step: what is seen, its reward, whether the episode has ended, and the word of its status."""

    obs: dict[str, Any]
    reward: float
    done: bool
    status: str


class EvalTasks:
    """Tasks of which one is there at a time.

    Attributes:
        names: of the tasks, installed ones or files.
    """

    def __init__(
        self,
        tasks: str | Sequence[str],
        *,
        engine: str | None = None,
        overrides: Sequence[str] = (),
        split: str = "test",
        first: int = 0,
        privileged: bool = False,
    ) -> None:
        """Make the first task.

        Args:
            tasks: installed tasks by name, or YAML files.
            engine: in place of theirs.
            overrides: of all of them, `PATH=VALUE`.
            split: of the seeds; episode k of a task has its seed number `first + k`.
            first: place in the split.
            privileged: send the group of observations that only a simulator knows.
        """
        self.names = [tasks] if isinstance(tasks, str) else list(tasks)
        if not self.names:
            raise TaskError("vla-eval runs at least one task: params: {tasks: [pick_cube]}")
        self._engine, self._overrides = engine, list(overrides)
        self._split, self._first, self._privileged = split, first, privileged
        episode_seeds(split, first, 1)
        self._name, self._env, self._seed = self.names[0], self._made(self.names[0]), 0

    def _made(self, name: str) -> TaskEnv:
        return make(name, engine=self._engine, num_envs=1, overrides=self._overrides)

    @property
    def env(self) -> TaskEnv:
        """That of the task that is there."""
        return self._env

    def horizon(self) -> int:
        """Control steps of the longest episode of any task."""
        specs = [load(name, overrides=self._overrides).spec for name in self.names]
        return max(int(spec.task.horizon) for spec in specs if spec.task is not None)

    def reset(self, name: str, episode: int) -> dict[str, Any]:
        """Begin an episode of a task; the env of another one is freed before.

        Raises:
            TaskError: there is no such task here, or the split has too few seeds.
        """
        if name not in self.names:
            raise TaskError(f"there is no task '{name}' in this benchmark (tasks: {listing(self.names)})")
        [seed] = episode_seeds(self._split, self._first + episode, 1)
        if name != self._name:
            self._env.close()
            self._name, self._env = name, self._made(name)
        self._env.reset(seed=[seed])
        self._seed = seed
        return self._seen()

    def step(self, action: Mapping[str, Any]) -> EvalStep:
        """One control step by `actions` (A,), or the first row of a chunk of one step.

        Raises:
            TaskError: it has another shape, or no finite numbers.
        """
        given = action.get("actions", action.get("action"))
        if given is None:
            raise TaskError(f"an action is a map with 'actions', got {listing(map(str, action))}")
        row = numbers("actions", given, TaskError)
        dim = self._env.action_dim
        if row.shape not in ((dim,), (1, dim)) or not np.isfinite(row).all():
            raise TaskError(f"'{self._name}' takes ({dim},) finite numbers as actions, got {row.shape}")
        result = self._env.step(row.reshape(1, dim))
        return EvalStep(self._seen(), float(result.reward[0]), not self._env.running[0], str(self._env.status[0]))

    def result(self) -> dict[str, Any]:
        """How the episode stands."""
        status = str(self._env.status[0])
        return {"success": status == Status.SUCCESS, "status": status, "seed": self._seed}

    def seconds(self) -> float:
        """Simulated time since the episode began [s]."""
        return float(self._env.info["elapsed_steps"][0]) * self._env.engine.world.physics.control_dt

    def _seen(self) -> dict[str, Any]:
        """Colour images by camera, numbers under `states`, and the instruction."""
        obs, shapes = self._env.obs, self._env.image_shapes
        seen: dict[str, Any] = {"task_description": self._env.instruction(0)}
        images = {name.removeprefix(IMAGES): obs[name][0] for name, shape in shapes.items() if len(shape) == 3}
        if images:
            seen["images"] = images
        groups = [STATE, "privileged"] if self._privileged else [STATE]
        rows: list[Array] = [obs[group][0] for group in groups if group in self._env.observation_sizes]
        if rows:
            seen["states"] = np.nan_to_num(np.concatenate(rows)).astype(np.float32)
        return seen

    def close(self) -> None:
        """Free the env."""
        self._env.close()
