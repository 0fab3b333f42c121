"""The kernels one by one: canonical chains, Jacobian, generator, linear solve."""

import numpy as np
import pytest

from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import JointType, World
from anysim.testing.arms import Link, panda_arm, serial_arm
from anysim_control.batch import kernels
from anysim_control.batch.frames import canonical_frames
from anysim_control.batch.starts import start_position, uniform

ODD = serial_arm(
    (
        Link((0.1, 0.2, 0.3), (0.3, -0.2, 0.1), axis=(0.0, 0.6, 0.8), anchor=(0.02, -0.03, 0.01)),
        Link((0.0, 0.1, 0.2), (1.0, 0.5, -0.4), axis=(0.0, 0.0, -1.0), type=JointType.PRISMATIC),
        Link((0.2, 0.0, 0.0), (0.0, 0.7, 0.0), axis=(1.0, 0.0, 0.0), anchor=(0.0, 0.1, 0.0)),
        Link((0.1, 0.1, 0.1), axis=(0.8, 0.0, -0.6), type=JointType.PRISMATIC),
        Link((0.0, -0.1, 0.1), (-0.4, 0.0, 0.9), axis=(0.0, -1.0, 0.0), anchor=(0.1, 0.2, 0.3)),
    ),
    ((0.05, -0.02, 0.1), (0.1, 0.2, 0.3)),
)
ROOT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class Workspace:
    """The arrays that the kernels write, for one chain and one target."""

    def __init__(self, world: World, target: np.ndarray, weight: tuple[float, float, float]) -> None:
        self.chain = Chain.from_world(world, world.robots[0].name, "arm", "tool")
        self.frames = canonical_frames(self.chain)
        self.weight = np.array(weight)
        self.rot, self.pos = np.empty((3, 3)), np.empty(3)
        kernels.target_in_root(target, ROOT.copy(), self.rot, self.pos, np.empty((3, 3)), np.empty((3, 3)))
        joints = len(self.chain)
        self.pose, self.axes, self.points = np.empty((3, 4)), np.empty((joints, 3)), np.empty((joints, 3))
        self.vector, self.error = np.empty(3), np.empty(6)

    def residual(self, q: np.ndarray) -> np.ndarray:
        kernels.forward(self.frames, self.chain.prismatic, q, self.pose, self.axes, self.points)
        kernels.residual(self.pose, self.rot, self.pos, self.weight, self.vector, self.error)
        return self.error.copy()

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        self.residual(q)
        out = np.empty((len(q), 6))
        kernels.jacobian(self.chain.prismatic, self.pose, self.axes, self.points, self.vector, self.weight, out)
        return out


@pytest.mark.parametrize("world", [panda_arm(), ODD], ids=["panda", "odd"])
def test_forward_agrees_with_the_chain(world: World) -> None:
    work = Workspace(world, ROOT.copy(), (1.0, 1.0, 1.0))
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, (50, len(work.chain))):
        work.residual(q)
        expected = work.chain.tool_pose(ROOT, q)
        np.testing.assert_allclose(work.pose[:, 3], expected[:3], atol=1e-13)
        np.testing.assert_allclose(work.pose[:, :3], P.to_matrix(expected[3:]), atol=1e-13)


@pytest.mark.parametrize("world", [panda_arm(), ODD], ids=["panda", "odd"])
@pytest.mark.parametrize("weight", [(1.0, 1.0, 1.0), (0.5, 0.2, 0.0)])
def test_the_jacobian_is_the_derivative_of_the_residual_far_from_the_target_too(
    world: World, weight: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(1)
    step = 1e-6
    for _ in range(20):
        target = np.concatenate([rng.uniform(-0.5, 0.5, 3), P.normalize(rng.normal(size=4))])
        work = Workspace(world, target, weight)
        q = rng.uniform(-1.5, 1.5, len(work.chain))
        work.residual(q)
        if np.linalg.norm(work.vector) > 3.0:
            continue  # the rotation vector jumps at pi
        exact = work.jacobian(q)
        for k in range(len(q)):
            nudge = np.zeros(len(q))
            nudge[k] = step
            slope = (work.residual(q - nudge) - work.residual(q + nudge)) / (2 * step)
            np.testing.assert_allclose(exact[k], slope, atol=2e-8)


def test_the_jacobian_at_the_target_is_the_geometric_one() -> None:
    chain = Chain.from_world(panda_arm(), "panda", "arm", "tool")
    q = np.random.default_rng(2).uniform(chain.lower, chain.upper)
    work = Workspace(panda_arm(), chain.tool_pose(ROOT, q), (1.0, 1.0, 1.0))
    jacobian = work.jacobian(q)
    np.testing.assert_allclose(work.error, 0.0, atol=1e-15)
    arms = work.pose[:, 3] - work.points
    np.testing.assert_allclose(jacobian[:, :3], np.cross(work.axes, arms), atol=1e-14)
    np.testing.assert_allclose(jacobian[:, 3:], work.axes @ work.pose[:, :3], atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.3, 3.0, np.pi - 1e-7, np.pi])
def test_the_rotation_error_is_accurate_at_every_angle(angle: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        axis = P.normalize(rng.normal(size=3))
        start = P.normalize(rng.normal(size=4))
        pose = np.concatenate([P.to_matrix(start), np.zeros((3, 1))], axis=1)
        goal = P.to_matrix(P.multiply(start, P.from_axis_angle(axis, np.array(angle))))
        out = np.empty(3)
        kernels.rotation_error(pose, goal, out)
        gap = min(np.abs(out - angle * axis).max(), np.abs(out + angle * axis).max() if angle == np.pi else np.inf)
        assert gap < 2e-14 * max(1.0, 1e2 * angle)


def test_damped_solve_agrees_with_numpy() -> None:
    rng = np.random.default_rng(4)
    for damping in (1e-8, 1e-3, 1.0):
        jac, error = rng.normal(size=(7, 6)), rng.normal(size=6)
        free = np.array([True, True, False, True, True, True, True])
        solution = np.empty(6)
        kernels.damped_solve(jac, free, damping, error, np.empty((6, 6)), solution)
        expected = np.linalg.solve(jac[free].T @ jac[free] + damping * np.eye(6), error)
        np.testing.assert_allclose(solution, expected, rtol=1e-9)


def test_damped_solve_is_finite_for_a_singular_system() -> None:
    solution = np.empty(6)
    kernels.damped_solve(np.ones((7, 6)), np.ones(7, bool), 1e-18, np.ones(6), np.empty((6, 6)), solution)
    assert np.isfinite(solution).all()


def test_a_bounded_move_is_within_bounds_and_the_best_for_the_joints_that_are_inside() -> None:
    rng = np.random.default_rng(5)
    pressed = 0
    for _ in range(100):
        jac, error, pull = rng.normal(size=(7, 6)), rng.normal(size=6), 0.3 * rng.normal(size=7)
        q, lower, upper = np.zeros(7), rng.uniform(-0.5, 0.0, 7), rng.uniform(0.0, 0.5, 7)
        move, damping = np.empty(7), 0.01
        spare = (np.empty(6), np.empty((6, 6)), np.empty(6))
        kernels.bounded_move(jac, error, damping, q, lower, upper, pull, np.ones(7, bool), move, *spare)
        assert (move >= lower).all()
        assert (move <= upper).all()
        slope = jac @ (jac.T @ move - error) + damping * (move - pull)
        inside = (move > lower) & (move < upper)
        np.testing.assert_allclose(slope[inside], 0.0, atol=1e-9)
        pressed += int((~inside).sum())
    assert pressed > 100


def test_the_generator_matches_the_published_algorithm_and_is_uniform() -> None:
    # The first outputs of SplitMix64 from state 1234567, a common reference.
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]
    key = np.uint64(1234567)
    assert [uniform(key, i) for i in range(4)] == [(value >> 11) / 2.0**53 for value in published]
    draws = np.array([uniform(np.uint64(key), i) for key in range(100) for i in range(20)])
    assert 0.0 <= draws.min()
    assert draws.max() < 1.0
    assert abs(draws.mean() - 0.5) < 0.02
    assert len(np.unique(draws)) == len(draws)


def test_the_kernels_in_use_have_the_starts_of_the_source() -> None:
    """numba's cache does not notice a change of starts.py; without iterations a row's answer is its best start."""
    chain = Chain.from_world(panda_arm(), "panda", "arm", "tool")
    seeds = np.random.default_rng(6).uniform(chain.lower, chain.upper, (20, len(chain)))
    targets, keys = np.tile(chain.tool_pose(ROOT, chain.initial), (20, 1)), np.arange(20, dtype=np.uint64)
    spread, attempts, rows = np.full(len(chain), np.pi), 8, (20,)
    out = np.empty_like(seeds), np.empty(rows, bool), np.empty(rows), np.empty(rows), np.empty(rows, np.int64)
    fixed = canonical_frames(chain), chain.prismatic, chain.lower, chain.upper, spread, np.ones(3), np.full(2, 1e-4)
    kernels.solve_rows(*fixed, attempts, 0, targets, np.tile(ROOT, (20, 1)), seeds, keys, *out)
    restarted = 0
    for row, found in enumerate(out[0]):
        starts = [
            [
                start_position(attempt, k, len(chain), chain.lower[k], chain.upper[k], spread[k], seed, keys[row])
                for k, seed in enumerate(seeds[row])
            ]
            for attempt in range(attempts)
        ]
        assert found.tolist() in starts, "machine code of other starts: delete numba's cache, or touch kernels.py"
        restarted += found.tolist() != starts[0]
    assert restarted > 5
