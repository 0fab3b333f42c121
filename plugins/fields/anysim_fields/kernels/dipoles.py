"""Forces and torques of point dipoles, from an energy that is continued by its tangent where they come too near.

The energy of two is U = k (f m1.m2 - 3 g (m1.r)(m2.r)), k = mu0 / 4 pi, with f = r^-3 and g = r^-5 outside of the sum a
of their radii. Within it f and g go on as their tangents in r^2: forces stay continuous and finite, and vanish where r
does. Since U depends on nothing but the two moments and r, momentum, angular momentum and energy are kept everywhere.
"""

import math

from anysim.conventions import Array
from anysim_fields.kernels.compiling import compiled

MU0 = 1.25663706127e-6
"""[T m/A] CODATA 2022."""
K = MU0 / (4.0 * math.pi)
SWEEPS = 200


@compiled
def falloff(square: float, near: float) -> tuple[float, float, float, float]:
    """f, g and their derivatives by r^2, at a square of r, with the tangent within `near` [m]."""
    at = max(square, near * near)
    r = math.sqrt(at)
    f, g = 1.0 / (at * r), 1.0 / (at * at * r)
    df, dg = -1.5 * f / at, -2.5 * g / at
    beyond = square - at
    return f + df * beyond, g + dg * beyond, df, dg


@compiled
def interact(
    place: Array,
    moment: Array,
    induced: Array,
    radius: Array,
    there: Array,
    uniform: Array,
    reach: float,
    field: Array,
    force: Array,
    torque: Array,
) -> None:
    """Forces and torques between all dipoles that are there.

    Args:
        place: (D, 3) [m].
        moment: (D, 3) [A m^2] permanent; those that fields induce are added.
        induced: (D,) [A m^2/T] polarisability.
        radius: (D,) [m].
        there: (D,) bool.
        uniform: (3,) [T].
        reach: [m] beyond which two do not act.
        field: (D, 3) [T] at each, of the others and the uniform one; changed.
        force: (D, 3) [N] at their places; changed.
        torque: (D, 3) [N m] of the fields on the moments; changed.
    """
    count = place.shape[0]
    own = moment.copy()
    for _sweep in range(SWEEPS):
        moved, size = 0.0, 0.0
        for i in range(count):
            for axis in range(3):
                field[i, axis] = uniform[axis]
            for j in range(count):
                if j != i and there[i] and there[j]:
                    _add_field(place, moment, radius, reach, i, j, field)
            if there[i] and induced[i] > 0.0:
                for axis in range(3):
                    value = own[i, axis] + induced[i] * field[i, axis]
                    moved = max(moved, abs(value - moment[i, axis]))
                    size = max(size, abs(value))
                    moment[i, axis] = value
        if moved <= 1e-15 * size:
            break
    for i in range(count):
        if not there[i]:
            continue
        _add_cross(moment[i], uniform, torque[i])
        for j in range(i):
            if there[j]:
                _add_pair(place, moment, radius, reach, i, j, force, torque)


@compiled
def _add_field(place: Array, moment: Array, radius: Array, reach: float, i: int, j: int, field: Array) -> None:
    x, y, z = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1], place[i, 2] - place[j, 2]
    square = x * x + y * y + z * z
    if square > reach * reach:
        return
    f, g, _, _ = falloff(square, radius[i] + radius[j])
    along = 3.0 * g * (moment[j, 0] * x + moment[j, 1] * y + moment[j, 2] * z)
    field[i, 0] += K * (along * x - f * moment[j, 0])
    field[i, 1] += K * (along * y - f * moment[j, 1])
    field[i, 2] += K * (along * z - f * moment[j, 2])


@compiled
def _add_pair(
    place: Array, moment: Array, radius: Array, reach: float, i: int, j: int, force: Array, torque: Array
) -> None:
    x, y, z = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1], place[i, 2] - place[j, 2]
    square = x * x + y * y + z * z
    if square > reach * reach:
        return
    f, g, df, dg = falloff(square, radius[i] + radius[j])
    a, b = moment[i], moment[j]
    both = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    on_a, on_b = a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z
    radial = -2.0 * df * both + 6.0 * dg * on_a * on_b
    r = (x, y, z)
    for axis in range(3):
        pull = K * (radial * r[axis] + 3.0 * g * (a[axis] * on_b + b[axis] * on_a))
        force[i, axis] += pull
        force[j, axis] -= pull
    # a x B of b at a, and the other way: both from the same numbers, so that what they differ by is r x F
    for one, other, on_other, row in ((a, b, on_b, i), (b, a, on_a, j)):
        h = 3.0 * K * g * on_other
        torque[row, 0] += h * (one[1] * z - one[2] * y) - K * f * (one[1] * other[2] - one[2] * other[1])
        torque[row, 1] += h * (one[2] * x - one[0] * z) - K * f * (one[2] * other[0] - one[0] * other[2])
        torque[row, 2] += h * (one[0] * y - one[1] * x) - K * f * (one[0] * other[1] - one[1] * other[0])


@compiled
def _add_cross(a: Array, b: Array, out: Array) -> None:
    out[0] += a[1] * b[2] - a[2] * b[1]
    out[1] += a[2] * b[0] - a[0] * b[2]
    out[2] += a[0] * b[1] - a[1] * b[0]
