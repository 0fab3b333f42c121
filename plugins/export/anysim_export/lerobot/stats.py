"""Statistics as LeRobot defines them: of each episode, and of a data set as the weighted mean of those of its episodes.

Quantiles are those of a histogram of 5,000 bins, interpolated, as LeRobot's. Everything is computed in float64; LeRobot
0.4 does so in the type of the data, and squares 8-bit pixels in 8 bits, so that its deviations of images are no
deviations.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from anysim.conventions import Array

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
BINS = 5000
PADDING = 1e-10

Stats = dict[str, Array]
"""min, max, mean, std and quantiles, each (D,), and count (1,); of images each (3, 1, 1), from 0 to 1."""


def sampled(frames: int) -> Array:
    """Which of an episode's frames its images' statistics are of: at least 100, and fewer of long episodes."""
    number = max(min(100, frames), min(int(frames**0.75), 10_000))
    return np.unique(np.round(np.linspace(0, frames - 1, number)).astype(int))


def thinned(image: Array) -> Array:
    """Of an image (H, W, 3) of 300 pixels or more every so many pixels, about 150 of them."""
    height, width = image.shape[:2]
    if max(height, width) < 300:
        return image
    step = int(max(width, height) / 150)
    return image[::step, ::step]


def stats_of(rows: Array) -> Stats:
    """The statistics of rows (n, D)."""
    values = rows.astype(np.float64)
    found = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)]),
    }
    if len(values) < 2:
        return found | {name: found["mean"].copy() for name in QUANTILES}
    columns = [_quantiles(*_histogram(column), len(values)) for column in values.T]
    return found | dict(zip(QUANTILES, np.array(columns).reshape(-1, len(QUANTILES)).T, strict=True))


class ImageStats:
    """Statistics of the pixels of images (H, W, 3) uint8, given one at a time: the counts of 256 values say it all."""

    def __init__(self) -> None:
        self._counts, self._images = np.zeros((3, 256), np.int64), 0

    def add(self, image: Array) -> None:
        """Count an image."""
        for channel in range(3):
            self._counts[channel] += np.bincount(image[..., channel].ravel(), minlength=256)
        self._images += 1

    def stats(self) -> Stats:
        """Those of all images so far."""
        values = np.arange(256.0)
        columns: dict[str, list[float]] = {name: [] for name in ("min", "max", "mean", "std", *QUANTILES)}
        for counts in self._counts:
            there, total = np.flatnonzero(counts), int(counts.sum())
            mean = float((counts * values).sum() / total)
            deviation = np.sqrt((counts * (values - mean) ** 2).sum() / total)
            low, high = float(there[0]), float(there[-1])
            quantiles = _quantiles(*_histogram(values[there], counts[there]), total)
            row = (low, high, mean, float(deviation), *quantiles)
            for name, value in zip(columns, row, strict=True):
                columns[name].append(value)
        scaled = {name: np.array(column).reshape(3, 1, 1) / 255.0 for name, column in columns.items()}
        return scaled | {"count": np.array([self._images])}


def together(parts: Sequence[Mapping[str, Array]]) -> Stats:
    """The statistics of several episodes: of quantiles the mean, weighted by the counts."""
    counts = np.stack([part["count"] for part in parts]).astype(np.float64)
    total = counts.sum(axis=0)
    weights = counts.reshape(-1, *[1] * parts[0]["mean"].ndim)
    means = np.stack([part["mean"] for part in parts])
    mean = (means * weights).sum(axis=0) / total
    spread = np.stack([part["std"] ** 2 for part in parts]) + (means - mean) ** 2
    found = {
        "min": np.stack([part["min"] for part in parts]).min(axis=0),
        "max": np.stack([part["max"] for part in parts]).max(axis=0),
        "mean": mean,
        "std": np.sqrt((spread * weights).sum(axis=0) / total),
        "count": total.astype(np.int64),
    }
    quantiles = {name: (np.stack([part[name] for part in parts]) * weights).sum(axis=0) / total for name in QUANTILES}
    return found | quantiles


def _histogram(values: Array, weights: Array | None = None) -> tuple[Array, Array]:
    """Counts (BINS,) and edges (BINS + 1,)."""
    edges = np.linspace(values.min() - PADDING, values.max() + PADDING, BINS + 1)
    return np.histogram(values, bins=edges, weights=weights)[0], edges


def _quantiles(counts: Array, edges: Array, total: int) -> list[float]:
    summed = np.cumsum(counts)
    found: list[float] = []
    for share in QUANTILES.values():
        target = share * total
        i = int(np.searchsorted(summed, target))
        if i == 0 or i >= len(summed):
            found.append(float(edges[0] if i == 0 else edges[-1]))
            continue
        inside = (target - summed[i - 1]) / (summed[i] - summed[i - 1])
        found.append(float(edges[i] + inside * (edges[i + 1] - edges[i])))
    return found
