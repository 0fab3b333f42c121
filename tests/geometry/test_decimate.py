"""Decimation keeps its stated error, judged by points that are spread densely over the result."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from anysim.conventions import Array
from anysim.geometry.triangles import FAR, FEW, NEARLY_ALL, decimated, deviation

Surface = tuple[Array, Array]


def ball(radius: float = 0.1) -> Surface:
    """A sphere whose 20,480 triangles are within 0.05 % of the radius."""
    mesh = trimesh.creation.icosphere(5, radius)
    return mesh.vertices, mesh.faces


def grille() -> Surface:
    """A box with 100 thin rods beside it, which decimation likes to remove whole."""
    rods = [trimesh.creation.cylinder(0.0005, 0.02, sections=12) for _ in range(100)]
    for i, rod in enumerate(rods):
        rod.apply_translation([0.002 * (i % 20), 0.002 * (i // 20), 0.0])
    mesh = trimesh.util.concatenate([*rods, trimesh.creation.icosphere(5, 0.02)])
    return mesh.vertices, mesh.faces


def spread(vertices: Array, faces: Array, spacing: float) -> Array:
    """Points of all triangles, about `spacing` apart."""
    return trimesh.remesh.subdivide_to_size(vertices, faces, spacing, max_iter=30)[0]


@pytest.mark.parametrize("surface", [ball(), grille()], ids=["ball", "grille"])
def test_nearly_all_of_a_surface_stays_within_the_error_and_all_of_it_near(surface: Surface) -> None:
    error = 0.002
    vertices, faces = decimated(*surface, error)
    assert len(faces) < len(surface[1])
    spacing = error / 2
    off = KDTree(spread(vertices, faces, spacing)).query(surface[0][:: max(1, len(surface[0]) // 2000)])[0]
    assert np.quantile(off, NEARLY_ALL) <= error + spacing
    assert off.max() <= FAR * error + spacing


def test_a_small_error_takes_more_triangles_and_none_takes_all() -> None:
    counts = [len(decimated(*ball(), error)[1]) for error in (0.005, 0.0001, 0.0)]
    assert counts == sorted(counts)
    assert counts[0] <= FEW < counts[1]
    assert counts[2] == len(ball()[1])


def test_distances_are_exact_where_the_surface_is_known() -> None:
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)
    points = np.array([[0.3, 0.6, 0.2], [0.5, 0.5, 0.0], [2.0, 1.0, 0.0], [-1.0, -1.0, 1.0]])
    assert deviation(points, square) == pytest.approx([0.2, 0.0, 1.0, 3**0.5])


def test_results_repeat() -> None:
    for first, second in zip(decimated(*grille(), 0.001), decimated(*grille(), 0.001), strict=True):
        assert (first == second).all()
