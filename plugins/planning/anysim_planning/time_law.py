"""The time law of a path: as fast as velocity and acceleration limits let it be, at rest at both ends."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.planning.motion import Trajectory

KNOTS = 240
PERIOD = 0.01
"""[s] between the rows of a trajectory."""
Speeds = Callable[[Array, Array, Array, Array, float], Array]
"""Of lengths (M,) along a path, evenly spaced, positions and their derivatives (M, K) there, velocity limits (K,) and
the acceleration limit: squares (M,) of the speed along the path, which begins and ends at rest."""


def cautious_speeds(s: Array, q: Array, first: Array, velocity: Array, acceleration: float) -> Array:
    """Squares (M,) of the speed, as `Speeds` has them: what bends the path and what speeds up are limited apart."""
    del q
    step, second = s[1], np.gradient(first, s, axis=0)
    slope, bend = np.maximum(np.abs(first), 1e-9), np.abs(second)
    most = np.minimum((velocity / slope) ** 2, 0.7 * acceleration / np.maximum(bend, 1e-9)).min(axis=1)
    most[[0, -1]] = 0.0
    for order in (range(len(most) - 1), range(len(most) - 1, 0, -1)):
        for i in order:
            j = i + 1 if order.step > 0 else i - 1
            gain = ((acceleration - bend[i] * most[i]) / slope[i]).min()
            most[j] = min(most[j], most[i] + 2 * step * max(gain, 0.0))
    return most


def timed(
    path: Array, velocity: Array, acceleration: float, blend: float, speeds: Speeds = cautious_speeds
) -> Trajectory:
    """A trajectory along a path (M, K), whose corners are cut within `blend` of them; with 0 it rests at each.

    Where samples of it are beyond limits in spite of `speeds`, all of it is slowed down.
    """
    if len(path) > 2 and blend == 0.0:
        parts = [timed(path[i : i + 2], velocity, acceleration, blend, speeds) for i in range(len(path) - 1)]
        return _joined(parts)
    dense = _rounded(path, blend)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(length) > 1e-12])
    dense, length = dense[keep], length[keep]
    if len(dense) < 2:
        return Trajectory(np.zeros(1), path[:1].copy(), np.zeros_like(path[:1]))
    s = np.linspace(0.0, length[-1], KNOTS)
    q = np.column_stack([np.interp(s, length, column) for column in dense.T])
    first = np.gradient(q, s, axis=0)
    speed2 = speeds(s, q, first, velocity, acceleration)
    return _sampled(s, q, first, speed2, velocity, acceleration)


def _rounded(path: Array, blend: float) -> Array:
    """Corners as quadratic Bezier curves."""
    rows = [path[:1]]
    t = np.linspace(0.0, 1.0, 17)[:, None]
    for before, corner, after in zip(path[:-2], path[1:-1], path[2:], strict=True):
        into, out = before - corner, after - corner
        size = np.linalg.norm(into), np.linalg.norm(out)
        if min(size) < 1e-9:
            continue
        radius = min(blend, 0.45 * float(size[0]), 0.45 * float(size[1]))
        a, b = corner + into / size[0] * radius, corner + out / size[1] * radius
        rows.append((1 - t) ** 2 * a + 2 * t * (1 - t) * corner + t**2 * b)
    return np.concatenate([*rows, path[-1:]])


def _sampled(s: Array, q: Array, first: Array, speed2: Array, velocity: Array, acceleration: float) -> Trajectory:
    speed = np.sqrt(speed2)
    step = s[1] - s[0]
    knots = np.concatenate([[0.0], np.cumsum(2 * step / np.maximum(speed[1:] + speed[:-1], 1e-9))])
    stretch = 1.0
    for _ in range(30):
        times = np.append(np.arange(0.0, knots[-1] * stretch, PERIOD), knots[-1] * stretch)
        if len(times) > 2 and times[-1] - times[-2] < 1e-6:
            times = np.delete(times, -2)
        clock = times / stretch
        i = np.clip(np.searchsorted(knots, clock, side="right") - 1, 0, len(s) - 2)
        into = clock - knots[i]
        gain = (speed2[i + 1] - speed2[i]) / (2 * step)
        along = np.clip((speed[i] * into + 0.5 * gain * into**2) / step, 0.0, 1.0)
        now = np.sqrt(np.maximum(speed2[i] + 2 * gain * along * step, 0.0)) / stretch
        position, slope = _hermite(q, first, step, i, along)
        rate = slope * now[:, None]
        rate[[0, -1]] = 0.0
        position[0], position[-1] = q[0], q[-1]
        spans = np.diff(times)[:, None]
        used = np.abs(np.diff(position, axis=0)) / spans
        change = np.abs(np.diff(rate, axis=0)) / spans
        over = max(float((used / velocity).max()), float((np.abs(rate) / velocity).max()))
        over = max(over, float(np.sqrt(change.max() / acceleration)))
        if over <= 1.0 + 1e-6:
            break
        stretch *= over * 1.002
    return Trajectory(times, position, rate)


def _hermite(q: Array, first: Array, step: float, i: Array, u: Array) -> tuple[Array, Array]:
    """Positions and slopes of the cubic between knots, `u` of the way from knot `i` to the next."""
    u = u[:, None]
    a, b, da, db = q[i], q[i + 1], first[i] * step, first[i + 1] * step
    position = (
        (2 * u**3 - 3 * u**2 + 1) * a + (u**3 - 2 * u**2 + u) * da + (3 * u**2 - 2 * u**3) * b + (u**3 - u**2) * db
    )
    return position, _slope(a, b, da, db, u) / step


def hermite_derivatives(q: Array, first: Array, step: float, u: float) -> tuple[Array, Array]:
    """First and second derivatives (M - 1, K) of the cubics between all knots, `u` of the way along each."""
    a, b, da, db = q[:-1], q[1:], first[:-1] * step, first[1:] * step
    bend = (12 * u - 6) * (a - b) + (6 * u - 4) * da + (6 * u - 2) * db
    return _slope(a, b, da, db, u) / step, bend / step**2


def _slope(a: Array, b: Array, da: Array, db: Array, u: Array | float) -> Array:
    """The derivative by `u` of the cubic from `a` to `b` that has `da` and `db` at its ends."""
    return (6 * u**2 - 6 * u) * (a - b) + (3 * u**2 - 4 * u + 1) * da + (3 * u**2 - 2 * u) * db


def _joined(parts: list[Trajectory]) -> Trajectory:
    times, position, rate = [parts[0].times], [parts[0].joint_pos], [parts[0].joint_vel]
    for part in parts[1:]:
        if len(part.times) > 1:
            times.append(part.times[1:] + times[-1][-1])
            position.append(part.joint_pos[1:])
            rate.append(part.joint_vel[1:])
    return Trajectory(np.concatenate(times), np.concatenate(position), np.concatenate(rate))
