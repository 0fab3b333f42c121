"""Account of momentum in a step of the solver, and rows of its contacts: what is worked out around it, compiled."""

import math
from typing import NamedTuple

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled


class Exchange(NamedTuple):
    """What a step of a solver did, filled by `account`.

    Attributes:
        impulse: (K, 6) [N s, N m s] on the bodies about their centres of mass, added up over steps.
        received: (6,) what the flex got from weight, air and what is fixed, about the world's origin, added up.
    """

    impulse: Array
    received: Array


def _account(
    force: Array,
    at: Array,
    centre: Array,
    turn: Array,
    bodies: Array,
    twists: Array,
    points: Array,
    dofs: Array,
    outer: Array,
    h: float,
    pinned: bool,
    exchange: Exchange,
) -> None:
    """Add what one step of `h` [s] did.

    Args:
        force: (nv,) of the constraints.
        at, centre: (B, 3) [m] frames and centres of mass of MuJoCo's bodies.
        turn: (B, 9) their rotation matrices.
        bodies, twists: (K,) and (K, 6) numbers of the proxies' bodies and of their degrees of freedom.
        points, dofs: (M,) and (M, 3) the same of the points that move.
        outer: (M, 3) [N] weight and air on these.
        h: [s] the step.
        pinned: what is fixed acts on points in ways that `force` does not tell: what points got is left out.
        exchange: what is added to.
    """
    total = exchange.received
    for k in range(bodies.shape[0]):
        b = bodies[k]
        fx, fy, fz = force[twists[k, 0]], force[twists[k, 1]], force[twists[k, 2]]
        lx, ly, lz = force[twists[k, 3]], force[twists[k, 4]], force[twists[k, 5]]
        ax, ay, az = centre[b, 0] - at[b, 0], centre[b, 1] - at[b, 1], centre[b, 2] - at[b, 2]
        px, py, pz = h * fx, h * fy, h * fz
        qx = h * (turn[b, 0] * lx + turn[b, 1] * ly + turn[b, 2] * lz - (ay * fz - az * fy))
        qy = h * (turn[b, 3] * lx + turn[b, 4] * ly + turn[b, 5] * lz - (az * fx - ax * fz))
        qz = h * (turn[b, 6] * lx + turn[b, 7] * ly + turn[b, 8] * lz - (ax * fy - ay * fx))
        for axis, value in enumerate((px, py, pz, qx, qy, qz)):
            exchange.impulse[k, axis] += value
        cx, cy, cz = centre[b, 0], centre[b, 1], centre[b, 2]
        moments = (qx + cy * pz - cz * py, qy + cz * px - cx * pz, qz + cx * py - cy * px)
        for axis, value in enumerate((px, py, pz, *moments)):
            total[axis] += value
    if pinned:
        return
    for m in range(points.shape[0]):
        b = points[m]
        fx = h * (force[dofs[m, 0]] + outer[m, 0])
        fy = h * (force[dofs[m, 1]] + outer[m, 1])
        fz = h * (force[dofs[m, 2]] + outer[m, 2])
        x, y, z = at[b, 0], at[b, 1], at[b, 2]
        for axis, value in enumerate((fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx)):
            total[axis] += value


def _even_rows(rows: Array, counts: Array, begins: Array, columns: Array, entries: Array, axis: Array) -> None:
    """Scale rows of a Jacobian so that the flex is pushed as much as what touches it.

    Args:
        rows: (R,) the rows.
        counts, begins: (all rows,) how many entries they have, and where the first is; empty where all are written.
        columns: (entries,) of each entry; empty where all are written.
        entries: the Jacobian, flat.
        axis: (nv,) along which a degree of freedom of the flex moves a point, -1 of others.
    """
    width = axis.shape[0]
    sparse = counts.shape[0] > 0
    for place in range(rows.shape[0]):
        row = rows[place]
        first = begins[row] if sparse else row * width
        count = counts[row] if sparse else width
        x = y = z = 0.0
        for entry in range(first, first + count):
            along = axis[columns[entry] if sparse else entry - first]
            if along == 0:
                x += entries[entry]
            elif along == 1:
                y += entries[entry]
            elif along == 2:
                z += entries[entry]
        size = math.sqrt(x * x + y * y + z * z)
        if size > 0.0:
            for entry in range(first, first + count):
                if axis[columns[entry] if sparse else entry - first] >= 0:
                    entries[entry] /= size


account, even_rows = compiled(_account), compiled(_even_rows)
