"""Grains: hard balls, or rows of them that are rigid, with friction; position-based, pair after pair.

After Macklin et al. (Unified Particle Physics, 2014), but solved by Gauss-Seidel iterations with what each contact has
been given so far, so that pairs stay symmetric and friction is bounded by the load. What overlaps is pushed apart no
faster than `slow` [m/s]: no energy comes of a packing that is too dense.
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


@compiled
def _fastest(v: Array, n: int) -> float:
    most = 0.0
    for i in range(n):
        most = max(most, v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2)
    return math.sqrt(most)


@compiled
def grain_step(
    x_: Array,
    v_: Array,
    n: int,
    beads: int,
    geoms: Geoms,
    triangles: Triangles,
    b: Proxies,
    received: Array,
    gravity: Array,
    dt: float,
    substeps: int,
    iterations: int,
    radius: float,
    mass: float,
    apart: float,
    friction: float,
    slow: float,
) -> None:
    """Move n balls of a `mass` [kg] and `radius` [m] on by `dt` [s]; each `beads` of them in a row are a grain.

    Args:
        x_, v_: (n or more, 3) [m], [m/s], changed.
        n: how many balls there are.
        beads: of a grain.
        geoms, triangles, b: what they meet, bodies without skins of other matter; `b.impulse` is added to.
        received: (6,) momentum from weight and from what is fixed, added to.
        gravity: (3,) [m/s^2].
        dt: [s].
        substeps, iterations: of each substep.
        radius: of a ball.
        mass: of a ball.
        apart: [m] from one bead of a grain to the next.
        friction: coefficient between grains; with bodies the larger of it and theirs.
        slow: [m/s] at which what overlaps comes apart.
    """
    grains = n // beads
    first = np.empty((grains, 3))
    for a in range(grains):
        for k in range(3):
            first[a, k] = x_[a * beads, k]
    by_grain = sorted_by_cell(first, grains, 4 * radius)
    order = np.empty(n, dtype=np.int64)
    for a in range(grains):
        for k in range(beads):
            order[a * beads + k] = by_grain[a] * beads + k
    x, v = in_order(x_, order), in_order(v_, order)
    h, light, impulse, com = dt / substeps, b.light, b.impulse, b.com
    still = b.com.shape[0] - 1
    p, near = in_order(x_, order), no_contacts(n)
    pairs, count = np.empty((8 * n + 64, 2), dtype=np.int32), 0
    load, touched, rubbed, dragged = np.empty(1), np.empty(1), np.empty(1), np.empty(1)
    skin, used = 0.0, np.inf
    for _ in range(substeps):
        expect(b, gravity, h)
        for i in range(n):
            for k in range(3):
                v[i, k] += gravity[k] * h
                p[i, k] = x[i, k] + v[i, k] * h
        weigh(x, n, mass * h, gravity, received)
        far = 2.2 * _fastest(v, n) * h
        used += far
        if used > skin:  # the list is of where they were; what is not in it has not come near since
            skin = min(far * substeps, max(far, radius))
            used = far
            pairs, count = near_pairs(p, n, 2 * radius + 2 * skin, pairs)
        near = find_contacts(p, n, radius + far, geoms, triangles, b, near)
        begin, slot, normal, offset = near.begin, near.slot, near.normal, near.offset
        some = begin[n]
        if touched.shape[0] < some:
            touched, dragged = np.empty(2 * some), np.empty(2 * some)
        if load.shape[0] < count:
            load, rubbed = np.empty(pairs.shape[0]), np.empty(pairs.shape[0])
        for q in range(count):
            load[q] = rubbed[q] = 0.0
        for c in range(some):
            touched[c] = dragged[c] = 0.0
        for _ in range(iterations):
            for q in range(count):
                i, j = pairs[q, 0], pairs[q, 1]
                if beads > 1 and i // beads == j // beads:
                    continue
                e, f, g = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
                d2 = e * e + f * f + g * g
                if d2 >= 4 * radius * radius:
                    continue
                d = math.sqrt(d2)
                if d < 1e-9:
                    e, f, g, d = 0.0, 0.0, 1.0, 1.0
                    depth = 2 * radius
                else:
                    depth = 2 * radius - d
                n0, n1, n2 = e / d, f / d, g / d
                u = (p[i, 0] - x[i, 0]) - (p[j, 0] - x[j, 0])
                w = (p[i, 1] - x[i, 1]) - (p[j, 1] - x[j, 1])
                z = (p[i, 2] - x[i, 2]) - (p[j, 2] - x[j, 2])
                parting = u * n0 + w * n1 + z * n2
                move = min(depth, max(0.0, slow * h - parting))
                load[q] += move
                u, w, z = u - parting * n0, w - parting * n1, z - parting * n2
                slide = math.sqrt(u * u + w * w + z * z)
                back = 0.0
                if slide > 0.0:
                    rub = min(slide, max(0.0, friction * load[q] - rubbed[q]))
                    rubbed[q] += rub
                    back = rub / slide
                m0, m1, m2 = 0.5 * (move * n0 - back * u), 0.5 * (move * n1 - back * w), 0.5 * (move * n2 - back * z)
                p[i, 0] += m0
                p[i, 1] += m1
                p[i, 2] += m2
                p[j, 0] -= m0
                p[j, 1] -= m1
                p[j, 2] -= m2
            for i in range(n):
                for c in range(begin[i], begin[i + 1]):
                    k, n0, n1, n2 = slot[c], normal[c, 0], normal[c, 1], normal[c, 2]
                    gap = offset[c] + n0 * p[i, 0] + n1 * p[i, 1] + n2 * p[i, 2]
                    if light[k] > 0.0:
                        gap -= h * receded(b, k, n0, n1, n2, p[i, 0], p[i, 1], p[i, 2])
                    depth = radius - gap
                    if depth <= 0.0:
                        continue
                    s0, s1, s2, give = 0.0, 0.0, 0.0, 0.0
                    if k != still:
                        s0, s1, s2 = speed_at(b.twist, b.com, k, x[i, 0], x[i, 1], x[i, 2])
                    u, w, z = p[i, 0] - x[i, 0] - s0 * h, p[i, 1] - x[i, 1] - s1 * h, p[i, 2] - x[i, 2] - s2 * h
                    parting = u * n0 + w * n1 + z * n2
                    if light[k] > 0.0:
                        give = mass * yields(b, k, x[i, 0], x[i, 1], x[i, 2], n0, n1, n2)
                    move = min(depth, max(0.0, slow * h - parting)) / (1.0 + give)
                    touched[c] += move
                    u, w, z = u - parting * n0, w - parting * n1, z - parting * n2
                    slide = math.sqrt(u * u + w * w + z * z)
                    back = 0.0
                    if slide > 0.0:
                        if light[k] > 0.0:
                            give = mass * yields(b, k, x[i, 0], x[i, 1], x[i, 2], u / slide, w / slide, z / slide)
                        left = max(friction, near.friction[c]) * touched[c] - dragged[c]
                        rub = min(slide / (1.0 + give), max(0.0, left))
                        dragged[c] += rub
                        back = rub / slide
                    m0, m1, m2 = move * n0 - back * u, move * n1 - back * w, move * n2 - back * z
                    p[i, 0] += m0
                    p[i, 1] += m1
                    p[i, 2] += m2
                    a = -mass / h
                    push(impulse, com, k, x[i, 0], x[i, 1], x[i, 2], a * m0, a * m1, a * m2)
                    if light[k] > 0.0:
                        hasten(b, k, x[i, 0], x[i, 1], x[i, 2], a * m0, a * m1, a * m2)
            if beads > 1:
                _hold(p, grains, beads, apart)
        for i in range(n):
            for k in range(3):
                v[i, k] = (p[i, k] - x[i, k]) / h
                x[i, k] = p[i, k]
    for k in range(6):
        received[k] -= b.impulse[still, k]
    put_back(x_, order, x)
    put_back(v_, order, v)


@compiled
def _hold(p: Array, grains: int, beads: int, apart: float) -> None:
    """Keep the beads of each grain in a row: every pair of them at its distance."""
    for a in range(grains):
        for one in range(beads - 1):
            for two in range(one + 1, beads):
                i, j = a * beads + one, a * beads + two
                e, f, g = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
                d = math.sqrt(e * e + f * f + g * g)
                if d < 1e-12:
                    continue
                s = 0.5 * ((two - one) * apart - d) / d
                p[i, 0] += s * e
                p[i, 1] += s * f
                p[i, 2] += s * g
                p[j, 0] -= s * e
                p[j, 1] -= s * f
                p[j, 2] -= s * g
