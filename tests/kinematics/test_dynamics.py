"""The neutral dynamics, against closed forms and differences of kinematics."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.conditioning import damping_ratio
from anysim.engine.requirements import speed_bound
from anysim.kinematics.dynamics import coupling, frame_jacobians, mass_matrix
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import ControlMode
from anysim.testing import worlds

TREE = worlds.tree()
SPAN = 1e-6


def poses_at(joints: np.ndarray) -> np.ndarray:
    roots = np.array([[*body.position, *body.quaternion] for body in TREE.bodies])
    return forward_kinematics(TREE, roots[None], joints[None])[0]


def test_jacobians_are_differences_of_poses() -> None:
    """Moving one joint a little moves every frame as its column says; free bodies have columns of their own."""
    joints = np.array([0.3, -0.2, 0.8, -0.5])
    jacobian = frame_jacobians(TREE, poses_at(joints))
    for j in range(len(joints)):
        step = SPAN * np.eye(len(joints))[j]
        moved = (poses_at(joints + step)[:, :3] - poses_at(joints - step)[:, :3]) / (2 * SPAN)
        assert np.abs(jacobian[:, :3, j] - moved).max() < 1e-8
    free = [i for i, body in enumerate(TREE.bodies) if body.kind == "free"]
    assert np.array_equal(jacobian[free[1], :, -6:], np.eye(6))
    assert not jacobian[free[0], :, -6:].any()


def test_the_mass_matrix_of_a_pendulum() -> None:
    """m l^2 + I about the pivot, and the rotor's inertia on top; symmetric and positive in a tree."""
    world = worlds.pendulum(0.5)
    bob = world.bodies[1].inertial
    wanted = bob.mass * 0.25 + bob.inertia[0]
    assert mass_matrix(world, world.initial_body_pose)[0, 0] == pytest.approx(wanted)
    heavy = replace(world, joints=(replace(world.joints[0], armature=0.2),))
    assert mass_matrix(heavy, heavy.initial_body_pose)[0, 0] == pytest.approx(wanted + 0.2)
    matrix = mass_matrix(TREE, TREE.initial_body_pose)
    assert np.allclose(matrix, matrix.T)
    assert np.linalg.eigvalsh(matrix).min() > 0


def test_coupled_joints_move_as_one() -> None:
    world = worlds.gripper()
    assert coupling(world).tolist() == [[1.0], [0.5]]


def test_the_damping_ratio_of_a_carriage() -> None:
    """dt kd / m, and nothing for a drive in effort mode."""
    assert damping_ratio(worlds.slider(ControlMode.POSITION, 100.0, 500.0)) == pytest.approx(0.002 * 500.0 / 2.0)
    assert damping_ratio(worlds.slider(ControlMode.EFFORT, 100.0, 500.0)) == 0.0


def test_the_bound_that_a_velocity_limit_sets() -> None:
    """kd times the limit; none without damping or without a limit."""
    bound = speed_bound(np.array([[10.0, 0.0, 10.0]]), np.array([0.5, 0.5, np.inf]))
    assert bound.tolist() == [[5.0, np.inf, np.inf]]
