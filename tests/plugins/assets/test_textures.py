"""Patterns of textures: the same from the same seed, in the colours that are asked for, and without seams."""

import numpy as np
import pytest

from anysim import registry
from anysim.compile.appearance import Pattern
from anysim.model.appearance import Rgb

NAMES = [name for name in registry.names("textures") if registry.distribution("textures", name) == "anysim-assets"]


def pixels_of(name: str, first: Rgb | None, second: Rgb | None, seed: int, resolution: int) -> np.ndarray:
    pattern: Pattern = registry.load("textures", name)
    return pattern.pixels(first, second, seed, resolution)


def test_the_patterns_that_are_said_to_come_with_it_are_there() -> None:
    hints = registry.INSTALL_HINTS.items()
    assert sorted(name for (kind, name), package in hints if kind == "textures" and package == "anysim-assets") == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_pattern_follows_from_its_seed_and_colours(name: str) -> None:
    pixels = pixels_of(name, None, None, 3, 64)
    assert pixels.shape == (64, 64, 3)
    assert np.array_equal(pixels, pixels_of(name, None, None, 3, 64))
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) >= 2, "one colour all over"
    blue = pixels_of(name, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3, 64)
    assert not blue[..., :2].any()
    assert blue[..., 2].max() > 180


@pytest.mark.parametrize("name", ["noise", "wood", "brick"])
def test_a_seed_changes_what_is_random(name: str) -> None:
    assert not np.array_equal(pixels_of(name, None, None, 0, 64), pixels_of(name, None, None, 1, 64))


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("gradient", "stripes", "checker", "brick")])
def test_a_pattern_goes_on_across_its_edges(name: str) -> None:
    """What is left and right of the seam differs no more than neighbours elsewhere do."""
    pixels = pixels_of(name, None, None, 5, 128).astype(int)
    steps = np.abs(np.diff(pixels, axis=1)).sum(axis=(0, 2))
    seam = np.abs(pixels[:, 0] - pixels[:, -1]).sum()
    assert seam <= 1.5 * steps.max()
