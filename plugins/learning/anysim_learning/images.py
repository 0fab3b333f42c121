"""Images as cloning sees them: no larger than 64 pixels, and encoded as the places of what was found in them.

The encoder is that of Levine et al. 2016: convolutions, and the mean place of each feature under its softmax.
"""

from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array

MOST_PIXELS = 64
"""The longest side of an image that is encoded."""


def reduction(height: int, width: int) -> int:
    """How many pixels become one in each direction."""
    return -(-max(height, width) // MOST_PIXELS)


def reduced(images: Array, factor: int) -> Array:
    """Images (n, H, W, 3) uint8 as means of squares of `factor` pixels, without what is left at the right and below."""
    if factor == 1:
        return images
    n, height, width, channels = images.shape
    cut = images[:, : height - height % factor, : width - width % factor]
    squares = cut.reshape(n, height // factor, factor, width // factor, factor, channels)
    return np.rint(squares.mean(axis=(2, 4), dtype=np.float32)).astype(np.uint8)


def shifted(images: Any, most: int, draws: Any) -> Any:
    """Images (n, H, W, 3), each moved by up to `most` pixels in either direction; what comes in repeats the border."""
    if most == 0:
        return images
    n, height, width, _ = images.shape
    moves = torch.randint(-most, most + 1, (2, n, 1), generator=draws)
    rows = torch.clamp(torch.arange(height) + moves[0], 0, height - 1)
    columns = torch.clamp(torch.arange(width) + moves[1], 0, width - 1)
    return images[torch.arange(n)[:, None, None], rows[:, :, None], columns[:, None, :]]


class Reduce(nn.Module):
    """`reduced` within a network: (n, H, W, 3) uint8 to float32 of the same values."""

    def __init__(self, factor: int) -> None:
        super().__init__()
        self.factor = factor

    def forward(self, images: Any) -> Any:
        values = images.float()
        if self.factor == 1:
            return values
        squares = nn.functional.avg_pool2d(values.permute(0, 3, 1, 2), self.factor)
        return torch.round(squares).permute(0, 2, 3, 1)


class Eye(nn.Module):
    """The places (n, `size`) of features in images (n, H, W, 3) of 0 to 255: x and y of each, from -1 to 1."""

    FEATURES = 32

    def __init__(self, height: int, width: int) -> None:
        super().__init__()
        self.size = 2 * self.FEATURES
        self.grid = (-(-height // 4), -(-width // 4))
        for axis, cells in zip("yx", self.grid, strict=True):
            self.register_buffer(axis, torch.linspace(-1.0, 1.0, cells), persistent=False)
        self.look = nn.Sequential(
            nn.Conv2d(3, 16, 5, stride=2, padding=2),
            nn.GELU(),
            nn.Conv2d(16, 32, 3, stride=2, padding=1),
            nn.GELU(),
            nn.Conv2d(32, self.FEATURES, 3, padding=1),
        )

    def forward(self, images: Any) -> Any:
        found = self.look(images.float().permute(0, 3, 1, 2) / 127.5 - 1.0)
        share = torch.softmax(found.flatten(2), dim=2).unflatten(2, self.grid)
        return torch.cat([(share.sum(2) * self.x).sum(2), (share.sum(3) * self.y).sum(2)], dim=1)


class Seeing(nn.Module):
    """A body that is told what an eye for each image finds, beside the observations."""

    def __init__(self, body: nn.Module, eyes: list[Eye]) -> None:
        super().__init__()
        self.body, self.eyes = body, nn.ModuleList(eyes)

    def forward(self, obs: Any, *images: Any) -> Any:
        found = [eye(seen) for eye, seen in zip(self.eyes, images, strict=True)]
        return self.body(torch.cat([obs, *found], dim=1))
