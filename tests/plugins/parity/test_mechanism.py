"""The equations of motion, against closed forms, energy and the sums of the neutral dynamics."""

from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest

from anysim.kinematics.dynamics import mass_matrix
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import Inertial, JointType, Physics, World
from anysim.testing.sketch import Sketch
from anysim_parity.mechanism import Mechanism
from tests.plugins.parity.wrong import arm

M1, M2, L1, C1, C2, I1, I2, G = 1.3, 0.7, 0.5, 0.2, 0.3, 0.02, 0.015, 9.81


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
