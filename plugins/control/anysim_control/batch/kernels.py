"""The compiled arithmetic of inverse kinematics: scalar loops over rows, without the interpreter lock.

A chain comes in canonical form: `frames` (K+1, 3, 4) are constant transforms [R | p], one before each joint and one for
the tool; each joint turns about or slides along the z axis of its frame (`prismatic` (K,) bool). Everything is in the
frame of the chain's root body.

The residual of a row is r = (target - tool position, w * log(R_tool^T R_target)): position in root axes, the rotation
vector in tool axes, weighted axis by axis. Its Jacobian is exact: with weights of zero too, steps go downhill.

No kernel adds in an order that depends on the batch, and none is compiled with fast-math: a row's bits are its own.

The arithmetic shares one file because numba's cache notices a change of a kernel's own file only, not of what it calls.
Random starts are beside it: recorded results depend on them, so they do not change, and a test would notice.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim_control.batch.starts import compiled, start_position

MAX_MOVE = 1.0
"""The most [rad] or [m] a joint moves in an iteration: the linear model is worth nothing beyond."""
STALLS = 3


@compiled
def rotation_of(quaternion: Array, out: Array) -> None:
    """Rotation matrix (3, 3) of a quaternion xyzw of any nonzero length."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    s = 2.0 / (x * x + y * y + z * z + w * w)
    out[0, 0] = 1.0 - s * (y * y + z * z)
    out[0, 1] = s * (x * y - z * w)
    out[0, 2] = s * (x * z + y * w)
    out[1, 0] = s * (x * y + z * w)
    out[1, 1] = 1.0 - s * (x * x + z * z)
    out[1, 2] = s * (y * z - x * w)
    out[2, 0] = s * (x * z - y * w)
    out[2, 1] = s * (y * z + x * w)
    out[2, 2] = 1.0 - s * (x * x + y * y)


@compiled
def target_in_root(target: Array, base: Array, rot: Array, pos: Array, tmp_a: Array, tmp_b: Array) -> None:
    """The target pose seen from the root body: rot (3, 3), pos (3,)."""
    rotation_of(base[3:], tmp_a)
    rotation_of(target[3:], tmp_b)
    for i in range(3):
        pos[i] = 0.0
        for j in range(3):
            pos[i] += tmp_a[j, i] * (target[j] - base[j])
            rot[i, j] = tmp_a[0, i] * tmp_b[0, j] + tmp_a[1, i] * tmp_b[1, j] + tmp_a[2, i] * tmp_b[2, j]


@compiled
def forward(frames: Array, prismatic: Array, q: Array, pose: Array, axes: Array, points: Array) -> None:
    """The tool's frame into pose (3, 4); each joint's axis and a point on it into axes, points (K, 3)."""
    joints = q.shape[0]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    px, py, pz = 0.0, 0.0, 0.0
    for k in range(joints + 1):
        f = frames[k]
        px += r00 * f[0, 3] + r01 * f[1, 3] + r02 * f[2, 3]
        py += r10 * f[0, 3] + r11 * f[1, 3] + r12 * f[2, 3]
        pz += r20 * f[0, 3] + r21 * f[1, 3] + r22 * f[2, 3]
        a00 = r00 * f[0, 0] + r01 * f[1, 0] + r02 * f[2, 0]
        a01 = r00 * f[0, 1] + r01 * f[1, 1] + r02 * f[2, 1]
        a02 = r00 * f[0, 2] + r01 * f[1, 2] + r02 * f[2, 2]
        a10 = r10 * f[0, 0] + r11 * f[1, 0] + r12 * f[2, 0]
        a11 = r10 * f[0, 1] + r11 * f[1, 1] + r12 * f[2, 1]
        a12 = r10 * f[0, 2] + r11 * f[1, 2] + r12 * f[2, 2]
        a20 = r20 * f[0, 0] + r21 * f[1, 0] + r22 * f[2, 0]
        a21 = r20 * f[0, 1] + r21 * f[1, 1] + r22 * f[2, 1]
        a22 = r20 * f[0, 2] + r21 * f[1, 2] + r22 * f[2, 2]
        r02, r12, r22 = a02, a12, a22
        if k == joints or prismatic[k]:
            r00, r01, r10, r11, r20, r21 = a00, a01, a10, a11, a20, a21
        else:
            c, s = math.cos(q[k]), math.sin(q[k])
            r00, r01 = a00 * c + a01 * s, a01 * c - a00 * s
            r10, r11 = a10 * c + a11 * s, a11 * c - a10 * s
            r20, r21 = a20 * c + a21 * s, a21 * c - a20 * s
        if k < joints:
            axes[k, 0], axes[k, 1], axes[k, 2] = r02, r12, r22
            points[k, 0], points[k, 1], points[k, 2] = px, py, pz
            if prismatic[k]:
                px, py, pz = px + r02 * q[k], py + r12 * q[k], pz + r22 * q[k]
    pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3] = r00, r01, r02, px
    pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3] = r10, r11, r12, py
    pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3] = r20, r21, r22, pz


@compiled
def rotation_error(pose: Array, rot: Array, out: Array) -> None:
    """Rotation vector (3,) in tool axes that turns the tool into the target: log(R_tool^T R_target), angle <= pi."""
    m00 = pose[0, 0] * rot[0, 0] + pose[1, 0] * rot[1, 0] + pose[2, 0] * rot[2, 0]
    m01 = pose[0, 0] * rot[0, 1] + pose[1, 0] * rot[1, 1] + pose[2, 0] * rot[2, 1]
    m02 = pose[0, 0] * rot[0, 2] + pose[1, 0] * rot[1, 2] + pose[2, 0] * rot[2, 2]
    m10 = pose[0, 1] * rot[0, 0] + pose[1, 1] * rot[1, 0] + pose[2, 1] * rot[2, 0]
    m11 = pose[0, 1] * rot[0, 1] + pose[1, 1] * rot[1, 1] + pose[2, 1] * rot[2, 1]
    m12 = pose[0, 1] * rot[0, 2] + pose[1, 1] * rot[1, 2] + pose[2, 1] * rot[2, 2]
    m20 = pose[0, 2] * rot[0, 0] + pose[1, 2] * rot[1, 0] + pose[2, 2] * rot[2, 0]
    m21 = pose[0, 2] * rot[0, 1] + pose[1, 2] * rot[1, 1] + pose[2, 2] * rot[2, 1]
    m22 = pose[0, 2] * rot[0, 2] + pose[1, 2] * rot[1, 2] + pose[2, 2] * rot[2, 2]
    # Through the quaternion, its largest component first: accurate at small angles and near pi alike.
    trace = m00 + m11 + m22
    if trace >= m00 and trace >= m11 and trace >= m22:
        x, y, z, w = m21 - m12, m02 - m20, m10 - m01, 1.0 + trace
    elif m00 >= m11 and m00 >= m22:
        x, y, z, w = 1.0 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12
    elif m11 >= m22:
        x, y, z, w = m01 + m10, 1.0 + m11 - m00 - m22, m12 + m21, m02 - m20
    else:
        x, y, z, w = m02 + m20, m12 + m21, 1.0 + m22 - m00 - m11, m10 - m01
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine <= 1e-12 * w else 2.0 * math.atan2(sine, w) / sine
    out[0], out[1], out[2] = x * scale, y * scale, z * scale


@compiled
def residual(pose: Array, rot: Array, pos: Array, weight: Array, vector: Array, error: Array) -> float:
    """Weighted residual into error (6,), the bare rotation vector into vector (3,). Returns half its square."""
    rotation_error(pose, rot, vector)
    total = 0.0
    for i in range(3):
        error[i] = pos[i] - pose[i, 3]
        error[3 + i] = weight[i] * vector[i]
    for i in range(6):
        total += error[i] * error[i]
    return 0.5 * total


@compiled
def jacobian(
    prismatic: Array, pose: Array, axes: Array, points: Array, vector: Array, weight: Array, out: Array
) -> None:
    """What a unit of each joint takes off the residual, into out (K, 6): row k for joint k."""
    vx, vy, vz = vector[0], vector[1], vector[2]
    square = vx * vx + vy * vy + vz * vz
    # log(exp(-d) exp(v)) = v - L d with L = 1 - [v]/2 + c [v]^2
    if square < 1e-6:
        c = 1.0 / 12.0 + square / 720.0
    else:
        angle = math.sqrt(square)
        c = 1.0 / square - 0.5 / (angle * math.tan(0.5 * angle))
    for k in range(axes.shape[0]):
        ax, ay, az = axes[k, 0], axes[k, 1], axes[k, 2]
        if prismatic[k]:
            out[k, 0], out[k, 1], out[k, 2] = ax, ay, az
            out[k, 3], out[k, 4], out[k, 5] = 0.0, 0.0, 0.0
            continue
        dx, dy, dz = pose[0, 3] - points[k, 0], pose[1, 3] - points[k, 1], pose[2, 3] - points[k, 2]
        out[k, 0] = ay * dz - az * dy
        out[k, 1] = az * dx - ax * dz
        out[k, 2] = ax * dy - ay * dx
        ox = pose[0, 0] * ax + pose[1, 0] * ay + pose[2, 0] * az
        oy = pose[0, 1] * ax + pose[1, 1] * ay + pose[2, 1] * az
        oz = pose[0, 2] * ax + pose[1, 2] * ay + pose[2, 2] * az
        cx, cy, cz = vy * oz - vz * oy, vz * ox - vx * oz, vx * oy - vy * ox
        out[k, 3] = weight[0] * (ox - 0.5 * cx + c * (vy * cz - vz * cy))
        out[k, 4] = weight[1] * (oy - 0.5 * cy + c * (vz * cx - vx * cz))
        out[k, 5] = weight[2] * (oz - 0.5 * cz + c * (vx * cy - vy * cx))


@compiled
def damped_solve(jac: Array, free: Array, damping: float, error: Array, matrix: Array, solution: Array) -> None:
    """Solve (J_free^T J_free + damping 1) x = error by Cholesky, into solution (6,); J is (K, 6), damping > 0."""
    for i in range(6):
        for j in range(i + 1):
            matrix[i, j] = 0.0
        matrix[i, i] = damping
    for k in range(jac.shape[0]):
        if free[k]:
            for i in range(6):
                for j in range(i + 1):
                    matrix[i, j] += jac[k, i] * jac[k, j]
    for i in range(6):
        for j in range(i):
            total = matrix[i, j]
            for m in range(j):
                total -= matrix[i, m] * matrix[j, m]
            matrix[i, j] = total * matrix[j, j]
        total = matrix[i, i]
        for m in range(i):
            total -= matrix[i, m] * matrix[i, m]
        # Rounding can leave less than the damping that exact arithmetic guarantees.
        matrix[i, i] = 1.0 / math.sqrt(max(total, damping))  # the inverse of the factor's diagonal
    for i in range(6):
        total = error[i]
        for m in range(i):
            total -= matrix[i, m] * solution[m]
        solution[i] = total * matrix[i, i]
    for i in range(5, -1, -1):
        total = solution[i]
        for m in range(i + 1, 6):
            total -= matrix[m, i] * solution[m]
        solution[i] = total * matrix[i, i]


@compiled
def bounded_move(
    jac: Array,
    error: Array,
    damping: float,
    q: Array,
    lower: Array,
    upper: Array,
    pull: Array,
    free: Array,
    move: Array,
    wanted: Array,
    matrix: Array,
    solution: Array,
) -> None:
    """The least |J^T move - error|^2 + damping |move - pull|^2 with lower <= q + move <= upper, into move (K,).

    Joints that are not `free` stay where they are. A joint that would leave its limits is set on them, and the others
    are solved again to make up for it.
    """
    joints = q.shape[0]
    for k in range(joints):
        move[k] = 0.0
    for _ in range(joints + 1):
        for i in range(6):
            wanted[i] = error[i]
        for k in range(joints):
            known = pull[k] if free[k] else move[k]
            if known != 0.0:
                for i in range(6):
                    wanted[i] -= jac[k, i] * known
        damped_solve(jac, free, damping, wanted, matrix, solution)
        settled = True
        for k in range(joints):
            if not free[k]:
                continue
            move[k] = pull[k]
            for i in range(6):
                move[k] += jac[k, i] * solution[i]
            if q[k] + move[k] < lower[k]:
                move[k], free[k], settled = lower[k] - q[k], False, False
            elif q[k] + move[k] > upper[k]:
                move[k], free[k], settled = upper[k] - q[k], False, False
        if settled:
            return


@compiled
def errors(error: Array, vector: Array, weight: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] of a residual; rotations of zero weight do not count."""
    angle = 0.0
    for i in range(3):
        if weight[i] > 0.0:
            angle += vector[i] * vector[i]
    return math.sqrt(error[0] * error[0] + error[1] * error[1] + error[2] * error[2]), math.sqrt(angle)


@compiled
def solve_rows(
    frames: Array,
    prismatic: Array,
    lower: Array,
    upper: Array,
    spread: Array,
    weight: Array,
    tolerance: Array,
    attempts: int,
    max_iterations: int,
    targets: Array,
    base: Array,
    seeds: Array,
    keys: Array,
    joint_pos: Array,
    converged: Array,
    position_error: Array,
    angle_error: Array,
    iterations: Array,
) -> None:
    """Levenberg-Marquardt from the seed, then from random starts, until a row converges.

    A step is a `bounded_move` damped by m |r|^2, shortened to MAX_MOVE. It is kept if |r| falls; m shrinks with success
    and grows with failure. Damping in proportion to |r|^2 dies out near a solution, where convergence becomes
    quadratic. An attempt ends when STALLS steps in a row gain little: another start is cheaper than a slow valley.
    """
    joints = seeds.shape[1]
    rot, pos, tmp_a, tmp_b = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    pose, axes, points = np.empty((3, 4)), np.empty((joints, 3)), np.empty((joints, 3))
    vector, error, solution, matrix = np.empty(3), np.empty(6), np.empty(6), np.empty((6, 6))
    jac, free = np.empty((joints, 6)), np.empty(joints, np.bool_)
    q, trial, move, still = np.empty(joints), np.empty(joints), np.empty(joints), np.zeros(joints)
    trial_error, wanted = np.empty(6), np.empty(6)
    for row in range(targets.shape[0]):
        target_in_root(targets[row], base[row], rot, pos, tmp_a, tmp_b)
        best = np.inf
        total = 0
        done = False
        for attempt in range(attempts):
            for k in range(joints):
                q[k] = start_position(attempt, k, joints, lower[k], upper[k], spread[k], seeds[row, k], keys[row])
            forward(frames, prismatic, q, pose, axes, points)
            cost = residual(pose, rot, pos, weight, vector, error)
            factor = 0.1
            stalled = 0
            used = 0
            while True:
                distance, angle = errors(error, vector, weight)
                done = distance < tolerance[0] and angle < tolerance[1]
                if done or cost < best or total + used == 0:  # the first in any case
                    best = cost
                    position_error[row], angle_error[row] = distance, angle
                    for k in range(joints):
                        joint_pos[row, k] = q[k]
                if done or used >= max_iterations or stalled >= STALLS:
                    break
                jacobian(prismatic, pose, axes, points, vector, weight, jac)
                before = cost
                # The frame of the kept position is needed only for its Jacobian, so trials may overwrite it.
                while used < max_iterations and factor < 1e4:
                    used += 1
                    for k in range(joints):
                        downhill = 0.0
                        for i in range(6):
                            downhill += jac[k, i] * error[i]
                        free[k] = not ((q[k] <= lower[k] and downhill < 0.0) or (q[k] >= upper[k] and downhill > 0.0))
                    damping = factor * 2.0 * before + 1e-8
                    bounded_move(jac, error, damping, q, lower, upper, still, free, move, wanted, matrix, solution)
                    longest = 0.0
                    for k in range(joints):
                        longest = max(longest, abs(move[k]))
                    scale = min(1.0, MAX_MOVE / longest) if longest > 0.0 else 1.0
                    for k in range(joints):
                        trial[k] = min(max(q[k] + scale * move[k], lower[k]), upper[k])
                    forward(frames, prismatic, trial, pose, axes, points)
                    cost = residual(pose, rot, pos, weight, vector, trial_error)
                    if cost < before:
                        break
                    factor *= 4.0
                if cost >= before:
                    break
                factor = max(0.4 * factor, 1e-6)
                stalled = stalled + 1 if cost > 0.8 * before else 0
                for k in range(joints):
                    q[k] = trial[k]
                for i in range(6):
                    error[i] = trial_error[i]
            total += used
            if done:
                break
        converged[row] = done
        iterations[row] = total


@compiled
def step_rows(
    frames: Array,
    prismatic: Array,
    lower: Array,
    upper: Array,
    weight: Array,
    max_step: Array,
    gain: float,
    damping: float,
    targets: Array,
    base: Array,
    now: Array,
    posture: Array,
    joint_pos: Array,
    position_error: Array,
    angle_error: Array,
) -> None:
    """One `bounded_move` of each row, pulled by gain (posture - q), then scaled so that no joint exceeds max_step.

    Where the tool leaves freedom the posture has it all; elsewhere it pulls with the square of the damping only.
    """
    joints = now.shape[1]
    rot, pos, tmp_a, tmp_b = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    pose, axes, points = np.empty((3, 4)), np.empty((joints, 3)), np.empty((joints, 3))
    vector, error, solution, matrix = np.empty(3), np.empty(6), np.empty(6), np.empty((6, 6))
    jac, free, wanted = np.empty((joints, 6)), np.empty(joints, np.bool_), np.empty(6)
    q, move, pull = np.empty(joints), np.empty(joints), np.empty(joints)
    for row in range(targets.shape[0]):
        target_in_root(targets[row], base[row], rot, pos, tmp_a, tmp_b)
        for k in range(joints):
            q[k] = min(max(now[row, k], lower[k]), upper[k])
            pull[k] = gain * (posture[row, k] - q[k])
            free[k] = True
        forward(frames, prismatic, q, pose, axes, points)
        residual(pose, rot, pos, weight, vector, error)
        position_error[row], angle_error[row] = errors(error, vector, weight)
        jacobian(prismatic, pose, axes, points, vector, weight, jac)
        bounded_move(jac, error, damping * damping, q, lower, upper, pull, free, move, wanted, matrix, solution)
        scale = 1.0
        for k in range(joints):
            if abs(move[k]) > max_step[k]:
                scale = min(scale, max_step[k] / abs(move[k]))
        for k in range(joints):
            joint_pos[row, k] = min(max(q[k] + scale * move[k], lower[k]), upper[k])
