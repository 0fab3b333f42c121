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
    gap_now,
    no_contacts,
    push,
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
    still = b.com.shape[0] - 1
    p, near = np.empty((n, 3)), no_contacts(n)
    pairs, towards = np.empty((24 * n + 64, 2), dtype=np.int32), np.empty((1, 3))
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
        if towards.shape[0] < count:
            towards = np.empty((pairs.shape[0], 3))
        some = near.begin[n]
        shares, slopes = np.empty(some), np.empty(some)
        for _ in range(iterations):
            for i in range(n):
                density[i], square[i] = 1.0, 0.0
                along[i, 0] = along[i, 1] = along[i, 2] = 0.0
            for q in range(count):
                i, j = pairs[q, 0], pairs[q, 1]
                e, f, g = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
                d2 = e * e + f * f + g * g
                u = d2 / (reach * reach)
                if u >= 1.0:
                    towards[q, 0] = towards[q, 1] = towards[q, 2] = 0.0
                    continue
                kernel = (1.0 - u) ** 3
                density[i] += kernel
                density[j] += kernel
                d = math.sqrt(d2)
                if d < 1e-9:
                    e, f, g, d = 0.0, 0.0, 1e-9, 1e-9
                slope = -steep * (1.0 - d / reach) ** 2
                a = slope / d
                e, f, g = a * e, a * f, a * g
                towards[q, 0], towards[q, 1], towards[q, 2] = e, f, g
                square[i] += slope * slope
                square[j] += slope * slope
                along[i, 0] += e
                along[i, 1] += f
                along[i, 2] += g
                along[j, 0] -= e
                along[j, 1] -= f
                along[j, 2] -= g
            for i in range(n):
                full, rest = density[i] / LATTICE, 0.0
                for c in range(near.begin[i], near.begin[i + 1]):
                    gap = gap_now(b, near, c, p[i, 0], p[i, 1], p[i, 2], h)
                    shares[c], slopes[c] = beyond(gap, reach)
                    full += near.share[c] * shares[c]
                    m = near.normal[c]
                    s = near.share[c] * slopes[c]
                    slopes[c] = s
                    for k in range(3):
                        along[i, k] += s * m[k]
                    give = mass * yields(b, near.slot[c], p[i, 0], p[i, 1], p[i, 2], m[0], m[1], m[2])
                    rest += s * s * give
                total = square[i] + rest + along[i, 0] ** 2 + along[i, 1] ** 2 + along[i, 2] ** 2
                density[i] = -max(full - 1.0, 0.0) / (total + soft)  # from here on the multiplier
            for q in range(count):
                i, j = pairs[q, 0], pairs[q, 1]
                both = density[i] + density[j]
                if both == 0.0:
                    continue
                for k in range(3):
                    move = both * towards[q, k]
                    p[i, k] += move
                    p[j, k] -= move
            for i in range(n):
                for c in range(near.begin[i], near.begin[i + 1]):
                    move = density[i] * slopes[c]
                    m, k = near.normal[c], near.slot[c]
                    p[i, 0] += move * m[0]
                    p[i, 1] += move * m[1]
                    p[i, 2] += move * m[2]
                    gap = gap_now(b, near, c, p[i, 0], p[i, 1], p[i, 2], h)
                    if gap < CLOSEST * spacing:
                        inverse = mass * yields(b, k, p[i, 0], p[i, 1], p[i, 2], m[0], m[1], m[2])
                        more = (CLOSEST * spacing - gap) / (1.0 + inverse)
                        p[i, 0] += more * m[0]
                        p[i, 1] += more * m[1]
                        p[i, 2] += more * m[2]
                        move += more
                    if move != 0.0:
                        j = -mass * move / h
                        push(b, k, x[i, 0], x[i, 1], x[i, 2], j * m[0], j * m[1], j * m[2])
        for i in range(n):
            for k in range(3):
                v[i, k] = (p[i, k] - x[i, k]) / h
        # velocities of neighbours come nearer to each other; what is between two is the same for both
        for i in range(n):
            along[i, 0] = along[i, 1] = along[i, 2] = 0.0
        for q in range(count):
            i, j = pairs[q, 0], pairs[q, 1]
            e, f, g = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
            u = (e * e + f * f + g * g) / (reach * reach)
            if u >= 1.0:
                continue
            a = smoothing * (1.0 - u) ** 3 / LATTICE
            for k in range(3):
                change = a * (v[j, k] - v[i, k])
                along[i, k] += change
                along[j, k] -= change
        for i in range(n):
            for k in range(3):
                v[i, k] += along[i, k]
            if drag > 0.0:
                for c in range(near.begin[i], near.begin[i + 1]):
                    gap = gap_now(b, near, c, p[i, 0], p[i, 1], p[i, 2], h)
                    if gap > spacing:
                        continue
                    k, m = near.slot[c], near.normal[c]
                    d0, d1, d2 = speed_at(b.twist[k], b.com[k], x[i, 0], x[i, 1], x[i, 2])
                    d0, d1, d2 = v[i, 0] - d0, v[i, 1] - d1, v[i, 2] - d2
                    a = d0 * m[0] + d1 * m[1] + d2 * m[2]
                    d0, d1, d2 = d0 - a * m[0], d1 - a * m[1], d2 - a * m[2]
                    a = drag * near.share[c] / (1.0 + mass * b.light[k])
                    v[i, 0] -= a * d0
                    v[i, 1] -= a * d1
                    v[i, 2] -= a * d2
                    a *= mass
                    push(b, k, x[i, 0], x[i, 1], x[i, 2], a * d0, a * d1, a * d2)
        for i in range(n):
            for k in range(3):
                x[i, k] = p[i, k]
    for k in range(6):
        received[k] -= b.impulse[still, k]
    put_back(x_, order, x)
    put_back(v_, order, v)
