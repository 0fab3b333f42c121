"""Networks of cloning: a perceptron and a transformer of action chunks, and samples as tensors.

The chunks follow Zhao et al. 2023 (ACT) without its latent variable.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]

from anysim_learning.images import Reduce, reduction
from anysim_learning.learner import Lesson
from anysim_learning.tensors import InUnits

_CLIP = 5.0


class Rows:
    """Samples as tensors; actions are in half ranges of the env's, images are kept once for all samples."""

    def __init__(self, arrays: Any, frames: Mapping[str, Any], lesson: Lesson) -> None:
        obs, action, mask = arrays
        self.obs = torch.as_tensor(np.concatenate([obs[group] for group in lesson.groups], axis=1))
        self.action = InUnits(lesson.env).inverse(torch.as_tensor(action))
        self.mask = torch.as_tensor(mask)
        self._frames = [tuple(torch.as_tensor(part) for part in frames[name]) for name in lesson.images]

    def images(self, rows: Any) -> list[torch.Tensor]:
        """Those of some samples (n, H, W, 3) uint8, of each camera."""
        return [frames[shown[rows]] for frames, shown in self._frames]


def error(given: torch.Tensor, wanted: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Mean absolute error of chunks (n, K, A) where there were actions."""
    return ((given - wanted).abs().mean(dim=2) * mask).sum() / mask.sum()


class Policy(nn.Module):
    """Normalisation, a body, and the range of the actions."""

    def __init__(self, body: nn.Module, mean: Any, deviation: Any, lesson: Lesson, carried_out: int) -> None:
        super().__init__()
        self.body, self._kept, self.in_units = body, carried_out, InUnits(lesson.env)
        self._groups = len(lesson.groups)
        shapes = [lesson.env.image_shapes[name] for name in lesson.images]
        self.reduce = nn.ModuleList([Reduce(reduction(shape[0], shape[1])) for shape in shapes])
        self.register_buffer("mean", mean)
        self.register_buffer("deviation", deviation)

    def normal(self, obs: Any) -> Any:
        """Observations in deviations from their mean."""
        return torch.clamp((obs - self.mean) / self.deviation, -_CLIP, _CLIP)

    def forward(self, *seen: Any) -> Any:
        obs = self.normal(torch.cat(seen[: self._groups], dim=1))
        images = [reduce(image) for reduce, image in zip(self.reduce, seen[self._groups :], strict=True)]
        return self.in_units(self.body(obs, *images)[:, : self._kept])


class Mlp(nn.Module):
    """A perceptron that gives a chunk (n, K, A)."""

    def __init__(self, size: int, actions: int, chunk: int, width: int, layers: int) -> None:
        super().__init__()
        parts: list[nn.Module] = []
        for n in range(layers):
            parts += [nn.Linear(size if n == 0 else width, width), nn.GELU()]
        self.body, self._shape = nn.Sequential(*parts, nn.Linear(width, chunk * actions)), (chunk, actions)

    def forward(self, obs: Any) -> Any:
        return self.body(obs).unflatten(1, self._shape)


class Transformer(nn.Module):
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
