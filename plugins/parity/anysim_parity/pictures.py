"""Depth and segmentation as pictures for people."""

import numpy as np

from anysim.conventions import Array

RAMP = np.array([[252, 253, 191], [252, 137, 97], [183, 55, 121], [81, 18, 124], [0, 0, 4]], dtype=float)
"""Colours from near to far, in even steps; lightness falls evenly, so it reads in grey too."""

NOTHING = (200, 210, 220)
"""Where nothing is seen."""

GOLDEN = 0.618033988749895
"""Hues this far apart stay apart however many there are."""


def depth_picture(depth: Array, near: float, far: float) -> Array:
    """(H, W, 3) uint8 of depth (H, W) [m], coloured between two distances."""
    share = np.clip((depth - near) / max(far - near, 1e-9), 0.0, 1.0)
    share = np.where(np.isfinite(depth), share, 0.0)
    steps = np.linspace(0.0, 1.0, len(RAMP))
    picture = np.stack([np.interp(share, steps, RAMP[:, c]) for c in range(3)], axis=-1)
    return np.where(np.isfinite(depth)[..., None], picture, np.array(NOTHING)).round().astype(np.uint8)


def segmentation_picture(segmentation: Array) -> Array:
    """(H, W, 3) uint8 of entity ids (H, W); ground and background are grey."""
    count = int(segmentation.max(initial=0)) + 1
    palette = np.array([NOTHING, *(_hue(k * GOLDEN % 1.0) for k in range(1, count))], dtype=np.uint8)
    return palette[segmentation]


def _hue(hue: float) -> tuple[int, int, int]:
    """A strong colour: hue in [0, 1), saturation 0.65, value 0.9."""
    red, green, blue = (
        round(255 * 0.9 * (1 - 0.65 * (1 - min(max(abs((hue * 6 + shift) % 6 - 3) - 1, 0.0), 1.0))))
        for shift in (0.0, 4.0, 2.0)
    )
    return red, green, blue
