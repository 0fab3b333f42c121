"""Account of momentum in a step of the solver, places of proxies, forces on points, rows of contacts: all compiled."""

import math
from typing import NamedTuple

import numpy as np

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


def _meet(
    pose: Array, twist: Array, there: Array, away: float, places: Array, rates: Array, position: Array, velocity: Array
) -> None:
    """Put proxies where their bodies are.

    Args:
        pose, twist: (K, 7) and (K, 6) of the bodies' frames.
        there: (K + ...,) bool; what is not there goes to the height `away` [m].
        places, rates: (K, 7) and (K, 6) the coordinates and degrees of freedom of the proxies.
        position, velocity: of all coordinates, and of all degrees of freedom, written.
    """
    for k in range(pose.shape[0]):
        x, y, z, w = pose[k, 3], pose[k, 4], pose[k, 5], pose[k, 6]
        a, b, c = twist[k, 3], twist[k, 4], twist[k, 5]
        # turned by the inverse: v + 2 (w (v x u) + u x (u x v)), u the vector of the quaternion
        p, q, r = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
        spin = (a + w * p + (q * z - r * y), b + w * q + (r * x - p * z), c + w * r + (p * y - q * x))
        for axis in range(3):
            position[places[k, axis]] = pose[k, axis]
            velocity[rates[k, axis]] = twist[k, axis]
        for axis, value in enumerate(spin):
            velocity[rates[k, 3 + axis]] = value
        for axis, value in enumerate((w, x, y, z)):
            position[places[k, 3 + axis]] = value
        if not there[k]:
            position[places[k, 2]] = away


def _load(
    velocity: Array, mass: Array, dofs: Array, gravity: Array, slower: float, inner: Array, applied: Array, outer: Array
) -> None:
    """Write the forces (M, 3) [N] on points: `applied` from air and each other, `outer` from weight and air.

    Args:
        velocity: (nv,) of all degrees of freedom.
        mass, dofs: (M,) [kg] and (M, 3) of the points that move.
        gravity: (3,) [m/s^2].
        slower: [1/s] air.
        inner: (M, 3) [N] what they do to each other.
        applied: (nv,) written at the degrees of freedom.
        outer: (M, 3) written.
    """
    for m in range(mass.shape[0]):
        for axis in range(3):
            air = -slower * mass[m] * velocity[dofs[m, axis]]
            applied[dofs[m, axis]] = air + inner[m, axis]
            outer[m, axis] = mass[m] * gravity[axis] + air


def _momentum(mass: Array, velocity: Array, dofs: Array, points: Array, at: Array) -> Array:
    """(6,) [N s, N m s] about the world's origin; the arguments are those of `load` and `account`."""
    total = np.zeros(6)
    for m in range(mass.shape[0]):
        px, py, pz = (mass[m] * velocity[dofs[m, 0]], mass[m] * velocity[dofs[m, 1]], mass[m] * velocity[dofs[m, 2]])
        x, y, z = at[points[m], 0], at[points[m], 1], at[points[m], 2]
        for axis, value in enumerate((px, py, pz, y * pz - z * py, z * px - x * pz, x * py - y * px)):
            total[axis] += value
    return total


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


def _even_rows(
    kinds: Array, kind: int, counts: Array, begins: Array, columns: Array, entries: Array, axis: Array
) -> bool:
    """Scale rows of a Jacobian so that the flex is pushed as much as what touches it; returns whether there are any.

    Args:
        kinds, kind: (R,) of all rows, and that of those that are scaled.
        counts, begins: (R,) how many entries they have, and where the first is; empty where all are written.
        columns: (entries,) of each entry; empty where all are written.
        entries: the Jacobian, flat.
        axis: (nv,) along which a degree of freedom of the flex moves a point, -1 of others.
    """
    width = axis.shape[0]
    sparse = counts.shape[0] > 0
    found = False
    for row in range(kinds.shape[0]):
        if kinds[row] != kind:
            continue
        found = True
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
    return found


account, even_rows = compiled(_account), compiled(_even_rows)
load, meet, momentum = compiled(_load), compiled(_meet), compiled(_momentum)
