"""The learner `rsl-rl`: PPO of rsl_rl 5 (ETH Zurich), with observation groups of its own for the critic.

Source: rsl_rl's `VecEnv` and `OnPolicyRunner`.
"""

import io
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from anysim_learning.learner import Lesson
from anysim_learning.parameters import Discount, Entropy, Epochs, Noise, RolloutSteps, TraceDecay, Width
from anysim_learning.return_scale import ReturnScale
from anysim_schemas.base import Positive

if TYPE_CHECKING:
    import torch  # pyright: ignore[reportMissingImports]

_ADOPTED = 4
"""As many stretches count what the normalisation of adopted networks has seen: less than what it will see here."""


class RslPpo:
    """PPO with running normalisation and an adaptive rate; the critic sees every observation group there is."""

    chunk = 1
    needs = ("rsl_rl", "torch", "tensorboard", "onnx")

    def __init__(
        self,
        lesson: Lesson,
        *,
        learning_rate: Positive = 1e-3,
        n_steps: RolloutSteps = 64,
        n_epochs: Epochs = 5,
        n_batches: Annotated[int, Field(ge=1, description="parts that a rollout is learnt from in")] = 4,
        gamma: Discount = 0.98,
        lam: TraceDecay = 0.95,
        entropy_coef: Entropy = 0.0,
        desired_kl: Positive = 0.01,
        width: Width = 256,
        noise: Noise = 0.6,
        reach: Annotated[
            float, Field(gt=0, le=1, description="the share of an action's half range that an output of 1 means")
        ] = 1.0,
    ) -> None:
        import torch  # pyright: ignore[reportMissingImports]
        from rsl_rl.runners import OnPolicyRunner  # pyright: ignore[reportMissingImports]

        from anysim_learning.rsl_env import RslVecEnv

        torch.manual_seed(lesson.seed)
        # Its critic moves by 0.2 in an update at most, whatever the rewards add up to.
        self._scale = ReturnScale(lesson.env.num_envs, gamma)
        self._lesson, self._view = lesson, RslVecEnv(lesson.env, lesson.seed, self._scale, reach)
        self._reach = reach
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
            "actor": network | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": noise / reach}},
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
        noise = float(self._runner.alg.get_policy().output_std.mean().item()) * self._reach
        return {"noise": noise, **self._view.batch.averages()}

    def state(self) -> dict[str, Any]:
        """What rsl_rl saves, the scale of rewards, the envs, the generator, and how far it is."""
        import torch  # pyright: ignore[reportMissingImports]

        alg = self._runner.alg
        learnt = {"saved": alg.save(), "rate": alg.learning_rate, "scale": self._scale.state()}
        return {**learnt, "envs": self._view.batch.state(), "draws": torch.get_rng_state(), "steps": self.steps}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there, as if it had not been put away."""
        import torch  # pyright: ignore[reportMissingImports]

        from anysim_learning.tensors import tensors

        self._runner.alg.load(tensors(state["saved"]), None, True)
        self._runner.alg.learning_rate = float(state["rate"])
        self._scale.restore(state["scale"])
        self.steps = int(state["steps"])
        self._view.restore(state["envs"])
        torch.set_rng_state(tensors(state["draws"]))

    def adopt(self, state: Mapping[str, Any]) -> None:
        """Begin with the networks of another training, whose observations are the first of these.

        What is observed beyond them has no weight yet. Noise, rate and steps are those of a beginning.

        Raises:
            TaskError: the networks are of another size.
        """
        import torch  # pyright: ignore[reportMissingImports]

        from anysim_learning.adopt import widened
        from anysim_learning.tensors import tensors

        alg = self._runner.alg
        made, saved = alg.save(), tensors(state["saved"])
        for key in ("actor_state_dict", "critic_state_dict"):
            made[key] = widened(saved[key], made[key])
            made[key]["obs_normalizer.count"] = torch.tensor(_ADOPTED * self._stretch)
        alg.load(made, {"actor": True, "critic": True}, True)
        self._scale.adopt(state["scale"])

    def network(self) -> "torch.nn.Module":
        """The mean action, in the units of the env."""
        from anysim_learning.rsl_env import Actor

        return Actor(self._runner.alg.get_policy(), self._lesson.env, self._reach)
