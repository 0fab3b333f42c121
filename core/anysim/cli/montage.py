"""Montages: many images as one."""

import numpy as np

from anysim.conventions import Array


def montage(images: Array, columns: int | None = None, gap: int = 4) -> Array:
    """One image (H', W', 3) uint8 of many (N, H, W, 3), row by row, about as wide as high, white between them."""
    count, height, width, _ = images.shape
    across = columns or int(np.ceil(np.sqrt(count)))
    down = -(-count // across)
    sheet = np.full((down * (height + gap) - gap, across * (width + gap) - gap, 3), 255, dtype=np.uint8)
    for number, image in enumerate(images):
        top, left = (number // across) * (height + gap), (number % across) * (width + gap)
        sheet[top : top + height, left : left + width] = image
    return sheet
