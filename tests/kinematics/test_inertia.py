"""Composing, repairing and computing inertias, against point masses and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from anysim.errors import EngineError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Inertial, Mesh, MeshShape, Plane, Shape, Sphere
from anysim.testing.sketch import inertial


def cloud(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Masses (n,) and places (n, 3)."""
    return rng.uniform(0.1, 2.0, count), rng.normal(size=(count, 3))


def of_points(mass: np.ndarray, place: np.ndarray) -> Inertial:
    """By definition: sum m (r.r 1 - r r^T) about the centre."""
    com = (mass[:, None] * place).sum(axis=0) / mass.sum()
    r = place - com
    tensor = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(mass, r, strict=True))
    return inertia.make(mass.sum(), com, np.asarray(tensor))


def random_pose(rng: np.random.Generator) -> np.ndarray:
    q = rng.normal(size=4)
    return np.concatenate([rng.normal(size=3), q / np.linalg.norm(q)])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_composition_equals_the_union_of_the_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    masses, places, parts = [], [], []
    for count in (1, 3, 7):
        mass, place = cloud(rng, count)
        pose = random_pose(rng)
        parts.append(inertia.moved(of_points(mass, place), pose))
        masses.append(mass)
        places.append(np.array([pose[:3] + P.rotate(pose[3:], p) for p in place]))
    whole = of_points(np.concatenate(masses), np.concatenate(places))
    found = inertia.composed(parts)
    assert found.mass == pytest.approx(whole.mass, rel=1e-12)
    np.testing.assert_allclose(found.com, whole.com, atol=1e-11)
    np.testing.assert_allclose(inertia.tensor(found), inertia.tensor(whole), atol=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_possible_inertias_are_left_alone(seed: int) -> None:
    body = of_points(*cloud(np.random.default_rng(seed), 5))
    assert inertia.repaired(body) == (body, None)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=100)
def test_repaired_inertias_are_possible_and_nearest_in_second_moments(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(3, 3))
    raw = inertia.make(1.0, np.zeros(3), matrix + matrix.T + 2 * np.eye(3))
    fixed, text = inertia.repaired(raw)
    a, b, c = np.linalg.eigvalsh(inertia.tensor(fixed))
    assert a >= -1e-9
    assert a + b - c >= -1e-9
    assert fixed.mass == 1.0
    if text is None:
        assert fixed is raw


def test_a_broken_triangle_inequality_is_repaired_by_hand_computed_values() -> None:
    # principal moments 1, 1, 4: second moments are 2, 2, -1, clipped to 2, 2, 0, so the moments are 2, 2, 4
    fixed, text = inertia.repaired(Inertial(3.0, (0.1, 0.0, 0.0), (1.0, 1.0, 4.0, 0.0, 0.0, 0.0)))
    np.testing.assert_allclose(fixed.inertia, (2, 2, 4, 0, 0, 0), atol=1e-12)
    assert fixed.com == (0.1, 0.0, 0.0)
    assert text is not None
    assert "33 %" in text


def test_mass_without_inertia_is_a_ball() -> None:
    fixed, text = inertia.repaired(Inertial(2.0))
    assert fixed.inertia[0] == pytest.approx(0.4 * 2.0 * 0.01**2)
    assert text is not None


def test_inertia_without_mass_is_dropped() -> None:
    fixed, text = inertia.repaired(Inertial(0.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)))
    assert fixed == Inertial(0.0)
    assert text is not None


def test_a_rod_gets_a_little_thickness() -> None:
    rod = Inertial(1.0, inertia=(0.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    moments = np.linalg.eigvalsh(inertia.tensor(inertia.moving(rod)))
    assert 0 < moments[0] < 1e-4
    assert moments[0] + moments[1] > moments[2]


SHAPES = [Box((0.1, 0.2, 0.3)), Sphere(0.2), Cylinder(0.1, 0.3), Capsule(0.1, 0.25)]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_shapes_against_sampled_points(shape: Box) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.4, 0.4, size=(400_000, 3))
    x, y, z = points.T
    inside = {
        "Box": (abs(x) < 0.1) & (abs(y) < 0.2) & (abs(z) < 0.3),
        "Sphere": x * x + y * y + z * z < 0.04,
        "Cylinder": (x * x + y * y < 0.01) & (abs(z) < 0.3),
        "Capsule": x * x + y * y + np.maximum(0, abs(z) - 0.25) ** 2 < 0.01,
    }[type(shape).__name__]
    chosen = points[inside]
    assert inertia.volume(shape, {}) == pytest.approx(0.8**3 * inside.mean(), rel=0.03)
    found = inertia.of_shape(shape, 2.0, {})
    square = (chosen**2).mean(axis=0) * 2.0
    expected = square.sum() - square
    np.testing.assert_allclose(found.inertia[:3], expected, rtol=0.03)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_worlds_made_by_hand_have_the_inertia_of_their_solids(shape: Shape) -> None:
    """A capsule with its caps, too."""
    assert inertial(shape, 2.0) == inertia.of_shape(shape, 2.0, {})


@given(st.integers(0, 2**32 - 1), st.booleans())
@settings(max_examples=50)
def test_principal_axes_give_the_tensor_back(seed: int, descending: bool) -> None:
    tensor = np.array(of_points(*cloud(np.random.default_rng(seed), 5)).inertia)
    moments, frame = inertia.principal(tensor, descending=descending)
    assert np.array_equal(moments, np.sort(moments)[:: -1 if descending else 1])
    inertia.check_physical("b", moments)
    np.testing.assert_allclose(inertia.from_principal(moments, frame), tensor, atol=1e-12 * moments.max())
    axes = P.to_matrix(frame)
    assert all(axes[np.argmax(np.abs(axes[:, k])), k] > 0 for k in range(2))


def test_a_diagonal_tensor_keeps_its_axes() -> None:
    found = inertia.principal((3.0, 1.0, 2.0, 0.0, 0.0, 0.0), descending=True)
    assert found.moments.tolist() == [3.0, 1.0, 2.0]
    assert found.frame.tolist() == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.1), (0.0, 1.0, 1.0), (-1.0, 2.0, 2.0)])
def test_moments_of_no_body_are_refused(moments: tuple[float, ...]) -> None:
    with pytest.raises(EngineError, match="the inertia of body 'b' belongs to no rigid body"):
        inertia.check_physical("b", np.array(moments))


def test_a_mesh_box_equals_the_box() -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((0.2, 0.4, 0.6))
    box.apply_translation((0.1, 0.2, 0.3))
    mesh = Mesh("box", np.array(box.vertices), np.array(box.faces))
    found = inertia.of_shape(MeshShape("box"), 3.0, {"box": mesh})
    np.testing.assert_allclose(found.com, (0.1, 0.2, 0.3), atol=1e-12)
    np.testing.assert_allclose(found.inertia, inertia.of_shape(Box((0.1, 0.2, 0.3)), 3.0, {}).inertia, atol=1e-12)


def test_planes_have_no_mass() -> None:
    assert inertia.volume(Plane(), {}) == 0
    with pytest.raises(ValueError, match="Plane has no mass"):
        inertia.of_shape(Plane(), 1.0, {})
