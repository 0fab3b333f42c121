"""Small matrices against numpy's, and the same bits whatever BLAS kernel numpy has."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, strategies as st

from anysim.math import matrix as M

_ENTRY = st.floats(-1e6, 1e6, allow_nan=False).filter(lambda x: x == 0 or abs(x) > 1e-12)


@given(st.lists(_ENTRY, min_size=6, max_size=6))
def test_eigenvalues_and_vectors_are_those_of_the_matrix(entries: list[float]) -> None:
    xx, yy, zz, xy, xz, yz = entries
    a = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    values, vectors = M.eigen(a)
    size = np.abs(a).max()
    assert (np.diff(values) >= 0).all()
    assert np.abs(vectors.T @ vectors - np.eye(3)).max() < 1e-13
    assert np.abs(vectors * values @ vectors.T - a).max() <= 1e-13 * size
    assert np.abs(values - np.linalg.eigvalsh(a)).max() <= 1e-13 * size


def test_small_eigenvalues_keep_their_digits() -> None:
    turn = M.product(
        *[np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1.0]]), np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])]
    )
    values, _ = M.eigen(M.product(turn, np.diag([1e-12, 1.0, 2.0]), turn.T))
    assert values == pytest.approx([1e-12, 1.0, 2.0], rel=1e-3)


def test_products_are_those_of_numpy() -> None:
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(5, 3, 4)), rng.normal(size=(4, 6)), rng.normal(size=(5, 6, 2))
    assert np.abs(M.product(a, b, c) - a @ b @ c).max() < 1e-13
    square = rng.normal(size=(7, 3, 3))
    assert np.abs(M.determinant(square) - np.linalg.det(square)).max() < 1e-13


def test_the_kernel_has_a_name() -> None:
    assert M.blas_kernel() not in ("", "unknown")


_DIGEST = """
import hashlib, numpy as np
from anysim.math import matrix as M
from anysim.api import make
from anysim.skills.runner import SkillPolicy
digest = hashlib.sha256()
with make("pick_cube", engine={engine!r}, num_envs=2, overrides=["record.cameras=[]"]) as env:
    env.reset(seed=3)
    policy = SkillPolicy(env)
    policy.begin(np.arange(2))
    for _ in range(40):
        env.step(policy.act(np.arange(2)))
        state = env.engine.get_state()
        for array in (state.joint_pos, state.joint_vel, state.body_pose, state.body_twist):
            digest.update(np.ascontiguousarray(array).tobytes())
print(M.blas_kernel(), digest.hexdigest(), sep="|")
"""
_KERNELS = ("Prescott", "Haswell", "SkylakeX")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_trajectories_are_the_same_bits_under_each_kernel(engine: str) -> None:
    found = [done for kernel in _KERNELS if (done := _under(kernel, engine)) is not None]
    kernels, digests = zip(*found, strict=True)
    if len(set(kernels)) == 1:
        pytest.skip(f"numpy's linear algebra here has one kernel only: {kernels[0]}")
    assert len(set(digests)) == 1


def _under(kernel: str, engine: str) -> tuple[str, str] | None:
    """The kernel and a digest; None where this processor lacks instructions that the kernel takes."""
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    command = [sys.executable, "-c", _DIGEST.format(engine=engine)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=240)
    if kernel != _KERNELS[0] and done.returncode == -signal.SIGILL:
        return None
    assert done.returncode == 0, done.stderr
    name, _, digest = done.stdout.strip().rpartition("|")
    return name, digest
