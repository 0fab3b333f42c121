"""Choices among candidates: the one that needs the least motion, then the next where that has failed."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.phases import Rung
from anysim_skills.arm import Arm

POINTS = 4
"""Of a line of a few centimetres, at which the arm must reach it; four times as many on the way there."""
JUMP = 0.5
"""[rad] that no joint moves between two of them: more is another posture."""


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
        effort = arm.effort(ids, ways)
        return self.choose(ids, effort if excluded is None else np.where(excluded, np.inf, effort))

    def retry(self, rung: Rung, env: int, same: tuple[Rung, ...] = (Rung.RESAMPLE, Rung.BACK_OFF)) -> int | None:
        """The first phase after the rungs `same`, and after others as long as another candidate is left."""
        again = rung in same or (rung in (Rung.CANDIDATE, Rung.RESAMPLE) and self.next(env))
        return 0 if again else None

    def none_left(self, ids: Array) -> Array:
        """(n,) bool: no candidate can be reached that has not been given up."""
        return self._reachable[ids] <= self._given_up[ids]


def motion_along(arm: Arm, ids: Array, at: Array, ways: Array) -> Array:
    """(n, count, s) the joint motion to the first pose of ways (n, count, s, 7), as `arm` goes from where it is.

    From each pose on that is not reached straight, in one posture, from the one before, it is infinite. To the first
    one the arm may change its posture, to what it has there from where it began.
    """
    n, count = ways.shape[:2]
    shape = (n, count, len(arm.chain))
    live = np.broadcast_to(arm.env.scene.state.joint_pos[np.ix_(ids, arm.chain.joints)][:, None], shape)
    here = np.broadcast_to(arm.tool.pose[at][:, None], (n, count, 7))
    joints, straight = _along(arm, ids, here, ways[:, :, 0], live, 4 * POINTS)
    turned, reached = arm.reach(ids, ways[:, :, 0], np.broadcast_to(arm.chain.initial, shape))
    joints = np.where(straight[..., None], joints, turned)
    good = straight | np.isfinite(reached)
    motion, found = np.abs(joints - live).max(axis=2), [good]
    for number in range(1, ways.shape[2]):
        joints, on = _along(arm, ids, ways[:, :, number - 1], ways[:, :, number], joints, POINTS)
        found.append(found[-1] & on)
    return np.where(np.stack(found, axis=2), motion[..., None], np.inf)


def _along(arm: Arm, ids: Array, begin: Array, end: Array, joints: Array, points: int) -> tuple[Array, Array]:
    """Joints (n, count, K) at the ends of straight lines between poses (n, count, 7), and (n, count) if they get there.

    `joints` are those at the beginnings. How many points are looked at does not depend on the other envs.
    """
    one, other = begin.reshape(-1, 7), end.reshape(-1, 7)
    length, turn = P.norm(other[:, :3] - one[:, :3]), P.angle_between(one[:, 3:], other[:, 3:])
    good = np.ones(begin.shape[:2], dtype=bool)
    for share in np.arange(1, points + 1) / points:
        distance = np.where(length > 0.0, share * length, 1.0)
        pose = P.step_toward(one, other, distance, np.maximum(share * turn, 1e-9))
        joints, step = arm.reach(ids, pose.reshape(begin.shape), joints)
        good &= step < JUMP
    return joints, good


def turns_against(frames: Array, count: int) -> Array:
    """(n, count, 4) orientations of a tool whose z is against that of frames (n, 4), evenly about it."""
    half = np.pi / count * np.arange(count)
    return P.multiply(frames[:, None], np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)[None])
