"""Poses over arrays: a row's result is the same bits whatever the batch around it, and the algebra holds."""

from collections.abc import Callable

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.math import pose as P

ROWS = 400
"""More than what is summed in one call."""


def poses(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(size=(ROWS, 3)), P.normalize(rng.normal(size=(ROWS, 4)))], axis=1)


A, B = poses(1), poses(2)
FUNCTIONS: dict[str, Callable[[Array, Array], Array]] = {
    "compose": P.compose,
    "multiply": lambda a, b: P.multiply(a[..., 3:], b[..., 3:]),
    "rotate": lambda a, b: P.rotate(a[..., 3:], b[..., :3]),
    "rotate_inverse": lambda a, b: P.rotate_inverse(a[..., 3:], b[..., :3]),
    "cross": lambda a, b: P.cross(a[..., :3], b[..., :3]),
    "dot": P.dot,
    "norm": lambda a, b: P.norm(a),
    "unsigned": lambda a, b: P.unsigned(a),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("rows", [1, 3, 16, 73, ROWS])
def test_a_row_is_the_same_bits_in_any_batch(name: str, rows: int) -> None:
    whole = FUNCTIONS[name](A, B)
    for start in range(0, ROWS, rows):
        part = FUNCTIONS[name](A[start : start + rows], B[start : start + rows])
        assert part.tobytes() == np.ascontiguousarray(whole[start : start + rows]).tobytes()
    assert FUNCTIONS[name](A[5], B[5]).tobytes() == np.ascontiguousarray(whole[5]).tobytes()


def test_one_pose_is_composed_with_many_as_if_it_were_written_out() -> None:
    spread = P.compose(A, np.broadcast_to(B[0], A.shape))
    for one in (B[0], B[:1]):
        assert P.compose(A, one).tobytes() == spread.tobytes()
        assert P.compose(A[:4], one).tobytes() == spread[:4].tobytes()


@pytest.mark.parametrize("rows", [1, 16, 1024])
def test_a_fixed_pose_is_seen_from_frames_as_composition_has_it(rows: int) -> None:
    frames = np.resize(poses(1), (rows, 7))
    fixed = poses(2)[0]
    assert P.Offset(fixed).seen_from(frames).tobytes() == P.compose(frames, fixed[None]).tobytes()


def test_sums_are_in_index_order() -> None:
    """0.1 + 0.2 + 0.3 is another number than 0.1 + (0.2 + 0.3)."""
    row = np.array([[0.1, 0.2, 0.3]])
    for rows in (1, ROWS):
        one = np.ones((rows, 3))
        assert (P.dot(np.repeat(row, rows, axis=0), one) == (0.1 + 0.2) + 0.3).all()


def test_composition_is_that_of_matrices() -> None:
    composed = P.compose(A, B)
    turn = P.to_matrix(A[:, 3:])
    np.testing.assert_allclose(composed[:, :3], A[:, :3] + np.einsum("nij,nj->ni", turn, B[:, :3]), atol=1e-12)
    np.testing.assert_allclose(P.to_matrix(composed[:, 3:]), turn @ P.to_matrix(B[:, 3:]), atol=1e-12)
    np.testing.assert_allclose(P.compose(A, P.inverse(A))[:, :3], 0.0, atol=1e-12)


def test_unsigned_poses_are_the_same_rotations_and_copies() -> None:
    before = A.copy()
    same = P.unsigned(A)
    assert (same[:, 6] >= 0).all()
    assert (A[:, 6] < 0).any()
    np.testing.assert_allclose(P.to_matrix(same[:, 3:]), P.to_matrix(A[:, 3:]), atol=1e-15)
    same[:] = 0.0
    assert np.array_equal(A, before)
