"""Grasps of an object from banks: the best of those that the hand can be brought to, and what became of them.

Of an object that can be several assets each has its own banks. Where outcomes are kept, an episode counts for the grasp
that fingers last closed in, and a grasp that is begun anew in it against the one before.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView
from anysim_skills.arm import Arm
from anysim_skills.grasping.bank_files import Banks
from anysim_skills.grasping.hand_room import hand_geoms, has_room
from anysim_skills.grasping.outcomes import OUTCOMES
from anysim_skills.object_shapes import ObjectShapes

GOALS = 16
"""So many candidates are a goal set; the next ones where none of them can be reached."""
CLEARANCE = -0.002
"""[m] the hand stays so far above what the object rests on; the box around a pad reaches a little further than it."""

BankFile = Annotated[Path | None, Field(description="a bank of grasps, or a folder of banks; none: from above")]
CountsFolder = Annotated[Path | None, Field(description="keeps outcomes of the bank's candidates, and goes by them")]
Pinned = Annotated[str, Field(description="version of the counts that are believed; none are added to them")]


class BankedGrasps:
    """Candidates of `object` for `arm` in all envs.

    Attributes:
        number: (N,) the chosen candidate of each env, -1: none.
    """

    def __init__(
        self,
        env: TaskEnv,
        arm: Arm,
        object: ObjectView,
        bank: Path,
        living: Path | None = None,
        pinned: str = "",
        body: int | None = None,
    ) -> None:
        """`bank` is a file or a folder, `living` a folder of counts, which must be of the version `pinned` if given.

        `body` is the part of the object that is held, by its number in the World; None: its root.

        Raises:
            SpecError: at `bank`: there is none of this object, for this gripper and engine; at `pinned`: other counts.
        """
        self._env, self._object = env, object
        self.banks = Banks(env, arm.aperture, object, bank, living, pinned, body)
        self._shapes = ObjectShapes(env.scene, object)
        self._hand = _corners(arm)
        n, count = env.num_envs, self.banks.score.shape[1]
        self.number, self._closed = np.full((2, n), -1)
        self._entity = np.zeros(n, dtype=np.int64)
        self._given_up = np.zeros((n, count), dtype=bool)
        self._page, self._left = np.zeros((n, min(GOALS, count)), dtype=np.int64), np.zeros(n, dtype=np.int64)
        self._room = np.ones((2, *self.banks.score.shape), dtype=bool)
        """(2, E, G) either way round; only looked at for parts of furniture, which is all around."""
        if body is not None:
            for row, entity in enumerate(object.entities):
                self._room[:, row] = [has_room(arm, entity, body, way) for way in _both(self.banks.pose[row])]
        OUTCOMES.watch(env, self)

    @property
    def goal_count(self) -> int:
        """How many candidates a goal set has."""
        return self._page.shape[1]

    def goals(
        self, ids: Array, held_pose: Array, hover: float, object_pose: Array | None = None
    ) -> tuple[Array, Array]:
        """Goal sets of these envs, best first: tool poses (n, g, 7), and widths (n, g) [m].

        What the hand cannot be brought to, within `hover` [m] of it, for what the object stands on has infinite width.
        The held bodies are at (n, 7), the objects at (n, 7) where those are not their roots.
        """
        which = self._which(ids)
        poses = P.compose(held_pose[:, None], self.banks.pose[which])
        low = np.minimum(self._lowest(poses), self._lowest(before(poses, hover)))
        root = held_pose if object_pose is None else object_pose
        floor = root[:, 2] - self._shapes.below(ids, root)
        score = np.where(low > floor[:, None] + CLEARANCE, self.banks.score[which], -np.inf)
        score[self._given_up[ids]] = -np.inf
        page = np.argsort(-score, axis=1, kind="stable")[:, : self._page.shape[1]]
        rows = np.arange(len(ids))[:, None]
        fit = np.isfinite(score[rows, page])
        self._page[ids], self._left[ids] = page, np.isfinite(score).sum(axis=1)
        return poses[rows, page], np.where(fit, self.banks.width[which[:, None], page], np.inf)

    def both_ways(self, ids: Array, goals: Array) -> tuple[Array, Array]:
        """Goal sets (n, g, 7) as they are, and with the two fingers changed round: tool poses (2, n, g, 7).

        And (2, n, g) bool: the arm's own hand has room there beside what is around the part.
        """
        return _both(goals), self._room[:, self._which(ids)[:, None], self._page[ids]]

    def choose(self, ids: Array, place: Array, reachable: Array) -> None:
        """Take the candidates at these places (n,) of the goal sets; none where nothing is reachable (n,) bool."""
        self.number[ids] = np.where(reachable, self._page[ids, place], -1)

    def position(self, ids: Array, held_pose: Array) -> Array:
        """(n, 3) where the chosen grasps of bodies (n, 7) are."""
        local = self.banks.pose[self._which(ids), self.number[ids], :3]
        return held_pose[:, :3] + P.rotate(held_pose[:, 3:], local)

    def closed(self, ids: Array) -> None:
        """Fingers close in the chosen grasps."""
        self._closed[ids], self._entity[ids] = self.number[ids], self._which(ids)

    def start(self, ids: Array) -> None:
        """A grasp is begun; where one was made in this episode before, it did not hold."""
        self._failed(ids[self._closed[ids] >= 0])

    def give_up(self, env: int) -> bool:
        """Give the chosen candidate up, or all of the goal set if none could be reached; False if no other is left."""
        tried = self._page[env] if self.number[env] < 0 else self.number[env : env + 1]
        self._given_up[env, tried] = True
        self._failed(np.array([env])[self._closed[env : env + 1] >= 0])
        return bool(self._left[env] > len(tried))

    def again(self, env: int) -> None:
        """All candidates of an env may be chosen again."""
        self._given_up[env] = False

    def about(self, env: int) -> dict[str, object]:
        """Which candidate of which bank this is, for records."""
        return {"bank": self.banks.about | {"candidate": int(self.number[env])}}

    # ------------------------------------------------------------------ episodes, as an observer sees them

    def begun(self, ids: Array) -> None:
        """Episodes begin in these envs; those before them that were left early have failed."""
        self._failed(ids[self._closed[ids] >= 0])
        self._given_up[ids], self.number[ids] = False, -1

    def ended(self, ids: Array) -> None:
        """Episodes have ended in these envs."""
        own = ids[self._closed[ids] >= 0]
        won = self._env.status[own] == Status.SUCCESS
        self._note(own[won], success=True)
        self._failed(own[~won])

    def _failed(self, ids: Array) -> None:
        self._given_up[ids, self._closed[ids]] = True
        self._note(ids, success=False)

    def _note(self, ids: Array, success: bool) -> None:
        for which, number in zip(self._entity[ids].tolist(), self._closed[ids].tolist(), strict=True):
            self.banks.note(which, number, success)
        self._closed[ids] = -1

    def _which(self, ids: Array) -> Array:
        """(n,) which of the entities that it can be the object is."""
        if len(self._object.entities) == 1:
            return np.zeros(len(ids), dtype=np.int64)
        return np.argmax(self._env.scene.presence[ids][:, self._object.slot.entities], axis=1)

    def _lowest(self, poses: Array) -> Array:
        """(n, g) [m] the height of the hand's lowest point at tool poses (n, g, 7)."""
        vertical = P.to_matrix(poses[..., 3:])[..., 2, :]
        return poses[..., 2] + (vertical @ self._hand.T).min(axis=-1)


def before(poses: Array, hover: float) -> Array:
    """Tool poses (..., 7) drawn back by `hover` [m] against their approach."""
    back = np.array([0.0, 0.0, -hover, 0.0, 0.0, 0.0, 1.0])
    return P.compose(poses, np.broadcast_to(back, poses.shape))


def _both(poses: Array) -> Array:
    half = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    return np.stack([poses, P.compose(poses, np.broadcast_to(half, poses.shape))])


def _corners(arm: Arm) -> Array:
    """(K, 3) corners of the boxes around what collides of a hand as it begins, in its tool's frame."""
    meshes = {mesh.name: mesh for mesh in arm.env.engine.world.meshes}
    found = [
        _box(shape_bounds(geom.shape, np.array([*geom.position, *geom.quaternion]), meshes), to_tool)
        for geom, to_tool in hand_geoms(arm)
    ]
    return np.concatenate(found) if found else np.zeros((1, 3))


def _box(bounds: Sequence[Array], pose: Array) -> Array:
    """(8, 3) the corners of a box between its lowest and highest one, in a frame in which it has a pose (7,)."""
    corners = np.stack(np.meshgrid(*np.stack(bounds, axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    return pose[:3] + P.rotate(np.broadcast_to(pose[3:], (8, 4)), corners)
