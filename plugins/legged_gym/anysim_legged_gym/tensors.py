"""A view of a simulator for code that has tensors of torch: what it reads are tensors, what it takes may be."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError
from anysim_legged_gym.simulator import LeggedSimulator


class TensorView:
    """The attributes of a simulator, arrays as tensors of the CPU: `TensorView(simulator).base_lin_vel`.

    Numbers are single precision, as policies have them, and tensors are copies: what is done to them changes nothing
    else. Methods take tensors of the CPU as they take arrays; `tensor` turns other arrays into tensors.

    Raises:
        PluginError: torch is not installed.
    """

    def __init__(self, simulator: LeggedSimulator) -> None:
        try:
            import torch  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise PluginError(f"tensors need torch, which does not load here ({error}); pip install torch") from error
        self.simulator, self._from_numpy = simulator, torch.from_numpy

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.simulator, name)
        return self.tensor(value) if isinstance(value, np.ndarray) else value

    def tensor(self, array: Array) -> Any:
        """A tensor with a copy of an array; float64 becomes float32."""
        return self._from_numpy(np.array(array, dtype=np.float32 if array.dtype == np.float64 else array.dtype))
