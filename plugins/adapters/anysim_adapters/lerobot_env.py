"""One env of a task with the names of LeRobot: `agent_pos`, `pixels`, the instruction, the length of episodes."""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from anysim.api import make
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.task.env import TaskEnv
from anysim_learning.gymnasium import GymEnv

GROUP = "policy"
"""The group of observations that becomes `agent_pos`."""
IMAGES = "images/"


def task_env(task: str | None, engine: str | None = None, overrides: Sequence[str] = ()) -> TaskEnv:
    """The env of a task.

    Raises:
        TaskError: none is named, or it has no group `policy`.
    """
    if not task:
        raise TaskError("--env.task is the name of an installed task or a YAML file")
    env = make(task, engine=engine, num_envs=1, overrides=list(overrides))
    if GROUP not in env.observation_sizes:
        groups = listing(env.observation_sizes)
        env.close()
        raise TaskError(f"the task '{task}' has no group '{GROUP}' of observations, which a policy sees: {groups}")
    return env


class LeRobotEnv(gym.Env[dict[str, Any], Array]):
    """A task for LeRobot's vector environments. `info` has `is_success`.

    Attributes:
        task: its name.
    """

    def __init__(
        self,
        task: str | None,
        engine: str | None = None,
        overrides: Sequence[str] = (),
        render_mode: str | None = "rgb_array",
    ) -> None:
        env = task_env(task, engine, overrides)
        self.task = env.name
        self._view = GymEnv(env, render_mode)
        self._cameras = {name.removeprefix(IMAGES): name for name, shape in env.image_shapes.items() if len(shape) == 3}
        self.metadata, self.render_mode = self._view.metadata, render_mode
        self.action_space = self._view.action_space
        shown = self._view.observation_space
        assert isinstance(shown, gym.spaces.Dict)
        spaces: dict[str, gym.Space[Any]] = {"agent_pos": shown[GROUP]}
        if self._cameras:
            spaces["pixels"] = gym.spaces.Dict({camera: shown[name] for camera, name in self._cameras.items()})
        self.observation_space = gym.spaces.Dict(spaces)

    @property
    def task_description(self) -> str:
        """The instruction of the episode."""
        return self._view.env.instruction(0)

    @property
    def _max_episode_steps(self) -> int:
        """The length of an episode, as LeRobot asks for it."""
        task = self._view.env.spec.task
        assert task is not None
        return int(task.horizon)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode."""
        obs, info = self._view.reset(seed=seed, options=options)
        return self._seen(obs), info

    def step(self, action: Array) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One control step."""
        obs, reward, terminated, truncated, info = self._view.step(action)
        return self._seen(obs), reward, terminated, truncated, info

    def _seen(self, obs: dict[str, Array]) -> dict[str, Any]:
        seen: dict[str, Any] = {"agent_pos": np.nan_to_num(obs[GROUP]).astype(np.float32)}
        if self._cameras:
            seen["pixels"] = {camera: obs[name] for camera, name in self._cameras.items()}
        return seen

    def render(self) -> Array | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._view.render()

    def close(self) -> None:
        self._view.close()
