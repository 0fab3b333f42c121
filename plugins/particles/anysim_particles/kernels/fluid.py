"""Position-based fluid: particles that keep their density, beside surfaces as beside more of the fluid.

After Macklin and Mueller (Position Based Fluids, 2013): a constraint of density for each particle, solved by Jacobi
iterations whose corrections of pairs are equal and opposite. What is beyond a surface counts as a half space of fluid,
whose share of a kernel has a formula; so particles stay half their spacing away, and surfaces feel their pressure. So
do skins of other matter, point by point.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled
from anysim_particles.kernels.contacts import (
    Proxies,
    expect,
    find_contacts,
    hasten,
    no_contacts,
    push,
    receded,
    speed_at,
    weigh,
    yields,
)
from anysim_particles.kernels.pairs import in_order, near_pairs, put_back, sorted_by_cell
from anysim_sensors.tables import Geoms, Triangles

REACH = 2.0
"""Radius of the kernel, in spacings."""
LATTICE = 1.0 + 6 * (3 / 4) ** 3 + 12 * (1 / 2) ** 3 + 8 * (1 / 4) ** 3
"""Sum of the kernel over a cubic lattice of that spacing, itself with it."""
STEEP = 45.0 / (8.0 * math.pi)
"""Of the kernel that gradients are of, one spacing cubed of it, per 1 / reach."""
SOFT = 0.02
"""Of a constraint, in units of what its gradients sum up to in a lattice."""
CLOSEST = 0.25
"""Of a spacing: no nearer to a surface is a particle let, whatever the density says."""


@compiled
def beyond(gap: float, reach: float) -> tuple[float, float]:
    """The share of a kernel that is beyond a plane at a distance, and its derivative [1/m]."""
    u = min(max(gap / reach, -1.0), 1.0)
    t = u * u
    whole = 128.0 / 315.0
    below = u * (1.0 - t * (4.0 / 3.0 - t * (6.0 / 5.0 - t * (4.0 / 7.0 - t / 9.0))))
    return 315.0 / 256.0 * (whole - below), -315.0 / 256.0 / reach * (1.0 - t) ** 4


@compiled
def differences(p: Array, pairs: Array, count: int, x: Array, y: Array, z: Array) -> None:
    """From the second of each pair to the first [m], into arrays by component."""
    for q in range(count):
        i, j = pairs[q, 0], pairs[q, 1]
        x[q] = p[i, 0] - p[j, 0]
        y[q] = p[i, 1] - p[j, 1]
        z[q] = p[i, 2] - p[j, 2]


@compiled
def pulls(x: Array, y: Array, z: Array, kernel: Array, count: int, reach: float, steep: float) -> None:
    """Differences of pairs [m] become gradients of the kernel [1/m]; its values are written too.

    Four arrays and no branch: so the compiler takes several pairs at once, and what comes out is the same.
    """
    for q in range(count):
        e, f, g = x[q], y[q], z[q]
        d2 = e * e + f * f + g * g
        u = max(1.0 - d2 / (reach * reach), 0.0)
        kernel[q] = u * u * u
        g = 1e-9 if d2 < 1e-18 else g  # who is in one place goes apart
        d = max(math.sqrt(d2), 1e-9)
        near = max(1.0 - d / reach, 0.0)
        a = -steep * near * near / d
        x[q], y[q], z[q] = a * e, a * f, a * g


@compiled
def fluid_step(
    x_: Array,
    v_: Array,
    n: int,
    geoms: Geoms,
    triangles: Triangles,
    b: Proxies,
    received: Array,
    gravity: Array,
    dt: float,
    substeps: int,
    iterations: int,
    spacing: float,
    mass: float,
    smoothing: float,
    drag: float,
) -> None:
    """Move n particles of a `mass` [kg] on by `dt` [s].

    Args:
        x_, v_: (n or more, 3) [m], [m/s], changed.
        n: how many there are.
        geoms, triangles, b: what they meet; `b.impulse` is added to.
        received: (6,) momentum from weight and from what is fixed, added to.
        gravity: (3,) [m/s^2].
        dt: [s].
        substeps, iterations: of each substep.
        spacing: [m] at rest.
        mass: of one.
        smoothing: share of the difference of velocities to neighbours that goes in a substep.
        drag: share of the velocity along a surface that goes in a substep.
    """
    order = sorted_by_cell(x_, n, REACH * spacing)
    x, v = in_order(x_, order), in_order(v_, order)
    h, reach = dt / substeps, REACH * spacing
    light, impulse, com = b.light, b.impulse, b.com
    still = b.com.shape[0] - 1
    p, near = np.empty((n, 3)), no_contacts(n)
    pairs = np.empty((24 * n + 64, 2), dtype=np.int32)
    to_x, to_y, to_z, kernel = np.empty(0), np.empty(0), np.empty(0), np.empty(0)
    density, square, along = np.empty(n), np.empty(n), np.empty((n, 3))
    steep = STEEP / reach
    soft = SOFT * 6 * (steep / 4) ** 2
    for _ in range(substeps):
        expect(b, gravity, h)
        for i in range(n):
            for c in range(3):
                v[i, c] += gravity[c] * h
                p[i, c] = x[i, c] + v[i, c] * h
        weigh(x, n, mass * h, gravity, received)
        pairs, count = near_pairs(p, n, reach, pairs)
        near = find_contacts(p, n, reach, geoms, triangles, b, near)
        if kernel.shape[0] < count:
            size = pairs.shape[0]
            to_x, to_y, to_z, kernel = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
        begin, slot, normal, offset, share = near.begin, near.slot, near.normal, near.offset, near.share
        slopes = np.empty(begin[n])
        for _ in range(iterations):
            differences(p, pairs, count, to_x, to_y, to_z)
            pulls(to_x, to_y, to_z, kernel, count, reach, steep)
            for i in range(n):
                density[i], square[i] = 1.0, 0.0
                along[i, 0] = along[i, 1] = along[i, 2] = 0.0
            for q in range(count):
                i, j = pairs[q, 0], pairs[q, 1]
                e, f, g = to_x[q], to_y[q], to_z[q]
                both = e * e + f * f + g * g
                density[i] += kernel[q]
                density[j] += kernel[q]
                square[i] += both
                square[j] += both
                along[i, 0] += e
                along[i, 1] += f
                along[i, 2] += g
                along[j, 0] -= e
                along[j, 1] -= f
                along[j, 2] -= g
            for i in range(n):
                full, rest = density[i] / LATTICE, 0.0
                for c in range(begin[i], begin[i + 1]):
                    k, n0, n1, n2 = slot[c], normal[c, 0], normal[c, 1], normal[c, 2]
                    gap = offset[c] + n0 * p[i, 0] + n1 * p[i, 1] + n2 * p[i, 2]
                    if light[k] > 0.0:
                        gap -= h * receded(b, k, n0, n1, n2, p[i, 0], p[i, 1], p[i, 2])
                    filled, s = beyond(gap, reach)
                    full += share[c] * filled
                    s *= share[c]
                    slopes[c] = s
                    along[i, 0] += s * n0
                    along[i, 1] += s * n1
                    along[i, 2] += s * n2
                    if light[k] > 0.0:
                        rest += s * s * mass * yields(b, k, p[i, 0], p[i, 1], p[i, 2], n0, n1, n2)
                total = square[i] + rest + along[i, 0] ** 2 + along[i, 1] ** 2 + along[i, 2] ** 2
                density[i] = -max(full - 1.0, 0.0) / (total + soft)  # from here on the multiplier
            for q in range(count):
                i, j = pairs[q, 0], pairs[q, 1]
                both = density[i] + density[j]
                e, f, g = both * to_x[q], both * to_y[q], both * to_z[q]
                p[i, 0] += e
                p[i, 1] += f
                p[i, 2] += g
                p[j, 0] -= e
                p[j, 1] -= f
                p[j, 2] -= g
            for i in range(n):
                for c in range(begin[i], begin[i + 1]):
                    move = density[i] * slopes[c]
                    k, n0, n1, n2 = slot[c], normal[c, 0], normal[c, 1], normal[c, 2]
                    p[i, 0] += move * n0
                    p[i, 1] += move * n1
                    p[i, 2] += move * n2
                    gap = offset[c] + n0 * p[i, 0] + n1 * p[i, 1] + n2 * p[i, 2]
                    if light[k] > 0.0:
                        gap -= h * receded(b, k, n0, n1, n2, p[i, 0], p[i, 1], p[i, 2])
                    if gap < CLOSEST * spacing:
                        more = CLOSEST * spacing - gap
                        if light[k] > 0.0:
                            more /= 1.0 + mass * yields(b, k, p[i, 0], p[i, 1], p[i, 2], n0, n1, n2)
                        p[i, 0] += more * n0
                        p[i, 1] += more * n1
                        p[i, 2] += more * n2
                        move += more
                    if move != 0.0:
                        j = -mass * move / h
                        push(impulse, com, k, x[i, 0], x[i, 1], x[i, 2], j * n0, j * n1, j * n2)
                        if light[k] > 0.0:
                            hasten(b, k, x[i, 0], x[i, 1], x[i, 2], j * n0, j * n1, j * n2)
        for i in range(n):
            for k in range(3):
                v[i, k] = (p[i, k] - x[i, k]) / h
        # velocities of neighbours come nearer to each other; what is between two is the same for both
        for i in range(n):
            along[i, 0] = along[i, 1] = along[i, 2] = 0.0
        differences(p, pairs, count, to_x, to_y, to_z)
        pulls(to_x, to_y, to_z, kernel, count, reach, steep)
        for q in range(count):
            i, j = pairs[q, 0], pairs[q, 1]
            a = smoothing / LATTICE * kernel[q]
            for k in range(3):
                change = a * (v[j, k] - v[i, k])
                along[i, k] += change
                along[j, k] -= change
        for i in range(n):
            for k in range(3):
                v[i, k] += along[i, k]
            if drag > 0.0:
                for c in range(begin[i], begin[i + 1]):
                    k, n0, n1, n2 = slot[c], normal[c, 0], normal[c, 1], normal[c, 2]
                    gap = offset[c] + n0 * p[i, 0] + n1 * p[i, 1] + n2 * p[i, 2]
                    if light[k] > 0.0:
                        gap -= h * receded(b, k, n0, n1, n2, p[i, 0], p[i, 1], p[i, 2])
                    if gap > spacing:
                        continue
                    d0, d1, d2 = v[i, 0], v[i, 1], v[i, 2]
                    if k != still:
                        s0, s1, s2 = speed_at(b.twist, b.com, k, x[i, 0], x[i, 1], x[i, 2])
                        d0, d1, d2 = d0 - s0, d1 - s1, d2 - s2
                    a = d0 * n0 + d1 * n1 + d2 * n2
                    d0, d1, d2 = d0 - a * n0, d1 - a * n1, d2 - a * n2
                    a = drag * share[c] / (1.0 + mass * light[k])
                    v[i, 0] -= a * d0
                    v[i, 1] -= a * d1
                    v[i, 2] -= a * d2
                    a *= mass
                    push(impulse, com, k, x[i, 0], x[i, 1], x[i, 2], a * d0, a * d1, a * d2)
                    if light[k] > 0.0:
                        hasten(b, k, x[i, 0], x[i, 1], x[i, 2], a * d0, a * d1, a * d2)
        for i in range(n):
            for k in range(3):
                x[i, k] = p[i, k]
    for k in range(6):
        received[k] -= b.impulse[still, k]
    put_back(x_, order, x)
    put_back(v_, order, v)
