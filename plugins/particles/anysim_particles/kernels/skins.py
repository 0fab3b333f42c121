"""The nearest point of a closed skin of triangles to a particle; its corners are bodies without a size.

A face is nearest with its inside, an edge or a corner. What is beyond the nearest face's plane is within: so it is
where the skin is as smooth as a balloon is.
"""

import math

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled


@compiled
def nearest_on(
    a: Array, b: Array, c: Array, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float]:
    """The squared distance of a triangle from a point, from where on it to the point (3), and the corners' weights.

    After Ericson, Real-Time Collision Detection (2005), 5.1.5.
    """
    e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    f0, f1, f2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = x - a[0], y - a[1], z - a[2]
    ee, ef, ff = e0 * e0 + e1 * e1 + e2 * e2, e0 * f0 + e1 * f1 + e2 * f2, f0 * f0 + f1 * f1 + f2 * f2
    d1, d2 = e0 * x + e1 * y + e2 * z, f0 * x + f1 * y + f2 * z
    d3, d4, d5, d6 = d1 - ee, d2 - ef, d1 - ef, d2 - ff
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    s, t = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        s = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        t = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s = 1.0 - t
    elif va + vb + vc != 0.0:  # it is, of a triangle without an area
        s, t = vb / (va + vb + vc), vc / (va + vb + vc)
    u, v, w = x - s * e0 - t * f0, y - s * e1 - t * f1, z - s * e2 - t * f2
    return u * u + v * v + w * w, u, v, w, 1.0 - s - t, s, t


@compiled
def nearest_on_skin(
    at: Array, face: Array, first: int, last: int, x: float, y: float, z: float, reach: float
) -> tuple[int, float, float, float, float]:
    """The corner that a point is nearest to by the nearest of some faces, the signed distance, and the way outward.

    -1 for the corner where nothing is within `reach` [m].
    """
    best, corner, gap, n0, n1, n2 = reach * reach, -1, 0.0, 0.0, 0.0, 0.0
    for f in range(first, last):
        i, j, k = face[f, 0], face[f, 1], face[f, 2]
        a, b, c = at[i], at[j], at[k]
        if abs(x - a[0]) > reach + abs(b[0] - a[0]) + abs(c[0] - a[0]):
            continue
        if abs(y - a[1]) > reach + abs(b[1] - a[1]) + abs(c[1] - a[1]):
            continue
        if abs(z - a[2]) > reach + abs(b[2] - a[2]) + abs(c[2] - a[2]):
            continue
        square, u, v, w, p, q, r = nearest_on(a, b, c, x, y, z)
        if not square < best:
            continue
        best = square
        corner = i if p >= q and p >= r else (j if q >= r else k)
        e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        f0, f1, f2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        m0, m1, m2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
        outside = m0 * u + m1 * v + m2 * w >= 0.0
        d = math.sqrt(square)
        if d > 1e-9:
            sign = 1.0 if outside else -1.0
            gap, n0, n1, n2 = sign * d, sign * u / d, sign * v / d, sign * w / d
        else:
            d = math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
            gap, n0, n1, n2 = 0.0, m0 / d, m1 / d, m2 / d
    return corner, gap, n0, n1, n2
