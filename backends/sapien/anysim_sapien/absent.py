"""Stand-ins for absent bodies, so that reads of all bodies need not ask."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array

_ZERO = np.zeros(3, dtype=np.float32)
_ZERO.setflags(write=False)


class _Frame(NamedTuple):
    p: Array = _ZERO


class _Nobody(NamedTuple):
    """What is read of a component."""

    linear_velocity: Array = _ZERO
    angular_velocity: Array = _ZERO
    cmass_local_pose: _Frame = _Frame()


NOBODY = _Nobody()
"""In the place of the component of a body that is not there; a joint that is not there is None."""

NOWHERE = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], dtype=np.float32)
"""Its pose, in SAPIEN's order of a packed one."""
