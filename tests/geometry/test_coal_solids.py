"""Coal's shapes of meshes against distances that are known."""

from typing import Any

import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)
import numpy as np
import pytest

from anysim.conventions import Array
from anysim.geometry.coal_solids import coal_hull, coal_triangles

CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def test_a_hull_is_as_far_away_as_the_cube_whose_corners_it_was_made_of():
    rng = np.random.default_rng(0)
    inner = rng.uniform(-0.9, 0.9, (20, 3))
    hull = coal_hull(np.concatenate([inner, CORNERS, CORNERS]))
    assert hull.num_points == 8
    assert _to_ball(hull, np.array([3.0, 0.2, -0.4])) == pytest.approx(1.5, abs=1e-6)
    assert _to_ball(hull, np.array([3.0, 3.0, 3.0])) == pytest.approx(np.sqrt(12) - 0.5, abs=1e-6)


def test_too_few_points_are_an_error():
    with pytest.raises(ValueError, match="four points that are not in one plane, got 3"):
        coal_hull(CORNERS[:3])


def test_the_hull_closes_a_notch_that_triangles_leave_open():
    # a gutter along y, whose walls rise from the origin to height 1 on both sides
    vertices = np.array([[-1.0, -2, 1], [-1, 2, 1], [0, -2, 0], [0, 2, 0], [1, -2, 1], [1, 2, 1]])
    faces = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    point = np.array([0.0, 0.0, 0.9])
    assert _to_ball(coal_triangles(vertices, faces), point, 0.1) == pytest.approx(0.9 / np.sqrt(2) - 0.1, abs=1e-6)
    assert _to_ball(coal_hull(vertices), point, 0.1) < 0


def _to_ball(shape: Any, centre: Array, radius: float = 0.5) -> float:
    here, there = coal.Transform3s(np.eye(3), np.zeros(3)), coal.Transform3s(np.eye(3), centre)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(shape, here, coal.Sphere(radius), there, request, result))
