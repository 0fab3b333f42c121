"""A learner: random changes of a linear policy, of which those stay that earn more."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim_learning.batch import Batch
from anysim_learning.learner import Lesson

if TYPE_CHECKING:
    import torch  # pyright: ignore[reportMissingImports]


class Search:
    """Each stretch tries one change, in episodes of its own, in all envs at once."""

    chunk = 1
    needs = ("torch", "tensorboard", "onnx")

    def __init__(
        self,
        lesson: Lesson,
        *,
        deviation: Annotated[float, Field(gt=0, description="of changes, in half ranges of actions")] = 0.05,
        n_steps: Annotated[int, Field(ge=1, description="control steps of a stretch in each env")] = 50,
    ) -> None:
        self._batch, self._seed = Batch(lesson.env, lesson.groups), lesson.seed
        self._deviation, self._n_steps = deviation, n_steps
        self._weights = np.zeros((lesson.env.action_dim, sum(self._batch.sizes.values())))
        self._best, self.steps = -np.inf, 0

    def advance(self) -> Mapping[str, float]:
        """One change; it stays if the reward of the stretch is higher than ever before."""
        draw = np.random.default_rng([self._seed, self.steps])
        changed = self._weights + draw.normal(scale=self._deviation, size=self._weights.shape)
        obs, earned = self._batch.reset(self._seed + self.steps), 0.0
        for _ in range(self._n_steps):
            moment = self._batch.step(np.tanh(np.concatenate([*obs.values()], axis=1) @ changed.T))
            obs, earned = moment.obs, earned + float(moment.reward.mean())
        if earned > self._best:
            self._weights, self._best = changed, earned
        self.steps += self._n_steps * self._batch.env.num_envs
        return {"earned": earned, **self._batch.averages()}

    def state(self) -> dict[str, Any]:
        """The weights, what they earned, and how far it is: what is drawn next follows from that."""
        return {"weights": self._weights, "best": self._best, "steps": self.steps}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there."""
        self._weights, self._best, self.steps = state["weights"], float(state["best"]), int(state["steps"])

    def network(self) -> "torch.nn.Module":
        """The policy in torch, in the units of the env."""
        import torch  # pyright: ignore[reportMissingImports]

        from anysim_learning.tensors import InUnits

        class Linear(torch.nn.Module):
            def __init__(self, weights: Array, env: Any) -> None:
                super().__init__()
                self.register_buffer("weights", torch.as_tensor(weights, dtype=torch.float32))
                self.in_units = InUnits(env)

            def forward(self, *groups: Any) -> Any:
                return self.in_units(torch.tanh(torch.cat(groups, dim=1) @ self.weights.T))

        return Linear(self._weights, self._batch.env)
