"""Rasters and what they cover."""

import numpy as np
import pytest

from anysim_skills.moving.raster import Coverage, Raster

IDS = np.arange(2)


def test_a_raster_covers_its_rectangle_and_stays_inside_of_it() -> None:
    raster, coverage = Raster((0.2, 0.1), 0.03), Coverage(2, (0.2, 0.1), 0.03)
    for along in np.arange(0.0, raster.length, 0.005):
        point = raster.point(np.full(1, along))
        assert (np.abs(point) <= [[0.085 + 1e-9, 0.035 + 1e-9]]).all()
        coverage.add(IDS[:1], point)
    assert coverage.share(IDS)[0] >= 0.95  # a round tool leaves out corners
    assert coverage.share(IDS)[1] == 0.0


def test_what_is_left_is_told_and_forgotten_by_env() -> None:
    coverage = Coverage(2, (0.1, 0.1), 0.1)
    coverage.add(IDS, np.array([[-0.05, -0.05], [0.05, 0.05]]))
    left = coverage.nearest_left(IDS, np.array([[-0.05, -0.05], [0.05, 0.05]]))
    assert left == pytest.approx(np.array([[-0.025, 0.025], [-0.025, 0.025]]))
    coverage.clear(IDS[:1])
    assert coverage.share(IDS).tolist() == [0.0, 0.25]


def test_a_tool_wider_than_the_rectangle_needs_one_row() -> None:
    assert Raster((0.02, 0.02), 0.05).length == 0.0
