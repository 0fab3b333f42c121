"""`numpy_ik` is the method of `numba_ik` without numba."""

import numpy as np

from anysim import registry
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim.testing.arms import Link, panda_arm, serial_arm
from anysim_control.batch.arrays import NumpyIk
from anysim_control.batch.planner import NumbaIk

ROOT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
PANDA = Chain.from_world(panda_arm(), "panda", "arm", "tool")


def problems(chain: Chain, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    base = np.concatenate([rng.uniform(-2, 2, (rows, 3)), P.normalize(rng.normal(size=(rows, 4)))], axis=1)
    goals = rng.uniform(chain.lower, chain.upper, (rows, len(chain)))
    return chain.tool_pose(base, goals), base, rng.uniform(chain.lower, chain.upper, goals.shape)


def test_it_is_a_registered_planner() -> None:
    assert registry.load("planners", "numpy_ik") is NumpyIk


def test_200_of_200_reachable_poses_are_found_within_the_limits() -> None:
    targets, base, seeds = problems(PANDA, 200)
    keys = np.arange(200, dtype=np.uint64)
    for ik in (NumpyIk(PANDA), NumbaIk(PANDA)):
        found = ik.solve(targets, base, seeds, random_restarts=60, rng_seeds=keys)
        poses = PANDA.tool_pose(base, found.joint_pos)
        assert found.converged.all()
        assert (P.norm(poses[:, :3] - targets[:, :3]) < 1e-4).all()
        assert (P.angle_between(poses[:, 3:], targets[:, 3:]) < 1e-4).all()
        assert ((found.joint_pos >= PANDA.lower) & (found.joint_pos <= PANDA.upper)).all()


def test_a_row_is_the_same_bits_in_any_batch() -> None:
    targets, base, seeds = problems(PANDA, 12)
    keys = np.arange(12, dtype=np.uint64)
    ik = NumpyIk(PANDA)
    whole = ik.solve(targets, base, seeds, random_restarts=6, rng_seeds=keys)
    stepped = ik.step(targets, base, seeds, max_step=0.05, posture=PANDA.initial)
    for row in (0, 5, 11):
        at = slice(row, row + 1)
        alone = ik.solve(targets[at], base[at], seeds[at], random_restarts=6, rng_seeds=keys[at])
        assert (alone.joint_pos[0] == whole.joint_pos[row]).all()
        assert alone.iterations[0] == whole.iterations[row]
        one = ik.step(targets[at], base[at], seeds[at], max_step=0.05, posture=PANDA.initial)
        assert (one.joint_pos[0] == stepped.joint_pos[row]).all()


def test_steps_are_those_of_the_compiled_solver() -> None:
    slide = Link((0.1, 0.0, 0.2), axis=(0.0, 0.6, 0.8), type=JointType.PRISMATIC, lower=-0.3, upper=0.4)
    turn = Link((0.2, 0.0, 0.1), (0.3, 0.0, 0.0), axis=(0.0, 1.0, 0.0), anchor=(0.05, 0.0, 0.02))
    mixed = Chain.from_world(serial_arm((slide, turn, slide, turn)), "robot", "arm", "tool")
    for chain in (PANDA, mixed):
        targets, base, seeds = problems(chain, 50)
        for weight in ((1.0, 1.0, 1.0), (1.0, 1.0, 0.0)):
            steps = [
                ik.step(targets, base, seeds, max_step=0.1, posture=chain.initial, rotation_weight=weight)
                for ik in (NumpyIk(chain), NumbaIk(chain))
            ]
            for mine, theirs in zip(*steps, strict=True):
                np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_what_cannot_be_reached_is_reported_with_the_nearest_found() -> None:
    target = np.array([[3.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]])
    found = NumpyIk(PANDA).solve(
        target, ROOT[None], PANDA.initial[None], random_restarts=3, rng_seeds=np.zeros(1, np.uint64)
    )
    assert not found.converged[0]
    assert 1.0 < found.position_error[0] < 3.0
