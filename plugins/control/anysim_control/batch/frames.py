"""A chain in canonical form: every joint about or along the z axis of its frame, through its origin."""

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.kinematics.chain import Chain
from anysim.math import pose as P

LENGTH_PER_REACH = 0.3
"""The length that makes an angle comparable to a distance, as a part of the arm's reach. Needs the fewest iterations
on a Panda over 0.1 to 2 m (a third of them more at either end), and makes small arms behave as large ones."""


def canonical_frames(chain: Chain) -> Array:
    """Constant transforms [R | p] (K+1, 3, 4), one before each joint and one for the tool.

    They make the same chain, but every joint is about or along the z axis of its frame, through its origin.
    """
    frames = np.empty((len(chain) + 1, 3, 4))
    undo = P.pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION)  # from a joint's canonical frame back to its body's, at zero
    for k in range(len(chain)):
        align = P.pose(chain.anchor[k], P.from_matrix(_with_z(chain.axis[k])))
        _write(P.compose(P.compose(undo, chain.rest[k]), align), frames[k])
        undo = P.inverse(align)
    _write(P.compose(undo, chain.tool_offset), frames[-1])
    frames.setflags(write=False)
    return frames


def _write(pose: Array, frame: Array) -> None:
    frame[:, :3] = P.to_matrix(pose[3:])
    frame[:, 3] = pose[:3]


def _with_z(axis: Array) -> Array:
    """A rotation matrix (3, 3) whose third column is the unit vector `axis`."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(other, axis)
    x /= P.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
