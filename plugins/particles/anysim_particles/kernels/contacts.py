"""Contacts of particles with the shapes of bodies, and how bodies move while particles are solved.

A body that joints do not hold has a proxy with its true mass: what particles do to it shows within the step. It starts
from what the engine says, and nothing of it is kept. After the bodies come the points of skins of other matter, which
are bodies without a size. The last row of all arrays by body stands for what is fixed.
"""

import math
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled
from anysim_particles.kernels.skins import nearest_on_skin
from anysim_sensors.kernels.distances import convex, meshed
from anysim_sensors.tables import CYLINDER, Geoms, Triangles


class Proxies(NamedTuple):
    """K bodies, points of skins among them, and, last, what is fixed; `frame`, `low`, `high` are of the G geoms.

    Attributes:
        com: (K + 1, 3) [m] where the centres of mass were when the step began.
        at: (K + 1, 3) [m] where they are expected to be.
        twist: (K + 1, 6) how they move, after what particles did to them.
        expected: (K + 1, 6) how they moved when `at` was worked out.
        weight: (K + 1,) bool, whether it falls.
        light: (K + 1,) inverse masses, 0 for what particles cannot move.
        turns: (K + 1, 3, 3) inverse inertias.
        impulse: (K + 1, 6) what they got so far, about `com`; of what is fixed about the world's origin.
        slot: (G,) int32 the body of each geom.
        frame: (G, 12) rotation matrices by rows and positions.
        low, high: (G, 3) [m] boxes around the geoms.
        there: (G,) bool.
        friction: (G,).
        face: (F, 3) int32 the bodies at the corners of the triangles of all skins, outward.
        skin: (S + 1,) int32 the first face of each skin.
        thick: (S,) [m] of matter around each skin.
    """

    com: Array
    at: Array
    twist: Array
    expected: Array
    weight: Array
    light: Array
    turns: Array
    impulse: Array
    slot: Array
    frame: Array
    low: Array
    high: Array
    there: Array
    friction: Array
    face: Array
    skin: Array
    thick: Array


class Contacts(NamedTuple):
    """C contacts, those of a particle next to each other.

    Attributes:
        begin: (n + 1,) the first contact of each particle.
        slot: (C,) int32 the body.
        gap: (C,) [m] distance of the particle's middle from the surface where it is expected.
        normal: (C, 3) away from the surface.
        offset: (C,) [m] the gap, were the particle at the origin; it grows along the normal.
        friction: (C,) of the surface.
        share: (C,) how much of what is beyond the surface belongs to no nearer surface of about the same direction.
    """

    begin: Array
    slot: Array
    gap: Array
    normal: Array
    offset: Array
    friction: Array
    share: Array


@compiled
def expect(b: Proxies, gravity: Array, h: float) -> None:
    """Let the proxies fall for `h` [s], and move the geoms to where they then are."""
    for k in range(b.com.shape[0] - 1):
        if b.weight[k]:
            for c in range(3):
                b.twist[k, c] += gravity[c] * h
        for c in range(6):
            b.expected[k, c] = b.twist[k, c]
    for g in range(b.slot.shape[0]):
        k = b.slot[g]
        if k == b.com.shape[0] - 1:
            continue
        w0, w1, w2 = b.twist[k, 3] * h, b.twist[k, 4] * h, b.twist[k, 5] * h
        angle = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
        s = math.sin(angle) / angle if angle > 1e-9 else 1.0
        c = (1.0 - math.cos(angle)) / (angle * angle) if angle > 1e-9 else 0.5
        frame = b.frame
        for column in range(4):
            if column < 3:
                x, y, z = frame[g, column], frame[g, 3 + column], frame[g, 6 + column]
            else:
                x, y, z = frame[g, 9] - b.at[k, 0], frame[g, 10] - b.at[k, 1], frame[g, 11] - b.at[k, 2]
            u, v, w = w1 * z - w2 * y, w2 * x - w0 * z, w0 * y - w1 * x
            x += s * u + c * (w1 * w - w2 * v)
            y += s * v + c * (w2 * u - w0 * w)
            z += s * w + c * (w0 * v - w1 * u)
            if column < 3:
                frame[g, column], frame[g, 3 + column], frame[g, 6 + column] = x, y, z
            else:
                frame[g, 9] = x + b.at[k, 0] + b.twist[k, 0] * h
                frame[g, 10] = y + b.at[k, 1] + b.twist[k, 1] * h
                frame[g, 11] = z + b.at[k, 2] + b.twist[k, 2] * h
        for c3 in range(3):
            far = max(abs(b.high[g, c3] - b.at[k, c3]), abs(b.low[g, c3] - b.at[k, c3]))
            away = abs(b.twist[k, c3]) * h + angle * (far + 1.0 * (b.high[g, c3] - b.low[g, c3]))
            b.low[g, c3] -= away
            b.high[g, c3] += away
    for k in range(b.com.shape[0] - 1):
        for c in range(3):
            b.at[k, c] += b.twist[k, c] * h


@compiled
def push(impulse: Array, com: Array, k: int, x: float, y: float, z: float, j0: float, j1: float, j2: float) -> None:
    """Add an impulse on body k at a point of the world to what it got."""
    u, v, w = x - com[k, 0], y - com[k, 1], z - com[k, 2]
    impulse[k, 0] += j0
    impulse[k, 1] += j1
    impulse[k, 2] += j2
    impulse[k, 3] += v * j2 - w * j1
    impulse[k, 4] += w * j0 - u * j2
    impulse[k, 5] += u * j1 - v * j0


@compiled
def hasten(b: Proxies, k: int, x: float, y: float, z: float, j0: float, j1: float, j2: float) -> None:
    """Change how a body that yields moves by an impulse at a point of the world."""
    u, v, w = x - b.com[k, 0], y - b.com[k, 1], z - b.com[k, 2]
    t0, t1, t2 = v * j2 - w * j1, w * j0 - u * j2, u * j1 - v * j0
    m, t = b.light[k], b.turns
    b.twist[k, 0] += m * j0
    b.twist[k, 1] += m * j1
    b.twist[k, 2] += m * j2
    b.twist[k, 3] += t[k, 0, 0] * t0 + t[k, 0, 1] * t1 + t[k, 0, 2] * t2
    b.twist[k, 4] += t[k, 1, 0] * t0 + t[k, 1, 1] * t1 + t[k, 1, 2] * t2
    b.twist[k, 5] += t[k, 2, 0] * t0 + t[k, 2, 1] * t1 + t[k, 2, 2] * t2


@compiled
def yields(b: Proxies, k: int, x: float, y: float, z: float, n0: float, n1: float, n2: float) -> float:
    """How much faster [m/s] a point of a body that yields gets along a unit vector, for 1 N s along it."""
    u, v, w = x - b.com[k, 0], y - b.com[k, 1], z - b.com[k, 2]
    t0, t1, t2 = v * n2 - w * n1, w * n0 - u * n2, u * n1 - v * n0
    t = b.turns
    a = t[k, 0, 0] * t0 + t[k, 0, 1] * t1 + t[k, 0, 2] * t2
    c = t[k, 1, 0] * t0 + t[k, 1, 1] * t1 + t[k, 1, 2] * t2
    d = t[k, 2, 0] * t0 + t[k, 2, 1] * t1 + t[k, 2, 2] * t2
    return b.light[k] + a * t0 + c * t1 + d * t2


@compiled
def speed_at(twist: Array, com: Array, k: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The velocity of a point of body k."""
    u, v, w = x - com[k, 0], y - com[k, 1], z - com[k, 2]
    return (
        twist[k, 0] + twist[k, 4] * w - twist[k, 5] * v,
        twist[k, 1] + twist[k, 5] * u - twist[k, 3] * w,
        twist[k, 2] + twist[k, 3] * v - twist[k, 4] * u,
    )


@compiled
def receded(b: Proxies, k: int, n0: float, n1: float, n2: float, x: float, y: float, z: float) -> float:
    """How much faster [m/s] a point of body k goes along a unit vector than was expected, after what it got since."""
    u, v, w = speed_at(b.twist, b.com, k, x, y, z)
    p, q, r = speed_at(b.expected, b.com, k, x, y, z)
    return n0 * (u - p) + n1 * (v - q) + n2 * (w - r)


@compiled
def _more(c: Contacts) -> Contacts:
    size = c.slot.shape[0]
    slot, normal = np.empty(2 * size, dtype=np.int32), np.empty((2 * size, 3))
    gap, offset, friction, share = np.empty(2 * size), np.empty(2 * size), np.empty(2 * size), np.empty(2 * size)
    for i in range(size):
        slot[i], gap[i], offset[i], friction[i], share[i] = c.slot[i], c.gap[i], c.offset[i], c.friction[i], c.share[i]
        for k in range(3):
            normal[i, k] = c.normal[i, k]
    return Contacts(c.begin, slot, gap, normal, offset, friction, share)


@compiled
def find_contacts(
    p: Array, n: int, reach: float, geoms: Geoms, triangles: Triangles, b: Proxies, contacts: Contacts
) -> Contacts:
    """The surfaces within `reach` [m] of each particle; `contacts` is written, or a larger one made."""
    stack, near = np.empty(128, dtype=np.int32), np.empty(128)
    # geoms that are near to any particle at all
    box = np.empty((2, 3))
    for k in range(3):
        box[0, k], box[1, k] = np.inf, -np.inf
        for i in range(n):
            box[0, k], box[1, k] = min(box[0, k], p[i, k]), max(box[1, k], p[i, k])
    chosen, some = np.empty(b.slot.shape[0], dtype=np.int32), 0
    for g in range(b.slot.shape[0]):
        close = b.there[g]
        for k in range(3):
            close = close and b.low[g, k] - reach <= box[1, k] and b.high[g, k] + reach >= box[0, k]
        if close:
            chosen[some] = g
            some += 1
    around = np.empty((b.thick.shape[0], 2, 3))
    for s_ in range(b.thick.shape[0]):
        for k in range(3):
            around[s_, 0, k], around[s_, 1, k] = np.inf, -np.inf
            for f_ in range(b.skin[s_], b.skin[s_ + 1]):
                for corner in range(3):
                    q = b.at[b.face[f_, corner], k]
                    around[s_, 0, k], around[s_, 1, k] = min(around[s_, 0, k], q), max(around[s_, 1, k], q)
    count = 0
    for i in range(n):
        contacts.begin[i] = count
        x, y, z = p[i, 0], p[i, 1], p[i, 2]
        for which in range(some):
            g = chosen[which]
            if (
                b.low[g, 0] - reach > x
                or b.high[g, 0] + reach < x
                or b.low[g, 1] - reach > y
                or b.high[g, 1] + reach < y
                or b.low[g, 2] - reach > z
                or b.high[g, 2] + reach < z
            ):
                continue
            f = b.frame
            u, v, w = x - f[g, 9], y - f[g, 10], z - f[g, 11]
            u, v, w = (
                f[g, 0] * u + f[g, 3] * v + f[g, 6] * w,
                f[g, 1] * u + f[g, 4] * v + f[g, 7] * w,
                f[g, 2] * u + f[g, 5] * v + f[g, 8] * w,
            )
            if geoms.kind[g] > CYLINDER:
                gap, p0, p1, p2 = meshed(triangles, triangles.root[geoms.mesh[g]], u, v, w, 3 * reach, stack, near)
            else:
                s = geoms.size
                gap, p0, p1, p2 = convex(geoms.kind[g], s[g, 0], s[g, 1], s[g, 2], u, v, w)
            if not gap < reach:
                continue
            if count == contacts.slot.shape[0]:
                contacts = _more(contacts)
            contacts.slot[count], contacts.gap[count], contacts.friction[count] = b.slot[g], gap, b.friction[g]
            contacts.normal[count, 0] = f[g, 0] * p0 + f[g, 1] * p1 + f[g, 2] * p2
            contacts.normal[count, 1] = f[g, 3] * p0 + f[g, 4] * p1 + f[g, 5] * p2
            contacts.normal[count, 2] = f[g, 6] * p0 + f[g, 7] * p1 + f[g, 8] * p2
            count += 1
        for s_ in range(b.thick.shape[0]):
            far = reach + b.thick[s_]
            if (
                around[s_, 0, 0] - far > x
                or around[s_, 1, 0] + far < x
                or around[s_, 0, 1] - far > y
                or around[s_, 1, 1] + far < y
                or around[s_, 0, 2] - far > z
                or around[s_, 1, 2] + far < z
            ):
                continue
            k, gap, p0, p1, p2 = nearest_on_skin(b.at, b.face, b.skin[s_], b.skin[s_ + 1], x, y, z, far)
            if k < 0 or not gap - b.thick[s_] < reach:
                continue
            if count == contacts.slot.shape[0]:
                contacts = _more(contacts)
            contacts.slot[count], contacts.gap[count], contacts.friction[count] = k, gap - b.thick[s_], 0.0
            contacts.normal[count, 0], contacts.normal[count, 1], contacts.normal[count, 2] = p0, p1, p2
            count += 1
        m = contacts.normal
        for c in range(contacts.begin[i], count):
            contacts.offset[c] = contacts.gap[c] - (m[c, 0] * x + m[c, 1] * y + m[c, 2] * z)
            share = 1.0
            for o in range(contacts.begin[i], count):
                nearer = contacts.gap[o] < contacts.gap[c] or (contacts.gap[o] == contacts.gap[c] and o < c)
                if nearer:
                    along = max(0.0, m[c, 0] * m[o, 0] + m[c, 1] * m[o, 1] + m[c, 2] * m[o, 2])
                    share *= 1.0 - along * along
            contacts.share[c] = share
    contacts.begin[n] = count
    return contacts


@compiled
def no_contacts(n: int) -> Contacts:
    """Room for the contacts of n particles."""
    size = 2 * n + 16
    begin, slot = np.zeros(n + 1, dtype=np.int64), np.empty(size, dtype=np.int32)
    gap, offset, friction, share = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    return Contacts(begin, slot, gap, np.empty((size, 3)), offset, friction, share)


@compiled
def weigh(x: Array, n: int, push_: float, gravity: Array, received: Array) -> None:
    """What weight gives to particles at x, each a mass times a time `push_` [kg s]."""
    g0, g1, g2 = gravity[0], gravity[1], gravity[2]
    for i in range(n):
        received[0] += push_ * g0
        received[1] += push_ * g1
        received[2] += push_ * g2
        received[3] += push_ * (x[i, 1] * g2 - x[i, 2] * g1)
        received[4] += push_ * (x[i, 2] * g0 - x[i, 0] * g2)
        received[5] += push_ * (x[i, 0] * g1 - x[i, 1] * g0)
