"""Trees over triangles: complete, and made once for equal content."""

from pathlib import Path

import numpy as np
import pytest

from anysim.cache import CACHE_ENV
from anysim.errors import AnysimError
from anysim.model.ground import FieldGround
from anysim.model.world import HeightField
from anysim_sensors import trees
from anysim_sensors.kernels.bounds import build_tree
from anysim_sensors.trees import field_triangles, mesh_tree


def soup(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    vertices = rng.uniform(-1, 1, (3 * count, 3))
    return vertices, np.arange(3 * count).reshape(-1, 3)


def test_a_tree_is_made_once_for_equal_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_ENV, str(tmp_path))
    vertices, faces = soup(50)
    first = mesh_tree(vertices, faces)
    monkeypatch.setattr(trees, "_make", lambda *_: pytest.fail("it was made again"))
    again = mesh_tree(vertices.copy(), faces.astype(np.int32))
    assert first.keys() == again.keys()
    assert all((first[name] == again[name]).all() for name in first)
    assert len(list((tmp_path / "trees").iterdir())) == 1
    with pytest.raises(pytest.fail.Exception, match="made again"):
        mesh_tree(vertices * 1.5, faces)  # another scale is another mesh


@pytest.mark.parametrize("count", [1, 4, 5, 3000])
def test_each_triangle_is_in_one_leaf_and_in_the_boxes_above_it(count: int) -> None:
    vertices, faces = soup(count)
    tree = trees._make(vertices, faces)
    box, link, corner = tree["box"], tree["link"], tree["corner"]
    a = corner[:, :3]
    whole = np.stack([a, a + corner[:, 3:6], a + corner[:, 6:]], axis=1)
    held: list[int] = []

    def below(node: int) -> tuple[int, ...]:
        number, to = link[node]
        inside = tuple(range(to, to + number)) if number else below(node + 1) + below(to)
        points = whole[list(inside)].reshape(-1, 3)
        assert (points >= box[node, :3]).all()
        assert (points <= box[node, 3:]).all()
        if number:
            assert number <= trees.LEAF
            held.extend(inside)
        return inside

    below(0)
    assert sorted(held) == list(range(count))
    key = np.sort(whole.reshape(count, 9), axis=1)
    given = np.sort(vertices[faces].reshape(count, 9), axis=1)
    assert np.allclose(key[np.lexsort(key.T)], given[np.lexsort(given.T)], atol=1e-12)


def test_triangles_with_a_corner_twice_are_left_out() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    tree = trees._make(vertices, np.array([[0, 1, 3], [0, 1, 2], [2, 2, 2]]))
    assert len(tree["corner"]) == 1
    with pytest.raises(AnysimError, match="without any triangle"):
        trees._make(vertices, np.array([[0, 1, 3]]))


def test_items_in_one_place_are_halved() -> None:
    low = np.zeros((1000, 3))
    order, box, link = np.arange(1000, dtype=np.int32), np.empty((2000, 6)), np.empty((2000, 2), dtype=np.int32)
    nodes = build_tree(low, low, 1, order, 1000, box, link)
    assert nodes == 1999
    assert sorted(order) == list(range(1000))


def test_the_triangles_of_a_field_are_its_ground() -> None:
    field = HeightField("hills", np.random.default_rng(1).uniform(-1, 1, (4, 6)), (5.0, 3.0))
    vertices, faces = field_triangles(field)
    middle = vertices[faces].mean(axis=1)
    assert len(faces) == 2 * 3 * 5
    assert np.abs(FieldGround(field).heights_at(middle[:, :2]) - middle[:, 2]).max() < 1e-12
    normal = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    assert (normal[:, 2] > 0).all()
