"""The learner `sb3-ppo`: proximal policy optimisation of Stable-Baselines3 (Schulman et al. 2017)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from anysim_learning.learner import Lesson
from anysim_schemas.base import Positive

if TYPE_CHECKING:
    import torch  # pyright: ignore[reportMissingImports]

RECENT = 100
"""Episodes over which success and reward are averaged."""


class Sb3Ppo:
    """PPO with running normalisation of observations and rewards, both folded into what is exported."""

    chunk = 1
    needs = ("stable_baselines3", "torch", "tensorboard", "onnx")

    def __init__(
        self,
        lesson: Lesson,
        *,
        learning_rate: Positive = 3e-4,
        n_steps: Annotated[int, Field(ge=2, description="control steps of each env between two updates")] = 128,
        batch_size: Annotated[int, Field(ge=2)] = 1024,
        n_epochs: Annotated[int, Field(ge=1)] = 5,
        gamma: Annotated[float, Field(gt=0, le=1)] = 0.98,
        gae_lambda: Annotated[float, Field(ge=0, le=1)] = 0.95,
        ent_coef: Annotated[float, Field(ge=0)] = 0.0,
        target_kl: Positive = 0.05,
        width: Annotated[int, Field(ge=1, description="of the two hidden layers")] = 256,
        noise: Annotated[float, Field(gt=0, description="initial deviation of actions, in half ranges")] = 0.6,
    ) -> None:
        from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
        from stable_baselines3.common.logger import Logger  # pyright: ignore[reportMissingImports]
        from stable_baselines3.common.vec_env import VecNormalize  # pyright: ignore[reportMissingImports]

        from anysim_learning.sb3 import CLIP, Sb3VecEnv

        self._view = Sb3VecEnv(lesson.env, lesson.groups, lesson.seed)
        self._normal = VecNormalize(self._view, clip_obs=CLIP, gamma=gamma)
        self._stretch = n_steps * lesson.env.num_envs
        self._model = PPO(
            "MlpPolicy",
            self._normal,
            learning_rate=learning_rate,
            n_steps=n_steps,
            batch_size=min(batch_size, self._stretch),
            n_epochs=n_epochs,
            gamma=gamma,
            gae_lambda=gae_lambda,
            ent_coef=ent_coef,
            target_kl=target_kl,
            policy_kwargs={"net_arch": [width, width], "log_std_init": float(np.log(noise))},
            seed=lesson.seed,
            device="cpu",
        )
        self._model.set_logger(Logger(folder=None, output_formats=[]))  # its own writes into the temporary folder

    @property
    def steps(self) -> int:
        """Control steps of all envs together."""
        return int(self._model.num_timesteps)

    def advance(self) -> Mapping[str, float]:
        """Collect one rollout and learn from it."""
        self._model.learn(self._stretch, reset_num_timesteps=False)
        finished, told = self._view.finished[-RECENT:], self._model.ep_info_buffer or []
        self._view.finished[:-RECENT] = []
        numbers = {"noise": float(self._model.policy.log_std.exp().mean().item())}
        if told:
            numbers["reward"] = float(np.mean([one["r"] for one in told]))
            numbers["steps_per_episode"] = float(np.mean([one["l"] for one in told]))
        if finished:
            numbers["success"] = finished.count("success") / len(finished)
        return numbers

    def state(self) -> dict[str, Any]:
        """Weights, the optimiser's moments, and what the normalisation has seen."""
        seen = {
            name: {"mean": rms.mean, "var": rms.var, "count": float(rms.count)}
            for name, rms in (("obs", self._normal.obs_rms), ("reward", self._normal.ret_rms))
        }
        policy = self._model.policy
        return {
            "policy": dict(policy.state_dict()),
            "optimizer": policy.optimizer.state_dict(),
            "seen": seen,
            "steps": self.steps,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there, with episodes that follow from the seed and how far it is."""
        from anysim_learning.tensors import tensors

        self._model.policy.load_state_dict(tensors(state["policy"]))
        self._model.policy.optimizer.load_state_dict(tensors(state["optimizer"]))
        for name, rms in (("obs", self._normal.obs_rms), ("reward", self._normal.ret_rms)):
            kept = state["seen"][name]
            rms.mean, rms.var, rms.count = kept["mean"], kept["var"], kept["count"]
        self._model.num_timesteps = int(state["steps"])
        self._view.seed(self._view.start + self._model.num_timesteps)
        self._model.set_random_seed(self._view.start + self._model.num_timesteps)

    def network(self) -> "torch.nn.Module":
        """The mean action, in the units of the env."""
        from anysim_learning.sb3 import Actor

        rms, batch = self._normal.obs_rms, self._view.batch
        return Actor(self._model.policy, rms.mean, rms.var, self._normal.epsilon, batch.middle, batch.half)
