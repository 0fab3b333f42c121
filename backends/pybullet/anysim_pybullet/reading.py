"""The compiled arithmetic of reading a state: frames of bodies from what Bullet says of their centres of mass.

It calls no kernel of another file: numba's cache would not notice a change of that one.
"""

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled

ROW = 16
"""Numbers of a body in `frames`: its centre of mass (3), a quaternion (4), linear and angular velocity of the centre of
mass (6), and the origin of the link's frame (3). The quaternion is a root's inertial frame's, or a link's frame's."""

UNUSED = (0.0,) * 3
"""In place of the origin of a link's frame, which a root has not."""


@compiled
def _turned(turn: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector turned by a unit quaternion (4,)."""
    a, b, c, w = turn[0], turn[1], turn[2], turn[3]
    return (
        (1 - 2 * (b * b + c * c)) * x + 2 * (a * b - w * c) * y + 2 * (a * c + w * b) * z,
        2 * (a * b + w * c) * x + (1 - 2 * (a * a + c * c)) * y + 2 * (b * c - w * a) * z,
        2 * (a * c - w * b) * x + 2 * (b * c + w * a) * y + (1 - 2 * (a * a + b * b)) * z,
    )


@compiled
def frames(rows: Array, local: Array, roots: int, pose: Array, twist: Array) -> None:
    """Frames of bodies from what Bullet says of their centres of mass.

    Args:
        rows: (K, ROW), roots first.
        local: (K, 10): the inertial frame in the link's frame (7), and the link's origin in the body's frame (3).
        roots: how many.
        pose, twist: (K, 7), (K, 6), written.
    """
    for b in range(rows.shape[0]):
        begin, arm = 13, 7  # the origin of the link's frame, and from there to the body's
        for k in range(4):
            pose[b, 3 + k] = rows[b, 3 + k]
        if b < roots:
            begin, arm = 0, 0
            x, y, z, w = rows[b, 3], rows[b, 4], rows[b, 5], rows[b, 6]
            a, c, d, e = -local[b, 3], -local[b, 4], -local[b, 5], local[b, 6]
            pose[b, 3] = w * a + x * e + y * d - z * c
            pose[b, 4] = w * c - x * d + y * e + z * a
            pose[b, 5] = w * d + x * c - y * a + z * e
            pose[b, 6] = w * e - x * a - y * c - z * d
        x, y, z = _turned(pose[b, 3:], -local[b, arm], -local[b, arm + 1], -local[b, arm + 2])
        pose[b, 0], pose[b, 1], pose[b, 2] = rows[b, begin] + x, rows[b, begin + 1] + y, rows[b, begin + 2] + z
        x, y, z = pose[b, 0] - rows[b, 0], pose[b, 1] - rows[b, 1], pose[b, 2] - rows[b, 2]
        rx, ry, rz = rows[b, 10], rows[b, 11], rows[b, 12]
        twist[b, 0], twist[b, 3] = rows[b, 7] + (ry * z - rz * y), rx
        twist[b, 1], twist[b, 4] = rows[b, 8] + (rz * x - rx * z), ry
        twist[b, 2], twist[b, 5] = rows[b, 9] + (rx * y - ry * x), rz


@compiled
def take(
    numbers: Array,
    local: Array,
    bodies: Array,
    roots: int,
    joints: Array,
    running: Array,
    pose: Array,
    twist: Array,
    position: Array,
    velocity: Array,
    motor: Array,
    effort: Array,
) -> None:
    """Write what Bullet says into the rows of an env: pose (B, 7), twist (B, 6), of joints (J,).

    Args:
        numbers: rows of `frames` one after the other, roots first; then positions, velocities and torques of motors.
        local: (B, 10), see `frames`.
        bodies, joints: (K,) whose they are.
        roots: how many of the bodies.
        running: (J,) bool, the joints that motors move: their torques are the efforts. Not where no joints were read.
    """
    count = len(bodies)
    here, moves = np.empty((count, 7)), np.empty((count, 6))
    frames(numbers[: ROW * count].reshape(count, ROW), local[bodies], roots, here, moves)
    for b in range(count):
        pose[bodies[b], :] = here[b]
        twist[bodies[b], :] = moves[b]
    start, n = ROW * count, len(joints)
    for k in range(n):
        position[joints[k]] = numbers[start + k]
        velocity[joints[k]] = numbers[start + n + k]
        motor[joints[k]] = numbers[start + 2 * n + k]
    if n > 0:
        for j in range(len(running)):
            if running[j]:
                effort[j] = motor[j]


@compiled
def within(far: float, fast: float, pose: Array, twist: Array, velocity: Array) -> bool:
    """Whether all of an env's bodies and joints are within bounds [m; m/s, rad/s]. What is not a number is not."""
    for b in range(pose.shape[0]):
        for k in range(3):
            if not abs(pose[b, k]) < far:
                return False
        for k in range(6):
            if not abs(twist[b, k]) < fast:
                return False
    for j in range(len(velocity)):
        if not abs(velocity[j]) < fast:
            return False
    return True
