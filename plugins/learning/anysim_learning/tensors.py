"""Arrays as torch's tensors: trees of them, as checkpoints hold them, and the range of an env's actions."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from anysim.task.env import TaskEnv
from anysim_learning.batch import action_range


def tensors(tree: Any) -> Any:
    """The same tree with a tensor in the place of each array."""
    if isinstance(tree, Mapping):
        return {key: tensors(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [tensors(value) for value in tree]
    return torch.as_tensor(np.array(tree)) if isinstance(tree, np.ndarray) else tree


class InUnits(torch.nn.Module):
    """From actions in [-1, 1] to those in the units of the env; what is beyond is cut off."""

    def __init__(self, env: TaskEnv) -> None:
        super().__init__()
        for name, value in zip(("middle", "span"), action_range(env), strict=True):
            self.register_buffer(name, torch.as_tensor(value, dtype=torch.float32))

    def forward(self, action: Any) -> Any:
        return self.middle + self.span * torch.clamp(action, -1.0, 1.0)

    def inverse(self, action: Any) -> Any:
        """Actions of the env in half ranges; one without a range is 0."""
        return (action - self.middle) / torch.clamp(self.span, min=1e-6)
