"""The view for rsl_rl 5: a `VecEnv` with all observation groups, and its actor as a network of plain tensors."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from rsl_rl.env import VecEnv  # pyright: ignore[reportMissingImports]
from tensordict import TensorDict  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim_learning.batch import Batch
from anysim_learning.return_scale import ReturnScale
from anysim_learning.tensors import InUnits


class RslVecEnv(VecEnv):
    """All envs with all their observation groups; which model sees which is said in the runner's `obs_groups`."""

    def __init__(self, env: TaskEnv, seed: int = 0, scale: ReturnScale | None = None, reach: float = 1.0) -> None:
        """With `scale`, rewards are in deviations of the return; else they are the task's.

        An action of 1 is the share `reach` of the half range.
        """
        self.batch, self.scale, self._reach = Batch(env, tuple(env.observation_sizes)), scale, reach
        assert env.spec.task is not None
        self.num_envs, self.num_actions, self.device = env.num_envs, env.action_dim, "cpu"
        self.max_episode_length = env.spec.task.horizon
        self.cfg: dict[str, Any] = {"task": env.name, "engine": env.engine.name}
        self.episode_length_buf = torch.zeros(env.num_envs, dtype=torch.long)
        self._obs = self.batch.reset(seed)

    def get_observations(self) -> TensorDict:
        """The present observations (N, D) by group."""
        return TensorDict({name: torch.from_numpy(rows.copy()) for name, rows in self._obs.items()}, [self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """One control step; episodes that only ran out of time are `time_outs`."""
        moment = self.batch.step(self._reach * actions.detach().numpy())
        self._obs = moment.obs
        self.episode_length_buf = torch.from_numpy(self.batch.env.scene.elapsed.astype(np.int64))
        reward = moment.reward if self.scale is None else self.scale(moment.reward, moment.done)
        extras = {"time_outs": torch.from_numpy(moment.truncated.copy())}
        return self.get_observations(), _tensor(reward), _tensor(moment.done).long(), extras

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on with the envs as `batch.state` kept them."""
        self._obs = self.batch.restore(state)


class Actor(torch.nn.Module):
    """rsl_rl's actor without its TensorDict, and the range of the actions."""

    def __init__(self, actor: Any, env: TaskEnv, reach: float = 1.0) -> None:
        super().__init__()
        self.inner, self.in_units, self._reach = actor.as_onnx(verbose=False), InUnits(env), reach

    def forward(self, *groups: Any) -> Any:
        return self.in_units(self._reach * self.inner(torch.cat(groups, dim=1)))


def _tensor(rows: Array) -> torch.Tensor:
    return torch.as_tensor(np.asarray(rows, dtype=np.float32))
