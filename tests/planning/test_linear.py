"""Straight tool lines: speed limits, end points, the shorter way round, independence of the batch."""

import numpy as np
import pytest

from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.planning.linear import interpolate, straight_line


def poses(n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.uniform(-1, 1, (n, 3)), P.normalize(rng.normal(size=(n, 4)))], axis=1)


def test_ends_are_the_start_and_the_goal_exactly() -> None:
    start, goal = poses(5, 0), poses(5, 1)
    assert (interpolate(start, goal, np.zeros(5)) == start).all()
    assert (interpolate(start, goal, np.ones(5)) == goal).all()


def test_halfway_is_the_middle_of_the_line_and_of_the_shorter_arc() -> None:
    start, goal = poses(50, 2), poses(50, 3)
    middle = interpolate(start, goal, np.full(50, 0.5))
    np.testing.assert_allclose(middle[:, :3], 0.5 * (start[:, :3] + goal[:, :3]), atol=1e-15)
    whole = P.angle_between(start[:, 3:], goal[:, 3:])
    assert (whole <= np.pi).all()
    np.testing.assert_allclose(P.angle_between(start[:, 3:], middle[:, 3:]), 0.5 * whole, atol=1e-12)
    np.testing.assert_allclose(P.angle_between(middle[:, 3:], goal[:, 3:]), 0.5 * whole, atol=1e-12)


def test_a_line_keeps_to_both_limits_and_uses_one_of_them() -> None:
    start, goal = poses(40, 4), poses(40, 5)
    line = straight_line(start, goal, speed=0.25, turn_rate=1.0, dt=0.02)
    path = np.concatenate([start[:, None], line.poses], axis=1)
    speed = P.norm(np.diff(path[..., :3], axis=1)) / 0.02
    rate = P.angle_between(path[:, :-1, 3:], path[:, 1:, 3:]) / 0.02
    assert speed.max() <= 0.25 * (1 + 1e-9)
    assert rate.max() <= 1.0 * (1 + 1e-9)
    shortest = np.maximum(P.norm(goal[:, :3] - start[:, :3]) / 0.25, P.angle_between(start[:, 3:], goal[:, 3:])) / 0.02
    assert (line.ticks < shortest + 1).all()


def test_rows_arrive_at_their_tick_and_hold() -> None:
    start = poses(2, 6)
    goal = start.copy()
    goal[0, 0] += 0.1
    goal[1, 1] += 0.4
    line = straight_line(start, goal, speed=0.5, turn_rate=1.0, dt=0.02)
    assert line.ticks.tolist() == [10, 40]
    assert line.poses.shape == (2, 40, 7)
    assert (line.poses[0, 9:] == goal[0]).all()
    assert (line.poses[0, 8] != goal[0]).any()
    assert (line.poses[1, -1] == goal[1]).all()


def test_standing_still_takes_one_tick() -> None:
    start = poses(3, 7)
    line = straight_line(start, start, speed=0.5, turn_rate=1.0, dt=0.02)
    assert line.ticks.tolist() == [1, 1, 1]
    assert (line.poses[:, 0] == start).all()


def test_the_opposite_quaternion_is_the_same_orientation() -> None:
    start = poses(1, 8)
    goal = start * np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
    assert straight_line(start, goal, speed=1.0, turn_rate=0.1, dt=0.02).ticks.tolist() == [1]


def test_a_row_does_not_depend_on_its_batch() -> None:
    start, goal = poses(23, 9), poses(23, 10)
    together = straight_line(start, goal, speed=0.3, turn_rate=1.2, dt=0.02)
    for i in range(23):
        alone = straight_line(start[i : i + 1], goal[i : i + 1], speed=0.3, turn_rate=1.2, dt=0.02)
        assert alone.ticks[0] == together.ticks[i]
        assert (alone.poses[0] == together.poses[i, : alone.ticks[0]]).all()


def test_no_rows_make_no_poses() -> None:
    assert straight_line(np.empty((0, 7)), np.empty((0, 7)), speed=1.0, turn_rate=1.0, dt=0.1).poses.shape == (0, 0, 7)


def test_wrong_arguments_are_refused() -> None:
    start = poses(2, 11)
    with pytest.raises(AnysimError, match=r"expected start and goal of one shape \(n, 7\), got \(2, 7\) and \(1, 7\)"):
        straight_line(start, start[:1], speed=1.0, turn_rate=1.0, dt=0.1)
    with pytest.raises(AnysimError, match="turn_rate must be positive, got 0"):
        straight_line(start, start, speed=1.0, turn_rate=0, dt=0.1)
    with pytest.raises(AnysimError, match=r"not finite in rows \[1\]"):
        straight_line(start, np.where(np.arange(2)[:, None] == 1, np.nan, start), speed=1.0, turn_rate=1.0, dt=0.1)
