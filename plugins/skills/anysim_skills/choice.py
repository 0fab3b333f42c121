"""Choices among candidates: the one that needs the least motion, then the next where that has failed."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.phases import Rung
from anysim_skills.arm import Arm


class Choice:
    """Candidates of each env in the order of their effort, and how many of them have been given up."""

    def __init__(self, num_envs: int, count: int) -> None:
        self._order = np.zeros((num_envs, count), dtype=np.int64)
        self._reachable, self._given_up = np.zeros((2, num_envs), dtype=np.int64)

    def again(self, ids: Array | int) -> None:
        """None has been given up in these envs."""
        self._given_up[ids] = 0

    def next(self, env: int) -> bool:
        """Give the present one up; False if it was the last that can be reached."""
        left = bool(self._given_up[env] + 1 < self._reachable[env])
        self._given_up[env] += left
        return left

    def choose(self, ids: Array, effort: Array) -> Array:
        """(n,) the candidate of each of these envs, of efforts (n, count), infinite for what cannot be reached."""
        self._order[ids] = np.argsort(effort, axis=1, kind="stable")
        self._reachable[ids] = np.isfinite(effort).sum(axis=1)
        return self._order[ids, np.minimum(self._given_up[ids], effort.shape[1] - 1)]

    def least_motion(self, arm: Arm, ids: Array, ways: Array, excluded: Array | None = None) -> Array:
        """(n,) the candidate whose way moves `arm` least, of ways (n, count, s, 7) of tool poses in the world.

        `excluded` (n, count) bool are not to be chosen. A way counts as much as the pose of it that is furthest off.
        """
        effort = arm.reach(ids, ways.reshape(len(ids), -1, 7))[1].reshape(ways.shape[:3]).max(axis=2)
        return self.choose(ids, effort if excluded is None else np.where(excluded, np.inf, effort))

    def retry(self, rung: Rung, env: int, same: tuple[Rung, ...] = (Rung.RESAMPLE, Rung.BACK_OFF)) -> int | None:
        """The first phase after the rungs `same`, and after others as long as another candidate is left."""
        again = rung in same or (rung in (Rung.CANDIDATE, Rung.RESAMPLE) and self.next(env))
        return 0 if again else None

    def none_left(self, ids: Array) -> Array:
        """(n,) bool: no candidate can be reached that has not been given up."""
        return self._reachable[ids] <= self._given_up[ids]


def turns_against(frames: Array, count: int) -> Array:
    """(n, count, 4) orientations of a tool whose z is against that of frames (n, 4), evenly about it."""
    half = np.pi / count * np.arange(count)
    return P.multiply(frames[:, None], np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)[None])
