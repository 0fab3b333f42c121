"""The learner `sb3-ppo`: proximal policy optimisation of Stable-Baselines3 (Schulman et al. 2017)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from anysim_learning.learner import Lesson
from anysim_learning.parameters import Discount, Entropy, Epochs, Noise, RolloutSteps, TraceDecay, Width
from anysim_schemas.base import Positive

if TYPE_CHECKING:
    import torch  # pyright: ignore[reportMissingImports]

_LAST = ("_last_obs", "_last_episode_starts")
"""What the library's algorithms keep between two calls of `learn` and have no public name for."""


class Sb3Ppo:
    """PPO with running normalisation of observations and rewards, both folded into what is exported."""

    chunk = 1
    needs = ("stable_baselines3", "torch", "tensorboard", "onnx")

    def __init__(
        self,
        lesson: Lesson,
        *,
        learning_rate: Positive = 3e-4,
        n_steps: RolloutSteps = 128,
        batch_size: Annotated[int, Field(ge=2)] = 1024,
        n_epochs: Epochs = 5,
        gamma: Discount = 0.98,
        gae_lambda: TraceDecay = 0.95,
        ent_coef: Entropy = 0.0,
        target_kl: Positive = 0.05,
        width: Width = 256,
        noise: Noise = 0.6,
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
        return {"noise": float(self._model.policy.log_std.exp().mean().item()), **self._view.batch.averages()}

    def state(self) -> dict[str, Any]:
        """Weights, the optimiser's moments, what the normalisation has seen, the envs, and both generators.

        Those are torch's and numpy's global ones, from which the library draws actions and orders of rows.
        """
        import torch  # pyright: ignore[reportMissingImports]

        seen = {
            name: {"mean": rms.mean, "var": rms.var, "count": float(rms.count)}
            for name, rms in (("obs", self._normal.obs_rms), ("reward", self._normal.ret_rms))
        }
        policy = self._model.policy
        return {
            "policy": dict(policy.state_dict()),
            "optimizer": policy.optimizer.state_dict(),
            "seen": seen,
            "returns": self._normal.returns,
            "last": {name: getattr(self._model, name) for name in _LAST},
            "envs": self._view.batch.state(),
            "draws": {"torch": torch.get_rng_state(), "numpy": np.random.get_state()},  # noqa: NPY002  that of the library
            "steps": self.steps,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there, as if it had not been put away."""
        import torch  # pyright: ignore[reportMissingImports]

        from anysim_learning.tensors import tensors

        self._model.policy.load_state_dict(tensors(state["policy"]))
        self._model.policy.optimizer.load_state_dict(tensors(state["optimizer"]))
        for name, rms in (("obs", self._normal.obs_rms), ("reward", self._normal.ret_rms)):
            kept = state["seen"][name]
            rms.mean, rms.var, rms.count = kept["mean"], kept["var"], kept["count"]
        self._normal.returns = np.array(state["returns"])
        for name in _LAST:
            setattr(self._model, name, np.array(state["last"][name]))
        self._view.restore(state["envs"])
        torch.set_rng_state(tensors(state["draws"]["torch"]))
        np.random.set_state(state["draws"]["numpy"])  # noqa: NPY002  that of the library
        self._model.num_timesteps = int(state["steps"])

    def network(self) -> "torch.nn.Module":
        """The mean action, in the units of the env."""
        from anysim_learning.sb3 import Actor

        seen = self._normal.obs_rms
        return Actor(self._model.policy, seen.mean, np.sqrt(seen.var + self._normal.epsilon), self._view.batch.env)
