"""The learner `rsl-rl`: PPO of rsl_rl 5 (ETH Zurich), with observation groups of its own for the critic.

Source: rsl_rl's `VecEnv` and `OnPolicyRunner`.
"""

import io
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import Annotated, Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from pydantic import Field
from rsl_rl.env import VecEnv  # pyright: ignore[reportMissingImports]
from rsl_rl.runners import OnPolicyRunner  # pyright: ignore[reportMissingImports]
from tensordict import TensorDict  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim_learning.batch import Batch
from anysim_learning.learner import Lesson
from anysim_learning.tensors import tensors
from anysim_schemas.base import Positive

RECENT = 100
"""Episodes over which success and reward are averaged."""


class RslVecEnv(VecEnv):
    """All envs with all their observation groups; which model sees which is said in the runner's `obs_groups`."""

    def __init__(self, env: TaskEnv, seed: int = 0) -> None:
        self.batch = Batch(env, tuple(env.observation_sizes))
        assert env.spec.task is not None
        self.num_envs, self.num_actions, self.device = env.num_envs, env.action_dim, "cpu"
        self.max_episode_length = env.spec.task.horizon
        self.cfg: dict[str, Any] = {"task": env.name, "engine": env.engine.name}
        self.episode_length_buf = torch.zeros(env.num_envs, dtype=torch.long)
        self.finished: list[tuple[str, float, int]] = []
        """How the episodes ended so far: status, reward, steps."""
        self._obs = self.batch.reset(seed)

    def get_observations(self) -> TensorDict:
        """The present observations (N, D) by group."""
        return TensorDict({name: torch.from_numpy(rows.copy()) for name, rows in self._obs.items()}, [self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """One control step; episodes that only ran out of time are `time_outs`."""
        moment = self.batch.step(actions.detach().numpy())
        self._obs = moment.obs
        self.finished += [(one.status, one.total_reward, one.steps) for one in moment.ended]
        self.episode_length_buf = torch.from_numpy(self.batch.env.scene.elapsed.astype(np.int64))
        extras = {"time_outs": torch.from_numpy(moment.truncated.copy())}
        return self.get_observations(), _tensor(moment.reward), _tensor(moment.done).long(), extras

    def begin(self, seed: int) -> None:
        """Begin other episodes."""
        self._obs = self.batch.reset(seed)


class RslPpo:
    """PPO with running normalisation and an adaptive rate; the critic sees every observation group there is."""

    chunk = 1

    def __init__(
        self,
        lesson: Lesson,
        *,
        learning_rate: Positive = 1e-3,
        n_steps: Annotated[int, Field(ge=2, description="control steps of each env between two updates")] = 64,
        n_epochs: Annotated[int, Field(ge=1)] = 5,
        n_batches: Annotated[int, Field(ge=1, description="parts that a rollout is learnt from in")] = 4,
        gamma: Annotated[float, Field(gt=0, le=1)] = 0.98,
        lam: Annotated[float, Field(ge=0, le=1)] = 0.95,
        entropy_coef: Annotated[float, Field(ge=0)] = 0.0,
        desired_kl: Positive = 0.01,
        width: Annotated[int, Field(ge=1, description="of the two hidden layers")] = 256,
        noise: Annotated[float, Field(gt=0, description="initial deviation of actions, in half ranges")] = 0.6,
    ) -> None:
        torch.manual_seed(lesson.seed)
        self._lesson, self._view = lesson, RslVecEnv(lesson.env, lesson.seed)
        self._stretch = n_steps * lesson.env.num_envs
        self.steps = 0
        network = {
            "class_name": "MLPModel",
            "hidden_dims": [width, width],
            "activation": "elu",
            "obs_normalization": True,
        }
        config: dict[str, Any] = {
            "num_steps_per_env": n_steps,
            "save_interval": 10**9,
            "obs_groups": {"actor": list(lesson.groups), "critic": list(lesson.env.observation_sizes)},
            "actor": network | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": noise}},
            "critic": dict(network),
            "algorithm": {
                "class_name": "PPO",
                "learning_rate": learning_rate,
                "num_learning_epochs": n_epochs,
                "num_mini_batches": n_batches,
                "gamma": gamma,
                "lam": lam,
                "entropy_coef": entropy_coef,
                "desired_kl": desired_kl,
            },
        }
        with redirect_stdout(io.StringIO()):  # it prints its networks
            self._runner = OnPolicyRunner(self._view, config, log_dir=None, device="cpu")

    def advance(self) -> Mapping[str, float]:
        """Collect one rollout and learn from it."""
        with redirect_stdout(io.StringIO()):
            self._runner.learn(1)
        self.steps += self._stretch
        recent = self._view.finished = self._view.finished[-RECENT:]
        numbers = {"noise": float(self._runner.alg.get_policy().output_std.mean().item())}
        if recent:
            status, reward, steps = zip(*recent, strict=True)
            numbers["reward"], numbers["steps_per_episode"] = float(np.mean(reward)), float(np.mean(steps))
            numbers["success"] = status.count("success") / len(status)
        return numbers

    def state(self) -> dict[str, Any]:
        """What rsl_rl saves, and how far it is."""
        return {"saved": self._runner.alg.save(), "rate": self._runner.alg.learning_rate, "steps": self.steps}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there, with episodes that follow from the seed and how far it is."""
        self._runner.alg.load(tensors(state["saved"]), None, True)
        self._runner.alg.learning_rate = float(state["rate"])
        self.steps = int(state["steps"])
        torch.manual_seed(self._lesson.seed + self.steps)
        self._view.begin(self._lesson.seed + self.steps)

    def network(self) -> torch.nn.Module:
        """The mean action, in the units of the env."""
        return _Actor(self._runner.alg.get_policy(), self._view.batch)


class _Actor(torch.nn.Module):
    """rsl_rl's actor without its TensorDict, and the range of the actions."""

    def __init__(self, actor: Any, batch: Batch) -> None:
        super().__init__()
        self.inner = actor.as_onnx(verbose=False)
        self.register_buffer("middle", _tensor(batch.middle))
        self.register_buffer("span", _tensor(batch.half))

    def forward(self, *groups: Any) -> Any:
        return self.middle + self.span * torch.clamp(self.inner(torch.cat(groups, dim=1)), -1.0, 1.0)


def _tensor(rows: Array) -> torch.Tensor:
    return torch.as_tensor(np.asarray(rows, dtype=np.float32))
