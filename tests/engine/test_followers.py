"""Joints that follow others are written with them, also through others that follow."""

import numpy as np

from anysim.engine.arguments import with_followers
from anysim.model.world import Joint, JointType, Mimic, World


def test_followers_of_followers_are_written_too() -> None:
    """Whatever the order in which they stand."""
    mimics = (Mimic(1, 3.0, 0.1), Mimic(2, -2.0), None, Mimic(2, 0.5))
    joints = tuple(
        Joint(f"j{i}", i, JointType.REVOLUTE, (0.0, 0.0, 1.0), mimic=mimic) for i, mimic in enumerate(mimics)
    )
    which, position, velocity = with_followers(
        World(joints=joints), np.array([2]), np.array([[0.2], [0.4]]), np.array([[1.0], [0.0]])
    )
    assert position is not None
    assert velocity is not None
    order = np.argsort(which)
    assert which[order].tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(position[:, order], [[-1.1, -0.4, 0.2, 0.1], [-2.3, -0.8, 0.4, 0.2]])
    np.testing.assert_allclose(velocity[:, order], [[-6.0, -2.0, 1.0, 0.5], [0.0, 0.0, 0.0, 0.0]])
