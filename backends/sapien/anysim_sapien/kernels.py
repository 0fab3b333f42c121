"""The compiled arithmetic: drive laws, efforts, and the twists of bodies.

Kernels that call each other share one file because numba's cache notices a change of a kernel's own file only. None is
compiled with fast-math, and none adds in an order that depends on the number of envs: an env's bits are its own.
"""

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled

PUSH, FEED, STIFFNESS, DAMPING, BOUND, ASKED, PASSIVE, GIVEN = range(8)
"""Rows of a law (N, 8, J); `ASKED` bounds what the targets ask for, `GIVEN` is what the last substep was given."""

LAW, EXPLICIT, NATIVE = range(3)
"""Who computes the drives: PhysX their damping, nobody but the law, or PhysX all of it."""

TARGET, SPEED, GAINS, FORCE = 1, 2, 4, 8
"""What is to be told of a joint."""


@compiled
def orders(
    control: Array,
    actuator: Array,
    kp: Array,
    kd: Array,
    limit: Array,
    passive: Array,
    speeds: Array,
    position: int,
    effort: int,
    law: Array,
) -> None:
    """Write the law (N, 8, J) of commands and gains.

    Args:
        control: (N, 4 A) targets of position, velocity and effort, and modes; (N, 0) where nothing is commanded.
        actuator: (J,) of each joint, -1 without one.
        kp: (N, A), kd: (N, A), limit: (N, A), passive: (N, J), speeds: (J,) the highest that a drive may ask for.
        position: the number of the mode with both gains; effort: that of the one with neither.
        law: (N, 8, J), written.
    """
    count = control.shape[1] // 4
    for e in range(law.shape[0]):
        for j in range(law.shape[2]):
            for row in range(8):
                law[e, row, j] = 0.0
            law[e, BOUND, j], law[e, ASKED, j], law[e, PASSIVE, j] = np.inf, np.inf, passive[e, j]
            a = actuator[j]
            if a < 0 or count == 0:
                continue
            mode = control[e, 3 * count + a]
            stiffness = kp[e, a] if mode == position else 0.0
            damping = kd[e, a] if mode != effort else 0.0
            law[e, PUSH, j] = stiffness * control[e, a] + damping * control[e, count + a]
            law[e, FEED, j] = control[e, 2 * count + a]
            law[e, STIFFNESS, j], law[e, DAMPING, j], law[e, BOUND, j] = stiffness, damping, limit[e, a]
            if damping > 0.0:
                law[e, ASKED, j] = damping * speeds[j]


@compiled
def native_orders(control: Array, actuator: Array, law: Array, unbounded: float, wanted: Array) -> None:
    """Write the terms (N, J, 6) of PhysX' own drives: targets, stiffness, damping, limit and force."""
    count = control.shape[1] // 4
    for e in range(law.shape[0]):
        for j in range(law.shape[2]):
            a = actuator[j]
            position, velocity = 0.0, 0.0
            if a >= 0 and count > 0:
                position, velocity = control[e, a], control[e, count + a]
            feed, stiffness, damping = law[e, FEED, j], law[e, STIFFNESS, j], law[e, DAMPING, j]
            bound, whole = law[e, BOUND, j], damping + law[e, PASSIVE, j]
            stiff = stiffness > 0.0
            braked = not stiff and damping > 0.0
            push = damping * velocity + (feed if braked else 0.0)
            wanted[e, j, 0] = position + feed / stiffness if stiff else 0.0
            wanted[e, j, 1] = push / whole if whole > 0.0 else 0.0
            wanted[e, j, 2], wanted[e, j, 3] = stiffness, whole
            # a drive in effort mode exerts a force, and its joint's damping has no limit
            wanted[e, j, 4], wanted[e, j, 5] = unbounded, 0.0
            if stiff or braked:
                wanted[e, j, 4] = min(bound, unbounded)
            else:
                wanted[e, j, 5] = _clip(feed, bound)


@compiled
def _clip(value: float, bound: float) -> float:
    """`value` within +-bound; what is not a number stays so."""
    if value > bound:
        return bound
    return -bound if value < -bound else value


@compiled
def changes(wanted: Array, known: Array, env: int, there: Array, news: Array) -> int:
    """List what PhysX does not know yet of an env's joints in `news` (J, 2), as joint and what; returns how many."""
    count = 0
    for j in range(wanted.shape[1]):
        what = 0
        if wanted[env, j, 0] != known[env, j, 0]:
            what |= TARGET
        if wanted[env, j, 1] != known[env, j, 1]:
            what |= SPEED
        if (
            wanted[env, j, 2] != known[env, j, 2]
            or wanted[env, j, 3] != known[env, j, 3]
            or wanted[env, j, 4] != known[env, j, 4]
        ):
            what |= GAINS
        if wanted[env, j, 5] != known[env, j, 5]:
            what |= FORCE
        for k in range(6):
            known[env, j, k] = wanted[env, j, k]
        if what and there[j]:
            news[count, 0], news[count, 1] = j, what
            count += 1
    return count


@compiled
def substep(
    law: Array,
    env: int,
    joints: Array,
    position: Array,
    velocity: Array,
    kind: int,
    unbounded: float,
    told: Array,
    force: Array,
    news: Array,
    count: int,
) -> int:
    """The law of an articulation's joints at their present state, and what PhysX does not know of them yet.

    Args:
        law: (N, 8, J); its row GIVEN is written.
        joints: (n,) the World's of each degree of freedom.
        position: (n,), velocity: (n,) float32.
        kind: EXPLICIT, where damping is in the force, or LAW.
        told: (N, 3, J) damping, force limit and velocity target of PhysX' drives, written.
        force: (n,) float32, written.
        news: (J, 2) joint and what is to be told, written from row `count` on; returns the number of the next.
    """
    for k in range(joints.shape[0]):
        j = joints[k]
        speed = float(velocity[k])
        push = _clip(law[env, PUSH, j] - law[env, STIFFNESS, j] * float(position[k]), law[env, ASKED, j])
        push += law[env, FEED, j]
        damping, bound, passive = law[env, DAMPING, j], law[env, BOUND, j], law[env, PASSIVE, j]
        whole = push - damping * speed
        slowing, limit, target = passive, unbounded, 0.0
        if kind == EXPLICIT:
            given = exerted = _clip(whole, bound)
        else:
            given = exerted = push
            slowing += damping
            if abs(whole) > bound:
                exerted = _clip(push, bound)
                if damping > 0.0:
                    # PhysX clips it at the speed that it ends with
                    exerted = 0.0
                    limit = max(bound - (passive if whole > 0.0 else -passive) * speed, 0.0)
                    target = push / slowing
        law[env, GIVEN, j] = given
        force[k] = exerted
        what = 0
        if slowing != told[env, 0, j] or limit != told[env, 1, j]:
            what |= GAINS
        if target != told[env, 2, j]:
            what |= SPEED
        if what:
            told[env, 0, j], told[env, 1, j], told[env, 2, j] = slowing, limit, target
            news[count, 0], news[count, 1] = j, what
            count += 1
    return count


@compiled
def exerted(law: Array, env: int, packed: Array, position: Array, velocity: Array, kind: int, effort: Array) -> None:
    """Write an env's row of `effort` (N, J): what its drives exerted in the substep that left `packed`.

    `position` and `velocity` are the joints' places in it; `kind` is that of the drives.
    """
    for j in range(law.shape[2]):
        value = law[env, GIVEN, j]
        if kind == NATIVE:
            value = law[env, PUSH, j] + law[env, FEED, j] - law[env, STIFFNESS, j] * float(packed[position[j]])
        if kind != EXPLICIT:
            value -= law[env, DAMPING, j] * float(packed[velocity[j]])
        effort[env, j] = _clip(value, law[env, BOUND, j])


@compiled
def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _rotated(packed: Array, pose: Array, v: Array) -> tuple[float, float, float]:
    """A vector of the frame at `pose`, in world axes, in the order of `anysim.math.pose.rotate`."""
    u = (packed[pose[3]], packed[pose[4]], packed[pose[5]])
    w = packed[pose[6]]
    t = _cross(u, (v[0], v[1], v[2]))
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    c = _cross(u, t)
    return v[0] + w * t[0] + c[0], v[1] + w * t[1] + c[1], v[2] + w * t[2] + c[2]


@compiled
def twists(
    packed: Array,
    pose: Array,
    velocity: Array,
    joint_vel: Array,
    com: Array,
    free: Array,
    body: Array,
    axis: Array,
    anchor: Array,
    turns: Array,
    links: Array,
    root: Array,
    first: Array,
    chain: Array,
    out: Array,
) -> None:
    """Write the rows of free bodies and of links into twists (N, B, 6).

    PhysX gives the velocity of a free body's centre of mass, not that of its origin. For links: a rigid motion is its
    angular rate and the velocity of whatever passes the world's origin; both add along a chain of joints, from the
    root on.

    Args:
        packed: (L,) float64.
        pose: (N, B, 7), velocity: (N, B, 6), joint_vel: (N, J) places in it.
        com: (N, B, 3) in the bodies' frames.
        free: (F,) bodies.
        body: (J,), axis: (J, 3), anchor: (J, 3), turns: (J,) 1 of a revolute joint, 0 of a prismatic one.
        links: (K,), root: (K,) bodies; the joints of link k are those of `chain` from `first[k]` to `first[k + 1]`.
        out: the twists, written.
    """
    motion = np.empty((body.shape[0], 6))
    total = np.empty(6)
    for e in range(out.shape[0]):
        for b in free:
            at = velocity[e, b]
            rate = (packed[at[3]], packed[at[4]], packed[at[5]])
            moved = _cross(rate, _rotated(packed, pose[e, b], com[e, b]))
            for k in range(3):
                out[e, b, k], out[e, b, 3 + k] = packed[at[k]] - moved[k], rate[k]
        for j in range(body.shape[0]):
            at = pose[e, body[j]]
            speed, turning = packed[joint_vel[e, j]], turns[j]
            a = _rotated(packed, at, axis[j])
            a = (a[0] * speed, a[1] * speed, a[2] * speed)
            p = _rotated(packed, at, anchor[j])
            p = (packed[at[0]] + p[0], packed[at[1]] + p[1], packed[at[2]] + p[2])
            r = (a[0] * turning, a[1] * turning, a[2] * turning)
            c = _cross(p, r)
            for k in range(3):
                motion[j, k], motion[j, 3 + k] = c[k] + a[k] * (1.0 - turning), r[k]
        for i in range(links.shape[0]):
            total[:] = 0.0
            for n in range(first[i], first[i + 1]):
                for k in range(6):
                    total[k] += motion[chain[n], k]
            base, at = out[e, root[i]], pose[e, root[i]]
            c = _cross((base[3], base[4], base[5]), (packed[at[0]], packed[at[1]], packed[at[2]]))
            for k in range(3):
                total[k] += base[k] - c[k]
                total[3 + k] += base[3 + k]
            at = pose[e, links[i]]
            c = _cross((total[3], total[4], total[5]), (packed[at[0]], packed[at[1]], packed[at[2]]))
            for k in range(3):
                out[e, links[i], k], out[e, links[i], 3 + k] = total[k] + c[k], total[3 + k]
