"""One step of damped least squares with a pull in the nullspace, within bounds."""

import numpy as np

from anysim.conventions import Array

FREE = 1e-3
"""A direction of joint space that moves the tool less than this [m/rad], [rad/rad] belongs to the nullspace."""


def damped_step(jacobian: Array, error: Array, pull: Array, lower: Array, upper: Array, damping: float) -> Array:
    """The move (K,) that takes `error` (m,) off a tool, and in what freedom is left goes along with `pull` (K,).

    With J = U S V^T it is V diag(s / (s^2 + damping^2)) U^T error + (1 - V V^T) pull. Joints that would leave
    [lower, upper] are set on them and the others are solved again to make up for it.

    Args:
        jacobian: (m, K).
        error: (m,) [m], [rad].
        pull: (K,) [rad] or [m].
        lower: (K,) the least move of each joint, <= 0.
        upper: (K,) the largest.
        damping: [m/rad] larger is slower and calmer near singular configurations.
    """
    joints = len(pull)
    move, free = np.zeros(joints), np.ones(joints, dtype=bool)
    for _ in range(joints):
        columns = jacobian[:, free]
        left, size, right = np.linalg.svd(columns, full_matrices=False)
        rest = error - jacobian[:, ~free] @ move[~free]
        tool = right.T @ (size / (size * size + damping * damping) * (left.T @ rest))
        row_space = right[size > FREE]
        own = pull[free] - row_space.T @ (row_space @ pull[free])
        move[free] = tool + own
        over = free & ((move < lower) | (move > upper))
        if not over.any():
            break
        move = np.clip(move, lower, upper)
        free &= ~over
        if not free.any():
            break
    return np.clip(move, lower, upper)


def shortened(move: Array, most: Array) -> Array:
    """A move (K,) scaled as a whole so that no joint exceeds `most` (K,): the tool keeps its direction."""
    ratio = np.abs(move) / most
    largest = float(ratio.max(initial=0.0))
    return move / largest if largest > 1.0 else move
