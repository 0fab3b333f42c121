"""The compiled mechanics of one articulation: mass matrix and bias forces, the drive law, and weights.

Kernels that call each other share one file because numba's cache notices a change of a kernel's own file only. None
adds in an order that depends on the number of envs, and none is compiled with fast-math: an env's bits are its own.

An articulation has bodies 0 (the root) to n, and body i + 1 is moved by joint i. A link's frame has the body's axes and
lies on the joint. If the root is free, the generalised velocity is (velocity of the root's frame origin, angular
velocity, joint rates), linear before angular, world axes; else it is the joint rates.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled

PARENT, PRISMATIC, LEADER = range(3)  # columns of `joint_ints` (n, 3)
AXIS, ORIGIN, REST = 0, 3, 6  # columns of `joint_floats` (n, 15): axis, origin in the parent, rest rotation by rows
MASS, COM, INERTIA, COMPENSATED = 0, 1, 4, 10  # columns of `bodies` (n + 1, 11); com and inertia in the link's frame
DAMPING, ARMATURE, STIFFNESS, DRAG, LIMIT, PULL, MULTIPLIER, FEED, BOUND, DRY, SPRING, RELAXED = range(12)
"""Columns of `drives` (n, 12)."""
STIFF, SLOW, SHORT, LONG, SHARES = range(5)
"""Columns of `tendons` (t, 4 + n): stiffness, damping, the two ends of the rest, and a coefficient for each joint."""

MAX_PASSES = 3
"""Solutions per step: each takes the drives that it finds beyond their limits as constant torques from then on,
and so the dry friction of joints that it cannot hold."""

STICKING = 1e6
"""A joint that dry friction holds is slowed down as if its inertia were this many times its own."""


@compiled
def rotation(x: float, y: float, z: float, w: float, out: Array) -> None:
    """The matrix (3, 3) of a unit quaternion."""
    out[0, 0] = 1 - 2 * (y * y + z * z)
    out[0, 1] = 2 * (x * y - w * z)
    out[0, 2] = 2 * (x * z + w * y)
    out[1, 0] = 2 * (x * y + w * z)
    out[1, 1] = 1 - 2 * (x * x + z * z)
    out[1, 2] = 2 * (y * z - w * x)
    out[2, 0] = 2 * (x * z - w * y)
    out[2, 1] = 2 * (y * z + w * x)
    out[2, 2] = 1 - 2 * (x * x + y * y)


@compiled
def _times(a: Array, v: Array, out: Array) -> None:
    for i in range(3):
        out[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]


@compiled
def _add_cross(a: Array, b: Array, scale: float, out: Array) -> None:
    out[0] += scale * (a[1] * b[2] - a[2] * b[1])
    out[1] += scale * (a[2] * b[0] - a[0] * b[2])
    out[2] += scale * (a[0] * b[1] - a[1] * b[0])


@compiled
def _solve(a: Array, b: Array, n: int) -> bool:
    """Cholesky in place: b becomes the solution of a x = b. False where `a` is not positive definite."""
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                a[i, i] = math.sqrt(total)
            else:
                a[i, j] = total / a[j, j]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= a[i, k] * b[k]
        b[i] = total / a[i, i]
    for i in range(n - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, n):
            total -= a[k, i] * b[k]
        b[i] = total / a[i, i]
    return True


@compiled
def dynamics(
    joint_ints: Array,
    joint_floats: Array,
    bodies: Array,
    wrench: Array,
    gravity: Array,
    root: Array,
    motion: Array,
    first: int,
    mass_matrix: Array,
    bias: Array,
    known: Array,
) -> None:
    """The mass matrix, the bias forces and the known outer forces of an articulation in its present state.

    Args:
        joint_ints: (n, 3), joint_floats: (n, 15), bodies: (n + 1, 11): see the columns above.
        wrench: (n + 1, 6) at the centres of mass [N, N m], world axes.
        gravity: (3,) [m/s^2].
        root: (13,) the root's frame: position, quaternion, linear and angular velocity of the frame's origin.
        motion: (2, n) joint positions and velocities.
        first: 6 with a free root, else 0: where the joints begin.
        mass_matrix: (first + n, first + n), written.
        bias: (first + n,) forces that hold the present velocities without outer forces but gravity, written.
        known: (first + n,) wrenches and counter forces of compensated gravity, written.
    """
    n = joint_ints.shape[0]
    size = first + n
    turn = np.empty((n + 1, 3, 3))
    place, speed, rate = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    push, twist = np.zeros((n + 1, 3)), np.zeros((n + 1, 3))  # accelerations without those of the joints
    axes = np.empty((n, 3))
    spin, arm, local, tmp = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    rotation(root[3], root[4], root[5], root[6], turn[0])
    for k in range(3):
        place[0, k], speed[0, k], rate[0, k] = root[k], root[7 + k], root[10 + k]
    for i in range(n):
        p, b = joint_ints[i, PARENT], i + 1
        for k in range(3):
            local[k] = joint_floats[i, ORIGIN + k]
        _times(turn[p], local, arm)
        for r in range(3):
            for c in range(3):
                spin[r, c] = 0.0
                for k in range(3):
                    spin[r, c] += turn[p, r, k] * joint_floats[i, REST + 3 * k + c]
        ax, ay, az = joint_floats[i, AXIS], joint_floats[i, AXIS + 1], joint_floats[i, AXIS + 2]
        for r in range(3):
            axes[i, r] = spin[r, 0] * ax + spin[r, 1] * ay + spin[r, 2] * az
        q, qd = motion[0, i], motion[1, i]
        for k in range(3):
            rate[b, k], twist[b, k] = rate[p, k], twist[p, k]
            speed[b, k], push[b, k] = speed[p, k], push[p, k]
        if joint_ints[i, PRISMATIC] == 1:
            for r in range(3):
                arm[r] += axes[i, r] * q
                for c in range(3):
                    turn[b, r, c] = spin[r, c]
        else:
            s, c0 = math.sin(0.5 * q), math.cos(0.5 * q)
            local_turn = np.empty((3, 3))
            rotation(ax * s, ay * s, az * s, c0, local_turn)
            for r in range(3):
                for c in range(3):
                    turn[b, r, c] = 0.0
                    for k in range(3):
                        turn[b, r, c] += spin[r, k] * local_turn[k, c]
        _add_cross(rate[p], arm, 1.0, speed[b])
        _add_cross(twist[p], arm, 1.0, push[b])
        tmp[:] = 0.0
        _add_cross(rate[p], arm, 1.0, tmp)
        _add_cross(rate[p], tmp, 1.0, push[b])
        for k in range(3):
            place[b, k] = place[p, k] + arm[k]
            tmp[k] = axes[i, k] * qd
        if joint_ints[i, PRISMATIC] == 1:
            _add_cross(rate[p], tmp, 2.0, push[b])
            for k in range(3):
                speed[b, k] += tmp[k]
        else:
            _add_cross(rate[p], tmp, 1.0, twist[b])
            for k in range(3):
                rate[b, k] += tmp[k]
    for i in range(size):
        bias[i] = known[i] = 0.0
        for j in range(size):
            mass_matrix[i, j] = 0.0
    linear, angular = np.zeros((size, 3)), np.zeros((size, 3))
    turned, moved = np.zeros((size, 3)), np.zeros((3, 3))
    chain = np.empty(size, dtype=np.int64)
    force, moment = np.empty(3), np.empty(3)
    for b in range(n + 1):
        length = 0
        joint = b - 1
        while joint >= 0:
            chain[length] = first + joint
            length += 1
            joint = joint_ints[joint, PARENT] - 1
        for k in range(first):
            chain[length] = k
            length += 1
        if length == 0:
            continue
        mass = bodies[b, MASS]
        for k in range(3):
            local[k] = bodies[b, COM + k]
        _times(turn[b], local, arm)  # from the frame to the centre of mass
        for x in range(length):
            v = chain[x]
            linear[v, :] = 0.0
            angular[v, :] = 0.0
            if v < first:
                if v < 3:
                    linear[v, v] = 1.0
                else:
                    angular[v, v - 3] = 1.0
                    for k in range(3):
                        tmp[k] = place[b, k] + arm[k] - place[0, k]
                    _add_cross(angular[v], tmp, 1.0, linear[v])
            elif joint_ints[v - first, PRISMATIC] == 1:
                for k in range(3):
                    linear[v, k] = axes[v - first, k]
            else:
                for k in range(3):
                    angular[v, k] = axes[v - first, k]
                    tmp[k] = place[b, k] + arm[k] - place[v - first + 1, k]
                _add_cross(angular[v], tmp, 1.0, linear[v])
        i0, i1, i2 = bodies[b, INERTIA], bodies[b, INERTIA + 1], bodies[b, INERTIA + 2]
        i3, i4, i5 = bodies[b, INERTIA + 3], bodies[b, INERTIA + 4], bodies[b, INERTIA + 5]
        for r in range(3):
            t0, t1, t2 = turn[b, r, 0], turn[b, r, 1], turn[b, r, 2]
            spin[r, 0] = t0 * i0 + t1 * i3 + t2 * i4
            spin[r, 1] = t0 * i3 + t1 * i1 + t2 * i5
            spin[r, 2] = t0 * i4 + t1 * i5 + t2 * i2
        for r in range(3):
            for c in range(3):
                moved[r, c] = spin[r, 0] * turn[b, c, 0] + spin[r, 1] * turn[b, c, 1] + spin[r, 2] * turn[b, c, 2]
        for k in range(3):
            force[k], moment[k] = push[b, k], 0.0
        _add_cross(twist[b], arm, 1.0, force)
        tmp[:] = 0.0
        _add_cross(rate[b], arm, 1.0, tmp)
        _add_cross(rate[b], tmp, 1.0, force)
        _times(moved, rate[b], tmp)
        _add_cross(rate[b], tmp, 1.0, moment)
        _times(moved, twist[b], tmp)
        for k in range(3):
            force[k] = mass * (force[k] - gravity[k])
            moment[k] += tmp[k]
        lift = mass * bodies[b, COMPENSATED]
        for x in range(length):
            v = chain[x]
            for k in range(3):
                bias[v] += linear[v, k] * force[k] + angular[v, k] * moment[k]
                known[v] += linear[v, k] * (wrench[b, k] - lift * gravity[k]) + angular[v, k] * wrench[b, 3 + k]
            _times(moved, angular[v], turned[v])
            for y in range(x + 1):
                u = chain[y]
                total = 0.0
                for k in range(3):
                    total += mass * linear[v, k] * linear[u, k] + turned[v, k] * angular[u, k]
                mass_matrix[v, u] += total
                if u != v:
                    mass_matrix[u, v] += total


@compiled
def drive_law(
    dt: float,
    implicit: bool,
    joint_ints: Array,
    joint_floats: Array,
    bodies: Array,
    drives: Array,
    tendons: Array,
    wrench: Array,
    gravity: Array,
    root: Array,
    motion: Array,
    first: int,
    memory: Array,
    out: Array,
) -> bool:
    """One step of the drives of an articulation.

    The law is u = kp (q* - q) + kd (qd* - qd) + ff, clipped, its damping taken at the end of the step if `implicit`,
    else at the beginning, as if kd were 0 in what follows. The torque is clip(u - dt kd qdd) with (M + A + dt (Kd + D))
    qdd = u + f + s - D qd - c + known + outer. D is the joints' own damping, A their armature, s = stiffness (rest - q)
    their springs at the beginning of the step, M, c and known are those of `dynamics`. f is dry friction: it stops the
    joint by the end of the step where that takes no more than its coefficient. A library that knows no armature would
    hold the bare link, and let go of one with much armature only after the torque has built up over many steps. `outer`
    is what else acted in the last step (contacts, limits): the momentum M dv/dt + c that the applied forces do not
    explain. Joints that follow another are coupled in the equation, and the forces of the coupling drop out of it.
    Tendons pull as joints' springs and damping do, along their lengths.

    Args:
        drives: (n, 12): damping, armature, the stiffness and damping of the drive in its mode, its limit,
            kp q* + kd qd*, the multiplier of a joint that follows another (`LEADER` >= 0), ff, and what bounds
            kp (q* - q) + kd qd*, dry friction, and a spring's stiffness and rest.
        tendons: (t, 4 + n), see its columns.
        memory: of the last step: 1 if it holds one, velocity, c - applied, M. Brought up to date.
        out: (2 n + 6): torques for the joints, efforts of the drives, force and moment on a free root's origin.

    Returns:
        False where the state is not finite; nothing is written then.
    """
    n = joint_ints.shape[0]
    size = first + n
    matrix, bias, known = np.empty((size, size)), np.empty(size), np.empty(size)
    dynamics(joint_ints, joint_floats, bodies, wrench, gravity, root, motion, first, matrix, bias, known)
    speed, outer, effort = np.empty(size), np.zeros(size), np.empty(n)
    for k in range(first):
        speed[k] = root[7 + k]
    for i in range(n):
        speed[first + i] = motion[1, i]
    for k in range(size):
        if not math.isfinite(speed[k] + bias[k]):
            return False
    if memory[0] == 1.0:
        for r in range(size):
            outer[r] = memory[1 + size + r]
            for c in range(size):
                outer[r] += memory[1 + 2 * size + r * size + c] * (speed[c] - memory[1 + c]) / dt
    leader, factor = np.empty(size, dtype=np.int64), np.ones(size)
    column = np.full(size, -1)
    free = 0
    for v in range(size):
        leader[v] = v
        if v >= first and joint_ints[v - first, LEADER] >= 0:
            leader[v] = first + joint_ints[v - first, LEADER]
            factor[v] = drives[v - first, MULTIPLIER]
        else:
            column[v] = free
            free += 1
    pull, drag, spring = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        spring[i] = drives[i, SPRING] * (drives[i, RELAXED] - motion[0, i])
        asked = drives[i, PULL] - drives[i, STIFFNESS] * motion[0, i]
        asked = min(max(asked, -drives[i, BOUND]), drives[i, BOUND])
        pull[i] = asked + drives[i, FEED] - drives[i, DRAG] * motion[1, i]
        drag[i] = drives[i, DRAG]
        if not implicit:
            pull[i], drag[i] = min(max(pull[i], -drives[i, LIMIT]), drives[i, LIMIT]), 0.0
    web, slack = np.zeros((n, n)), np.zeros(n)  # what tendons damp, and how hard at the present speed
    for t in range(tendons.shape[0]):
        length, rate = 0.0, 0.0
        for i in range(n):
            length += tendons[t, SHARES + i] * motion[0, i]
            rate += tendons[t, SHARES + i] * motion[1, i]
        tension = tendons[t, STIFF] * (min(max(length, tendons[t, SHORT]), tendons[t, LONG]) - length)
        for i in range(n):
            spring[i] += tendons[t, SHARES + i] * tension
            slack[i] += tendons[t, SHARES + i] * tendons[t, SLOW] * rate
            for j in range(n):
                web[i, j] += tendons[t, SLOW] * tendons[t, SHARES + i] * tendons[t, SHARES + j]
    # What friction alone would not stop within the step slips on; the rest is taken as held. Either may be wrong once.
    rub, grip, hold, passes = np.zeros(n), np.zeros(n), np.zeros(n), MAX_PASSES
    for i in range(n):
        if drives[i, DRY] > 0.0:
            passes += 2
            own = matrix[first + i, first + i] + drives[i, ARMATURE]
            hold[i] = STICKING * own / dt
            if abs(motion[1, i]) * own > dt * drives[i, DRY]:
                rub[i] = -math.copysign(drives[i, DRY], motion[1, i])
            else:
                rub[i], grip[i], hold[i] = -hold[i] * motion[1, i], hold[i], 0.0
    gained, reduced, right = np.empty(size), np.empty((free, free)), np.empty(free)
    for _ in range(passes):
        for r in range(free):
            right[r] = 0.0
            for c in range(free):
                reduced[r, c] = 0.0
        for r in range(size):
            row = column[leader[r]]
            total = known[r] + outer[r] - bias[r]
            if r >= first:
                passive = drives[r - first, DAMPING] * motion[1, r - first] + slack[r - first]
                total += pull[r - first] + rub[r - first] - passive + spring[r - first]
            right[row] += factor[r] * total
            for c in range(size):
                entry = matrix[r, c]
                if r == c and r >= first:
                    entry += drives[r - first, ARMATURE] + dt * (
                        drag[r - first] + grip[r - first] + drives[r - first, DAMPING]
                    )
                if r >= first and c >= first:
                    entry += dt * web[r - first, c - first]
                reduced[row, column[leader[c]]] += factor[r] * factor[c] * entry
        if not _solve(reduced, right, free):
            return False
        changed = False
        for r in range(size):
            gained[r] = factor[r] * right[column[leader[r]]]
        for i in range(n):
            effort[i] = pull[i] - dt * drag[i] * gained[first + i]
            limit = drives[i, LIMIT]
            if effort[i] > limit or effort[i] < -limit:
                effort[i] = limit if effort[i] > 0.0 else -limit
                changed = changed or drag[i] != 0.0 or pull[i] != effort[i]
                pull[i], drag[i] = effort[i], 0.0
            held = rub[i] - dt * grip[i] * gained[first + i]
            if grip[i] > 0.0 and abs(held) > drives[i, DRY]:
                rub[i], grip[i] = math.copysign(drives[i, DRY], held), 0.0
                changed = True
            elif hold[i] > 0.0 and (motion[1, i] + dt * gained[first + i]) * motion[1, i] < 0.0:
                rub[i], grip[i], hold[i] = -hold[i] * motion[1, i], hold[i], 0.0
                changed = True
        if not changed:
            break
    for k in range(6):
        out[2 * n + k] = known[k] if k < first else 0.0
    for i in range(n):
        v = first + i
        slowed = motion[1, i] + dt * gained[v]
        rubbed = rub[i] - dt * grip[i] * gained[v]
        out[i] = effort[i] + rubbed - drives[i, DAMPING] * slowed - drives[i, ARMATURE] * gained[v] + known[v]
        out[i] += spring[i] - slack[i]
        for j in range(n):
            out[i] -= dt * web[i, j] * gained[first + j]
        out[n + i] = effort[i]
    memory[0] = 1.0
    for r in range(size):
        memory[1 + r] = speed[r]
        memory[1 + size + r] = bias[r] - (known[r] if r < first else out[r - first])
        for c in range(size):
            memory[1 + 2 * size + r * size + c] = matrix[r, c]
    return True


@compiled
def weight(
    joint_ints: Array,
    joint_floats: Array,
    bodies: Array,
    numbers: Array,
    gravity: Array,
    root: Array,
    position: Array,
    joints: Array,
    first: int,
    torque: Array,
) -> bool:
    """Torques that cancel the weight of compensated bodies of an articulation.

    Args:
        bodies: (B, 11) of the env, of which the articulation has `numbers` (n + 1,).
        gravity: (3,) [m/s^2].
        root: (7,) the pose of the root's frame.
        position: (J,) of the env, of which the articulation has `joints` (n,).
        first: 6 with a free root, else 0.
        torque: (J,) [N m, N], written at `joints`.

    Returns:
        False where the state is not finite; nothing is written then.
    """
    n = len(joints)
    size = first + n
    motion, place, known = np.zeros((2, n)), np.zeros(13), np.empty(size)
    for i in range(n):
        motion[0, i] = position[joints[i]]
    for k in range(7):
        place[k] = root[k]
    wrench, mass, bias = np.zeros((n + 1, 6)), np.empty((size, size)), np.empty(size)
    dynamics(joint_ints, joint_floats, bodies[numbers], wrench, gravity, place, motion, first, mass, bias, known)
    for v in range(size):
        if not math.isfinite(known[v]):
            return False
    for i in range(n):
        torque[joints[i]] = known[first + i]
    return True
