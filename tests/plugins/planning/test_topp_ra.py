"""The planner `rrt_topp_ra`: limits hold everywhere, and there is little to gain within them."""

import numpy as np
import pytest
from scipy.optimize import linprog

from anysim.conventions import Array
from anysim.model.world import World
from anysim.planning.motion import Budget, PlanStatus, Scene, Trajectory, motion_planner
from anysim_planning.time_law import cautious_speeds, hermite_derivatives, timed
from anysim_planning.topp_ra import reachable_speeds
from tests.plugins.planning.conftest import across

SPEED = np.array([2.175] * 4 + [2.61] * 3)
ACCELERATION = 10.0
BLEND = 0.15


def path(seed: int) -> Array:
    """Three to five random configurations of seven joints."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (rng.integers(3, 6), 7))


def worst(trajectory: Trajectory) -> float:
    """The largest velocity and acceleration of its samples, in their limits."""
    times, q, rate = trajectory
    spans = np.diff(times)[:, None]
    speed = max(float((np.abs(np.diff(q, axis=0)) / spans / SPEED).max()), float((np.abs(rate) / SPEED).max()))
    return max(speed, float((np.abs(np.diff(rate, axis=0)) / spans).max()) / ACCELERATION)


def gone_along(points: Array) -> tuple[Trajectory, tuple[Array, Array, Array], float]:
    """A trajectory along points; lengths, positions and derivatives of its path; and the time that its speeds take."""
    asked = list[tuple[Array, Array, Array]]()
    speeds = list[Array]()

    def law(s: Array, q: Array, first: Array, velocity: Array, acceleration: float) -> Array:
        asked.append((s, q, first))
        speeds.append(reachable_speeds(s, q, first, velocity, acceleration))
        return speeds[-1]

    trajectory = timed(points, SPEED, ACCELERATION, BLEND, law)
    return trajectory, asked[0], duration(asked[0][0], speeds[0])


def duration(s: Array, squares: Array) -> float:
    """[s] along a path with these squares of its speed."""
    return float((2.0 * s[1] / np.maximum(np.sqrt(squares[1:]) + np.sqrt(squares[:-1]), 1e-9)).sum())


def test_limits_hold_and_ends_are_exact_without_being_slowed_down() -> None:
    for seed in range(100):
        points = path(seed)
        trajectory, _, planned = gone_along(points)
        assert worst(trajectory) <= 1.0 + 1e-6
        np.testing.assert_allclose(trajectory.times[-1], planned, rtol=1e-9)
        np.testing.assert_array_equal(trajectory.joint_pos[[0, -1]], points[[0, -1]])
        assert not trajectory.joint_vel[[0, -1]].any()


def test_a_straight_way_takes_the_time_of_full_acceleration_and_full_speed() -> None:
    for way, time in ((0.2, 2 * np.sqrt(0.2 / ACCELERATION)), (2.0, 2.0 / SPEED[0] + SPEED[0] / ACCELERATION)):
        ends = np.zeros((2, 7))
        ends[1, 0] = way
        times = timed(ends, SPEED, ACCELERATION, BLEND, reachable_speeds).times
        assert times[-1] == pytest.approx(time, rel=0.005)


@pytest.mark.parametrize("seed", range(4))
def test_it_is_as_fast_as_a_linear_program_makes_it(seed: int) -> None:
    """The largest sum of squares of the speed, with limits at five places between two points alone."""
    trajectory, (s, q, first), _ = gone_along(path(seed))
    taken = trajectory.times[-1]
    count, step = len(s), s[1]
    rows, at = list[Array](), np.arange(count - 1)
    for share in np.linspace(0.0, 1.0, 5):
        slope, bend = hermite_derivatives(q, first, step, float(share))
        for joint in range(7):
            block = np.zeros((count - 1, count))  # q' u + q'' x, where u = (x' - x) / (2 step)
            block[at, at] = -slope[:, joint] / (2 * step) + bend[:, joint] * (1 - share)
            block[at, at + 1] = slope[:, joint] / (2 * step) + bend[:, joint] * share
            rows += [block, -block]
    highest = (SPEED / np.maximum(np.abs(first), 1e-9)).min(axis=1) ** 2
    highest[[0, -1]] = 0.0
    matrix = np.concatenate(rows)
    best = linprog(
        -np.ones(count), A_ub=matrix, b_ub=np.full(len(matrix), ACCELERATION), bounds=[(0.0, most) for most in highest]
    ).x
    least = duration(s, best)
    assert taken <= 1.05 * least  # a joint is held within the hull of its quadratic, which the program does not ask for
    assert taken < timed(path(seed), SPEED, ACCELERATION, BLEND, cautious_speeds).times[-1]


@pytest.mark.parametrize(("configurations", "share"), [(2, 1.0), (3, 0.87), (5, 0.76)])
def test_corners_take_less_time_than_with_the_cautious_law(configurations: int, share: float) -> None:
    """The figures of the package's page: the mean over random paths of the time, in that of the other law."""
    shares = []
    for seed in range(30):
        points = np.random.default_rng(seed).uniform(-1.5, 1.5, (configurations, 7))
        times = [
            timed(points, SPEED, ACCELERATION, BLEND, law).times[-1] for law in (reachable_speeds, cautious_speeds)
        ]
        shares.append(times[0] / times[1])
    assert np.mean(shares) == pytest.approx(share, abs=0.03)


def test_its_paths_are_those_of_rrt_in_less_time(world: World, scene: Scene) -> None:
    """The way over the wall has corners; the plan is the same when it is asked for again."""
    request = across(world, seed=1)
    made = motion_planner(world, "rrt_topp_ra")
    first, again = (made.plan(request, scene, Budget(request.deadline)) for _ in range(2))
    plain = motion_planner(world, "rrt").plan(request, scene, Budget(request.deadline))
    assert first.status is plain.status is PlanStatus.OK
    assert first.trajectory is not None
    assert first.solver == "rrt_topp_ra 1"
    assert first.trajectory.times[-1] < 0.97 * plain.trajectory.times[-1]
    assert made.is_free(request, scene, first.trajectory.joint_pos)
    assert all(np.array_equal(a, b) for a, b in zip(first.trajectory, again.trajectory, strict=True))
