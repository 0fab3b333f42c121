"""Trees of arrays, as checkpoints hold them, as trees of torch's tensors."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]


def tensors(tree: Any) -> Any:
    """The same tree with a tensor in the place of each array."""
    if isinstance(tree, Mapping):
        return {key: tensors(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [tensors(value) for value in tree]
    return torch.as_tensor(np.array(tree)) if isinstance(tree, np.ndarray) else tree
