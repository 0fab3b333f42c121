"""Compiled virtual indentation: how far taxels would give way for a skin to carry a force, and what each then carries.

Taxel i yields with a stiffness k_i [N/m] along its normal. If what touches it were moved on by a small rigid motion
with coordinates t, the taxel would give way by max(0, J_i t - gap_i), and push back by k_i times that. The motion whose
pushes have the wanted force and moment is the least of a convex function, found by damped Newton steps that go down.
"""

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled

STEPS = 100
CLOSE = 1e-11
"""Of the wanted force: how near its pushes come."""
DAMPED = 1e-6
"""Of the whole stiffness: the first damping of a step that went wrong."""
SPRING = 1e-3
"""Of the whole stiffness: what leads back to a straight motion where none does what is wanted."""
NOTHING = 1e-10
"""Pivots below this part of the largest are no equation."""


@compiled
def _copy(array: Array, out: Array) -> None:
    """Number by number: a slice takes numba a second to compile, for what it would say of other shapes."""
    for i in range(array.shape[0]):
        out[i] = array[i]


@compiled
def _solve(matrix: Array, right: Array, least: float, out: Array) -> None:
    """The solution (q,) of a symmetric system without negative eigenvalues; 0 where there is no equation.

    Pivots up to `least` are no equation either. The matrix and the right side are overwritten.
    """
    q = right.shape[0]
    order = np.arange(q)
    rank = q
    for i in range(q):
        least = max(least, NOTHING * matrix[i, i])
    for i in range(q):
        best = i
        for j in range(i + 1, q):
            if matrix[order[j], order[j]] > matrix[order[best], order[best]]:
                best = j
        order[i], order[best] = order[best], order[i]
        a = order[i]
        if not matrix[a, a] > least:
            rank = i
            break
        for j in range(i + 1, q):
            b = order[j]
            share = matrix[b, a] / matrix[a, a]
            right[b] -= share * right[a]
            for k in range(i + 1, q):
                matrix[b, order[k]] -= share * matrix[a, order[k]]
    out[:] = 0.0
    for i in range(rank - 1, -1, -1):
        a = order[i]
        total = right[a]
        for j in range(i + 1, rank):
            total -= matrix[a, order[j]] * out[order[j]]
        out[a] = total / matrix[a, a]


@compiled
def _depths(gap: Array, lever: Array, at: Array, deep: Array) -> None:
    """How far a motion is past each gap (T,) [m], below 0 where it does not come so far."""
    for i in range(gap.shape[0]):
        deep[i] = -gap[i]
    for a in range(at.shape[0]):
        for i in range(gap.shape[0]):
            deep[i] += lever[a, i] * at[a]


@compiled
def _dot(x: Array, y: Array) -> float:
    """The sum of products of two rows; in eight parts, which processors add at once."""
    a, b, c, d, e, f, g, h = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    whole = x.shape[0] // 8 * 8
    for i in range(0, whole, 8):
        a, b, c, d = a + x[i] * y[i], b + x[i + 1] * y[i + 1], c + x[i + 2] * y[i + 2], d + x[i + 3] * y[i + 3]
        e, f, g = e + x[i + 4] * y[i + 4], f + x[i + 5] * y[i + 5], g + x[i + 6] * y[i + 6]
        h += x[i + 7] * y[i + 7]
    for i in range(whole, x.shape[0]):
        a += x[i] * y[i]
    return ((a + e) + (b + f)) + ((c + g) + (d + h))


@compiled
def _pushed(
    gap: Array,
    lever: Array,
    stiffness: Array,
    wanted: Array,
    home: Array,
    pull: float,
    at: Array,
    deep: Array,
    slope: Array,
    matrix: Array,
    work: Array,
) -> float:
    """The function, its slope (q,) and its matrix of second derivatives (q, q) at a motion.

    A spring of stiffness `pull` leads back to a motion `home`.
    """
    q = at.shape[0]
    value = 0.0
    for a in range(q):
        away = at[a] - home[a]
        slope[a] = pull * away - wanted[a]
        value += 0.5 * pull * away * away - wanted[a] * at[a]
        for b in range(q):
            matrix[a, b] = 0.0
        matrix[a, a] = pull
    _depths(gap, lever, at, deep)
    taxels = gap.shape[0]
    stiff, push = work[q], work[q + 1]
    for i in range(taxels):
        depth = deep[i] if deep[i] > 0.0 else 0.0
        stiff[i] = stiffness[i] if depth > 0.0 else 0.0
        push[i] = stiffness[i] * depth
        deep[i] = depth
    value += 0.5 * _dot(push, deep)
    for a in range(q):
        slope[a] += _dot(push, lever[a])
        for i in range(taxels):
            work[a, i] = stiff[i] * lever[a, i]
        for b in range(a + 1):
            matrix[a, b] += _dot(work[a], lever[b])
    for a in range(q):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
    return value


@compiled
def _straight(gap: Array, lever: Array, stiffness: Array, along: Array, force: float) -> float:
    """How far a motion in one direction goes until the pushes do a force along it; 0 where nothing pushes back.

    From where all that could touch does, each step of Newton's method comes nearer from beyond.
    """
    far, speed = np.inf, np.zeros(gap.shape[0])
    for a in range(along.shape[0]):
        for i in range(gap.shape[0]):
            speed[i] += lever[a, i] * along[a]
    for _ in range(200):
        push, rate = -force, 0.0
        for i in range(gap.shape[0]):
            if speed[i] > 0.0 and gap[i] < np.inf and (far == np.inf or speed[i] * far > gap[i]):
                push -= stiffness[i] * speed[i] * gap[i]
                rate += stiffness[i] * speed[i] * speed[i]
        if rate == 0.0:
            return 0.0
        nearer = -push / rate
        if far < np.inf and not nearer < far - 1e-15 * abs(far):
            break
        far = nearer
    return far


@compiled
def _balance(
    gap: Array,
    lever: Array,
    stiffness: Array,
    wanted: Array,
    home: Array,
    pull: float,
    largest: float,
    at: Array,
    deep: Array,
) -> bool:
    """Move to where the pushes, and the spring, balance what is wanted; whether that was reached."""
    q = lever.shape[0]
    slope, other, step, trial, right = np.empty(q), np.empty(q), np.empty(q), np.empty(q), np.empty(q)
    matrix, new_matrix, step_matrix = np.empty((q, q)), np.empty((q, q)), np.empty((q, q))
    work = np.empty((q + 2, gap.shape[0]))
    size, damping = 0.0, 0.0
    for a in range(q):
        size += wanted[a] ** 2
    value = _pushed(gap, lever, stiffness, wanted, home, pull, at, deep, slope, matrix, work)
    for _ in range(STEPS):
        steep = 0.0
        for a in range(q):
            steep += slope[a] ** 2
        if steep <= CLOSE**2 * size:
            return True
        for a in range(q):
            _copy(matrix[a], step_matrix[a])
        for a in range(q):
            right[a] = -slope[a]
            step_matrix[a, a] += damping
        _solve(step_matrix, right, 0.0, step)
        down, lower, flatter = 0.0, np.inf, np.inf
        for a in range(q):
            trial[a] = at[a] + step[a]
            down += slope[a] * step[a]
        if down < -0.5 * steep / (largest + pull + damping):  # as a step does that solves all equations
            lower = _pushed(gap, lever, stiffness, wanted, home, pull, trial, deep, other, new_matrix, work)
            flatter = 0.0
            for a in range(q):
                flatter += other[a] ** 2
        if lower <= value + 1e-4 * down or flatter < 0.25 * steep:
            value, damping = lower, 0.1 * damping
            _copy(trial, at)
            _copy(other, slope)
            for a in range(q):
                _copy(new_matrix[a], matrix[a])
        else:  # too far, or taxels that touch nothing yet have to: smaller steps, down the slope
            damping = max(10.0 * damping, DAMPED * largest)
    return False


@compiled
def press(
    gap: Array, lever: Array, stiffness: Array, wanted: Array, along: Array, force: Array, motion: Array, deep: Array
) -> None:
    """How deep taxels give way in each env.

    Args:
        gap: (N, T) [m] between each taxel and what is over it, negative where it is in it, inf where nothing is.
        lever: (q, T) the J above, across.
        stiffness: (T,) [N/m].
        wanted: (N, q) force and moment, in the coordinates of the motion.
        along: (N, q) the motion straight along the force, from which the search starts, and near which it ends if no
            motion does what is wanted.
        force: (N,) [N] its size; nothing gives way where it is 0.
        motion: (N, q) written.
        deep: (N, T) written [m].
    """
    q = lever.shape[0]
    home, at = np.empty(q), np.empty(q)
    largest = 0.0
    for i in range(stiffness.shape[0]):
        for a in range(q):
            largest += stiffness[i] * lever[a, i] ** 2
    for e in range(gap.shape[0]):
        motion[e], deep[e] = 0.0, 0.0
        if not force[e] > 0.0:
            continue
        far = _straight(gap[e], lever, stiffness, along[e], force[e])
        for a in range(q):
            home[a] = far * along[e, a]
        _copy(home, at)
        if not _balance(gap[e], lever, stiffness, wanted[e], home, 0.0, largest, at, deep[e]):
            _copy(home, at)
            _balance(gap[e], lever, stiffness, wanted[e], home, SPRING * largest, largest, at, deep[e])
        _copy(at, motion[e])
        _depths(gap[e], lever, at, deep[e])
        for i in range(gap.shape[1]):
            deep[e, i] = max(0.0, deep[e, i])


@compiled
def share(push: Array, points: Array, normals: Array, wrench: Array, force: Array, total: Array) -> None:
    """What each taxel carries of a force and moment: its push, and a part in proportion to it to make the sums right.

    The part is that of a velocity field: the same for all, and a turn about the middle of the pushes. A turn that would
    have a taxel pull is made smaller.

    Args:
        push: (N, T) [N] along the inward normals, 0 or more.
        points, normals: (T, 3).
        wrench: (N, 6) force and moment about the origin that the sum is to have.
        force: (N, T, 3) written [N].
        total: (N, 6) written, the sum of those forces and of their moments about the origin.
    """
    inertia, right, turn = np.empty((3, 3)), np.empty(3), np.empty(3)
    wide = 0.0
    for i in range(points.shape[0]):
        for k in range(3):
            wide = max(wide, (points[i, k] - points[0, k]) ** 2)
    for e in range(push.shape[0]):
        strong, m0, m1, m2 = 0.0, 0.0, 0.0, 0.0
        l0, l1, l2, t0, t1, t2 = wrench[e, 0], wrench[e, 1], wrench[e, 2], wrench[e, 3], wrench[e, 4], wrench[e, 5]
        for i in range(points.shape[0]):
            p = push[e, i]
            strong += p
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            a, b, c = -p * normals[i, 0], -p * normals[i, 1], -p * normals[i, 2]
            force[e, i, 0], force[e, i, 1], force[e, i, 2] = a, b, c
            m0, m1, m2 = m0 + p * x, m1 + p * y, m2 + p * z
            l0, l1, l2 = l0 - a, l1 - b, l2 - c
            t0, t1, t2 = t0 - (y * c - z * b), t1 - (z * a - x * c), t2 - (x * b - y * a)
        total[e] = 0.0
        if not strong > 0.0:
            continue
        m0, m1, m2, l0, l1, l2 = m0 / strong, m1 / strong, m2 / strong, l0 / strong, l1 / strong, l2 / strong
        right[0] = t0 - (m1 * l2 - m2 * l1) * strong
        right[1] = t1 - (m2 * l0 - m0 * l2) * strong
        right[2] = t2 - (m0 * l1 - m1 * l0) * strong
        xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(points.shape[0]):
            p = push[e, i]
            if p > 0.0:
                x, y, z = points[i, 0] - m0, points[i, 1] - m1, points[i, 2] - m2
                xx, yy, zz = xx + p * (y * y + z * z), yy + p * (x * x + z * z), zz + p * (x * x + y * y)
                xy, xz, yz = xy - p * x * y, xz - p * x * z, yz - p * y * z
        inertia[0, 0], inertia[1, 1], inertia[2, 2] = xx, yy, zz
        inertia[0, 1], inertia[1, 0] = xy, xy
        inertia[0, 2], inertia[2, 0] = xz, xz
        inertia[1, 2], inertia[2, 1] = yz, yz
        _solve(inertia, right, NOTHING * wide * strong, turn)
        w0, w1, w2 = turn[0], turn[1], turn[2]
        part = 1.0
        for i in range(points.shape[0]):
            if push[e, i] > 0.0:
                x, y, z = points[i, 0] - m0, points[i, 1] - m1, points[i, 2] - m2
                pull = normals[i, 0] * (w1 * z - w2 * y)
                pull += normals[i, 1] * (w2 * x - w0 * z)
                pull += normals[i, 2] * (w0 * y - w1 * x)
                left = 1.0 - normals[i, 0] * l0 - normals[i, 1] * l1 - normals[i, 2] * l2
                if part * pull > left:
                    part = max(left, 0.0) / pull
        w0, w1, w2 = w0 * part, w1 * part, w2 * part
        f0, f1, f2, t0, t1, t2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(points.shape[0]):
            p = push[e, i]
            if p > 0.0:
                x, y, z = points[i, 0] - m0, points[i, 1] - m1, points[i, 2] - m2
                a = force[e, i, 0] + p * (l0 + w1 * z - w2 * y)
                b = force[e, i, 1] + p * (l1 + w2 * x - w0 * z)
                c = force[e, i, 2] + p * (l2 + w0 * y - w1 * x)
                force[e, i, 0], force[e, i, 1], force[e, i, 2] = a, b, c
                x, y, z = points[i, 0], points[i, 1], points[i, 2]
                f0, f1, f2 = f0 + a, f1 + b, f2 + c
                t0, t1, t2 = t0 + (y * c - z * b), t1 + (z * a - x * c), t2 + (x * b - y * a)
        total[e, 0], total[e, 1], total[e, 2] = f0, f1, f2
        total[e, 3], total[e, 4], total[e, 5] = t0, t1, t2
