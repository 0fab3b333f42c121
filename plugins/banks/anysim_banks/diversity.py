"""A diverse choice among grasps: the farthest points of each bin, taken in turn."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_banks.sampling import Candidates

RADIAN = 0.1
"""[m] that a turn by a radian counts as: the length of a hand."""
_AXES = np.concatenate([np.eye(3), -np.eye(3)])


def bins(candidates: Candidates) -> Array:
    """(n,) numbers: grasps of one kind that come from the same side are in one bin."""
    approach = P.rotate(candidates.pose[:, 3:], np.array([0.0, 0.0, 1.0]))
    _, kind = np.unique(candidates.kind, return_inverse=True)
    return kind * len(_AXES) + (approach @ _AXES.T).argmax(axis=1)


def diverse(candidates: Candidates, score: Array, count: int) -> Array:
    """Indices of at most `count`: from each bin its best, then what is farthest from those taken, bin after bin.

    A grasp and the same with the fingers changed round count as one place.
    """
    place = bins(candidates)
    groups = [np.flatnonzero(place == number) for number in np.unique(place)]
    orders = [_spread(candidates.pose[group], score[group], count) for group in groups]
    chosen: list[int] = []
    for turn in range(max((len(order) for order in orders), default=0)):
        chosen += [int(group[order[turn]]) for group, order in zip(groups, orders, strict=True) if turn < len(order)]
    return np.array(chosen[:count], dtype=int)


def _spread(pose: Array, score: Array, count: int) -> list[int]:
    order = [int(score.argmax())]
    apart = distance(pose, pose[order[0]])
    while len(order) < min(count, len(pose)):
        order.append(int(apart.argmax()))
        apart = np.minimum(apart, distance(pose, pose[order[-1]]))
    return order


def distance(pose: Array, other: Array) -> Array:
    """(n,) how far grasps (n, 7) are from one (7,) [m], turns counted as lengths."""
    turned = P.multiply(other[3:], np.array([0.0, 0.0, 1.0, 0.0]))  # half a turn about the approach
    angles = [P.angle_between(pose[:, 3:], np.broadcast_to(q, (len(pose), 4))) for q in (other[3:], turned)]
    return P.norm(pose[:, :3] - other[:3]) + RADIAN * np.minimum(*angles)
