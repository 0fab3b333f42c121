"""The learner `clone`: behaviour cloning of recorded runs, by a perceptron or by a transformer of action chunks.

The chunks follow Zhao et al. 2023 (ACT) without its latent variable.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from pydantic import Field
from torch import nn  # pyright: ignore[reportMissingImports]
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn  # pyright: ignore[reportMissingImports]

from anysim.errors import TaskError
from anysim_learning.demonstrations import Demonstrations
from anysim_learning.learner import Lesson
from anysim_learning.tensors import tensors
from anysim_schemas.base import Positive

STRETCH = 100
"""Steps of descent between two numbers of the curve."""

_CLIP = 5.0


class Clone:
    """Regression from observations to the actions that followed, with the least mean absolute error."""

    default_steps = 20_000

    def __init__(
        self,
        lesson: Lesson,
        *,
        model: Annotated[Literal["mlp", "transformer"], Field(description="the network")] = "mlp",
        chunk: Annotated[int, Field(ge=1, description="actions that are given at once")] = 8,
        carried_out: Annotated[int, Field(ge=0, description="of them before it is asked again; 0: all")] = 0,
        width: Annotated[int, Field(ge=8)] = 256,
        layers: Annotated[int, Field(ge=1)] = 3,
        batch_size: Annotated[int, Field(ge=1)] = 256,
        learning_rate: Positive = 1e-3,
        weight_decay: Annotated[float, Field(ge=0)] = 1e-4,
        noise: Annotated[float, Field(ge=0, description="added to observations, in their deviations")] = 0.02,
        average: Annotated[
            float, Field(ge=0, lt=1, description="how much of the mean weights each step keeps")
        ] = 0.998,
        held_out: Annotated[float, Field(gt=0, lt=1, description="share of trajectories for validation")] = 0.1,
    ) -> None:
        if not lesson.data:
            raise TaskError("the learner 'clone' learns from recorded runs; name them with --data RUN")
        data = Demonstrations(lesson.data, lesson.groups, chunk)
        if data.trajectories[0].action.shape[1] != lesson.env.action_dim:
            raise TaskError(
                f"the runs command {data.trajectories[0].action.shape[1]} actions, '{lesson.env.name}' has "
                f"{lesson.env.action_dim}; record them with this task and robot"
            )
        order = np.random.default_rng(lesson.seed).permutation(len(data.trajectories))
        apart = max(1, round(held_out * len(order))) if len(order) > 1 else 0
        self._train = _Rows(data.arrays(order[apart:].tolist()), lesson)
        self._held_out = _Rows(data.arrays(order[:apart].tolist()), lesson) if apart else None
        torch.manual_seed(lesson.seed)
        obs = self._train.obs
        body = (_Mlp if model == "mlp" else _Transformer)(obs.shape[1], lesson.env.action_dim, chunk, width, layers)
        self._body, self._mean = body, AveragedModel(body, multi_avg_fn=get_ema_multi_avg_fn(average))
        self._network = _Policy(
            self._mean.module, obs.mean(0), obs.std(0).clamp(min=1e-3), lesson, carried_out or chunk
        )
        self.chunk = carried_out or chunk
        self._optimizer = torch.optim.AdamW(body.parameters(), lr=learning_rate, weight_decay=weight_decay)
        self._rate, self._batch_size, self._noise = learning_rate, batch_size, noise
        self._draws = torch.Generator().manual_seed(lesson.seed)
        self.steps = 0

    def advance(self) -> Mapping[str, float]:
        """Some steps of descent; the rate falls with the square root of how far it is."""
        total = 0.0
        for _ in range(STRETCH):
            for group in self._optimizer.param_groups:
                group["lr"] = self._rate / (1 + self.steps / 2_000) ** 0.5
            rows = torch.randint(len(self._train.obs), (self._batch_size,), generator=self._draws)
            obs = self._network.normal(self._train.obs[rows])
            obs = obs + self._noise * torch.randn(obs.shape, generator=self._draws)
            loss = _error(self._body(obs), self._train.action[rows], self._train.mask[rows])
            self._optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(self._body.parameters(), 1.0)
            self._optimizer.step()
            self._mean.update_parameters(self._body)
            total += float(loss.item())
            self.steps += 1
        numbers = {"loss": total / STRETCH}
        if self._held_out is not None:
            with torch.inference_mode():
                given = self._network.body(self._network.normal(self._held_out.obs))
            numbers["held_out_loss"] = float(_error(given, self._held_out.action, self._held_out.mask).item())
        return numbers

    def state(self) -> dict[str, Any]:
        """Weights and their mean, the optimiser's moments, the generator, and how far it is."""
        return {
            "body": dict(self._body.state_dict()),
            "mean": dict(self._mean.state_dict()),
            "optimizer": self._optimizer.state_dict(),
            "draws": self._draws.get_state(),
            "steps": self.steps,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there, as if it had not been put away."""
        self._body.load_state_dict(tensors(state["body"]))
        self._mean.load_state_dict(tensors(state["mean"]))
        self._optimizer.load_state_dict(tensors(state["optimizer"]))
        self._draws.set_state(tensors(state["draws"]))
        self.steps = int(state["steps"])

    def network(self) -> nn.Module:
        """From observations to chunks (n, K, A) in the units of the env, by the mean of the weights of late."""
        return self._network


class _Rows:
    """Samples as tensors; actions are in half ranges of the env's."""

    def __init__(self, arrays: Any, lesson: Lesson) -> None:
        obs, action, mask = arrays
        middle, half = _range(lesson)
        self.obs = torch.as_tensor(np.concatenate([obs[group] for group in lesson.groups], axis=1))
        self.action = (torch.as_tensor(action) - middle) / half
        self.mask = torch.as_tensor(mask)


def _range(lesson: Lesson) -> tuple[torch.Tensor, torch.Tensor]:
    low, high = (np.asarray(bound, dtype=np.float32) for bound in lesson.env.action_bounds)
    return torch.as_tensor((low + high) / 2), torch.as_tensor(np.maximum((high - low) / 2, 1e-6))


def _error(given: torch.Tensor, wanted: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Mean absolute error of chunks (n, K, A) where there were actions."""
    return ((given - wanted).abs().mean(dim=2) * mask).sum() / mask.sum()


class _Policy(nn.Module):
    """Normalisation, a body, and the range of the actions."""

    def __init__(self, body: nn.Module, mean: Any, deviation: Any, lesson: Lesson, carried_out: int) -> None:
        super().__init__()
        self.body, self._kept = body, carried_out
        middle, half = _range(lesson)
        for name, value in (("mean", mean), ("deviation", deviation), ("middle", middle), ("span", half)):
            self.register_buffer(name, value)

    def normal(self, obs: Any) -> Any:
        """Observations in deviations from their mean."""
        return torch.clamp((obs - self.mean) / self.deviation, -_CLIP, _CLIP)

    def forward(self, *groups: Any) -> Any:
        chunk = self.body(self.normal(torch.cat(groups, dim=1)))[:, : self._kept]
        return self.middle + self.span * torch.clamp(chunk, -1.0, 1.0)


class _Mlp(nn.Module):
    """A perceptron that gives a chunk (n, K, A)."""

    def __init__(self, size: int, actions: int, chunk: int, width: int, layers: int) -> None:
        super().__init__()
        parts: list[nn.Module] = []
        for n in range(layers):
            parts += [nn.Linear(size if n == 0 else width, width), nn.GELU()]
        self.body, self._shape = nn.Sequential(*parts, nn.Linear(width, chunk * actions)), (chunk, actions)

    def forward(self, obs: Any) -> Any:
        return self.body(obs).unflatten(1, self._shape)


class _Transformer(nn.Module):
    """The observation as a token, and a learnt question for each action of the chunk; all attend to all."""

    HEADS = 4

    def __init__(self, size: int, actions: int, chunk: int, width: int, layers: int) -> None:
        super().__init__()
        self.width = width - width % self.HEADS
        self.read, self.tell = nn.Linear(size, self.width), nn.Linear(self.width, actions)
        self.questions = nn.Parameter(0.02 * torch.randn(chunk, self.width))
        self.blocks = nn.ModuleList([_Block(self.width, self.HEADS) for _ in range(layers)])
        self.last = nn.LayerNorm(self.width)

    def forward(self, obs: Any) -> Any:
        seen = self.read(obs)[:, None]
        tokens = torch.cat([seen, self.questions[None].expand(obs.shape[0], -1, -1) + seen], dim=1)
        for block in self.blocks:
            tokens = block(tokens)
        return self.tell(self.last(tokens[:, 1:]))


class _Block(nn.Module):
    """Attention and a perceptron, each after a normalisation (Xiong et al. 2020)."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.first, self.second = nn.LayerNorm(width), nn.LayerNorm(width)
        self.mix, self.out = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.think = nn.Sequential(nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width))

    def forward(self, tokens: Any) -> Any:
        parts = self.mix(self.first(tokens)).chunk(3, dim=2)
        query, key, value = (part.unflatten(2, (self.heads, -1)).transpose(1, 2) for part in parts)
        found = nn.functional.scaled_dot_product_attention(query, key, value)
        tokens = tokens + self.out(found.transpose(1, 2).flatten(2))
        return tokens + self.think(self.second(tokens))
