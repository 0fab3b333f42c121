"""The view for Stable-Baselines3: a `VecEnv` whose observation is one vector, of the policy's group unless asked."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim_learning.batch import POLICY, Batch
from anysim_learning.tensors import InUnits

CLIP = 10.0
"""Normalised observations are cut off there."""


class Sb3VecEnv(VecEnv):
    """All envs at once, without a Python loop over them.

    Observations are those of `groups` one after the other (N, D) float32, actions are in [-1, 1]. `infos` have what
    SB3 reads: `terminal_observation`, `TimeLimit.truncated`, `episode` and `is_success`.
    """

    def __init__(self, env: TaskEnv, groups: Sequence[str] = (POLICY,), seed: int = 0) -> None:
        self.batch = Batch(env, groups)
        size = sum(self.batch.sizes.values())
        super().__init__(
            env.num_envs,
            gym.spaces.Box(-np.inf, np.inf, (size,), np.float32),
            gym.spaces.Box(-1.0, 1.0, (env.action_dim,), np.float32),
        )
        self.start, self._begun = seed, False
        self._actions: Array = np.zeros((env.num_envs, env.action_dim))

    def reset(self) -> Array:
        """First observations (N, D). Later calls go on with the seeds of the first."""
        seed = None if self._begun else self.start
        self._begun = True
        return self._joined(self.batch.reset(seed))

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on with the envs as `batch.state` kept them."""
        self.batch.restore(state)
        self._begun = True

    def step_async(self, actions: Array) -> None:
        """Note the actions (N, A) of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Take the step."""
        moment = self.batch.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for one in moment.ended:
            infos[one.env] = {
                "terminal_observation": np.concatenate([one.obs[group] for group in self.batch.groups]),
                "TimeLimit.truncated": bool(moment.truncated[one.env]),
                "episode": {"r": one.total_reward, "l": one.steps},
                "is_success": one.status == "success",
            }
        return self._joined(moment.obs), moment.reward, moment.done, infos

    def _joined(self, obs: dict[str, Array]) -> Array:
        return np.concatenate([obs[group] for group in self.batch.groups], axis=1)

    def close(self) -> None:
        """End the envs."""
        self.batch.env.close()

    def seed(self, seed: int | None = None) -> Sequence[None]:
        """Choose the episodes that follow the next reset."""
        if seed is not None:
            self.start, self._begun = seed, False
        return [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, once for each env that is asked for."""
        found = None if attr_name == "render_mode" else getattr(self.batch.env, attr_name)
        return [found] * len(list(self._asked(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the batch, which is of all its envs."""
        setattr(self.batch.env, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of the batch, once."""
        found = getattr(self.batch.env, method_name)(*method_args, **method_kwargs)
        return [found] * len(list(self._asked(indices)))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No env is wrapped."""
        return [False] * len(list(self._asked(indices)))

    def _asked(self, indices: Any) -> Iterable[int]:
        return self._get_indices(indices)


class Actor(torch.nn.Module):
    """The normalisation, the policy's mean, and the range of the actions."""

    def __init__(self, policy: Any, mean: Array, deviation: Array, env: TaskEnv) -> None:
        super().__init__()
        self.body, self.head, self.in_units = policy.mlp_extractor.policy_net, policy.action_net, InUnits(env)
        self.register_buffer("mean", torch.as_tensor(mean, dtype=torch.float32))
        self.register_buffer("deviation", torch.as_tensor(deviation, dtype=torch.float32))

    def forward(self, *groups: Any) -> Any:
        x = torch.cat(groups, dim=1)
        x = torch.clamp((x - self.mean) / self.deviation, -CLIP, CLIP)
        return self.in_units(self.head(self.body(x)))
