"""The neutral dynamics, against closed forms, energy, differences of kinematics and each other."""

from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest

from anysim.engine.requirements import damping_ratio, speed_bound
from anysim.kinematics.dynamics import Mechanism, coupling, frame_jacobians, mass_matrix, point_jacobian
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.sketch import Sketch
from anysim.model.world import ControlMode, Inertial, JointType, Physics, World
from anysim.testing import worlds
from tests.plugins.parity.wrong import arm

M1, M2, L1, C1, C2, I1, I2, G = 1.3, 0.7, 0.5, 0.2, 0.3, 0.02, 0.015, 9.81

TREE = worlds.tree()
SPAN = 1e-6


def pendulum(armature: float = 0.0) -> World:
    """Two links in the plane y = 0 that turn about y; at zero both point along x."""
    s = Sketch("double")
    spin = (0.0, 1.0, 0.0)
    first = s.link(
        "a",
        s.robot("p"),
        JointType.REVOLUTE,
        spin,
        Inertial(M1, (C1, 0.0, 0.0), (0.001, I1, I1, 0.0, 0.0, 0.0)),
        armature=armature,
    )
    s.link(
        "b",
        first,
        JointType.REVOLUTE,
        spin,
        Inertial(M2, (C2, 0.0, 0.0), (0.001, I2, I2, 0.0, 0.0, 0.0)),
        position=(L1, 0.0, 0.0),
    )
    return s.world()


@pytest.mark.parametrize(("q", "v"), [((0.0, 0.0), (0.0, 0.0)), ((0.4, -1.1), (0.7, -2.0)), ((-2.0, 2.9), (3.0, 1.0))])
def test_a_planar_arm_has_its_closed_form(q: tuple[float, float], v: tuple[float, float]) -> None:
    """Textbook, with angles counted downwards: a positive turn about y lowers the arm."""
    mass, bias = Mechanism(pendulum(armature=0.3)).equations(np.array(q), np.array(v))
    coupling = M2 * L1 * C2
    a = I1 + I2 + M1 * C1**2 + M2 * (L1**2 + C2**2) + 2 * coupling * cos(q[1])
    b = I2 + M2 * C2**2 + coupling * cos(q[1])
    np.testing.assert_allclose(mass, [[a + 0.3, b], [b, I2 + M2 * C2**2]], atol=1e-13)
    h = -coupling * sin(q[1])
    gravity_2 = -M2 * G * C2 * cos(q[0] + q[1])
    gravity_1 = -(M1 * C1 + M2 * L1) * G * cos(q[0]) + gravity_2
    expected = [h * (2 * v[0] * v[1] + v[1] ** 2) + gravity_1, -h * v[0] ** 2 + gravity_2]
    np.testing.assert_allclose(bias, expected, atol=1e-12)


def test_the_mass_matrix_is_symmetric_and_positive() -> None:
    world, rng = arm(), np.random.default_rng(0)
    for q in rng.uniform(-1.0, 1.0, (5, 3)):
        mass = Mechanism(world).equations(q, np.zeros(3)).mass
        np.testing.assert_array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass).min() > 0


def test_both_mass_matrices_are_one() -> None:
    """Summed over the bodies' Jacobians, and composed along the chains from the tips."""
    world, q = arm(), np.array([0.3, -0.4, 0.1])
    poses = forward_kinematics(world, world.initial_body_pose[None], q[None])[0]
    composed = Mechanism(world).equations(q, np.zeros(3)).mass
    np.testing.assert_allclose(mass_matrix(world, poses), composed, rtol=1e-12, atol=1e-14)


def test_without_gravity_the_kinetic_energy_stays() -> None:
    """v' M'(q) v / 2 must be what the bias takes: a small step keeps the energy to second order."""
    world = replace(pendulum(), physics=Physics(gravity=(0.0, 0.0, 0.0)))
    mechanism, h = Mechanism(world), 1e-5
    q, v = np.array([0.3, 0.9]), np.array([1.0, -2.0])
    mass, bias = mechanism.equations(q, v)
    push = np.linalg.solve(mass, -bias)
    energy = [
        0.5 * w @ mechanism.equations(p, w).mass @ w for p, w in ((q - h * v, v - h * push), (q + h * v, v + h * push))
    ]
    assert (energy[1] - energy[0]) / (2 * h) == pytest.approx(0.0, abs=1e-8)


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


def test_a_point_moves_with_its_body() -> None:
    joints = np.array([0.3, -0.2, 0.8, -0.5])
    poses = poses_at(joints)
    assert np.allclose(point_jacobian(TREE, poses, 3, poses[3, :3]), frame_jacobians(TREE, poses)[3, :3])


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
