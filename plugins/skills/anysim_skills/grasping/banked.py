"""Grasps of an object from banks: the best of those that the hand can be brought to.

Of an object that can be several assets each has its own banks.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView
from anysim_skills.arm import Arm
from anysim_skills.grasping.bank_files import Banks, Fit, OfGripper
from anysim_skills.grasping.banked_choice import BankedChoice
from anysim_skills.grasping.hand_room import hand_geoms, has_room
from anysim_skills.object_shapes import ObjectShapes

GOALS = 16
"""So many candidates are a goal set; the next ones where none of them can be reached."""
CLEARANCE = -0.002
"""[m] the hand stays so far above what the object rests on; the box around a pad reaches a little further than it."""

WITHOUT_ROOM = 1e6
"""By which a grasp scores less where the robot's own hand touches more of a thing than the bank's gripper does."""

BankFile = Annotated[Path | None, Field(description="a bank of grasps, or a folder of banks; none: from above")]
CountsFolder = Annotated[Path | None, Field(description="keeps outcomes of the bank's candidates, and goes by them")]
Pinned = Annotated[str, Field(description="version of the counts that are believed; none are added to them")]


class BankedGrasps(BankedChoice):
    """Grasps of `object` with the hand of `arm` in all envs."""

    def __init__(
        self,
        env: TaskEnv,
        arm: Arm,
        object: ObjectView,
        bank: Path,
        living: Path | None = None,
        pinned: str = "",
        body: int | None = None,
        fit: Fit | None = None,
        goals: int = GOALS,
    ) -> None:
        """`bank` is a file or a folder, `living` a folder of counts, which must be of the version `pinned` if given.

        `body` is the part of the object that is held, by its number in the World; None: its root. `fit` is the hand;
        None: a gripper with two fingers. `goals` bounds a goal set.

        Raises:
            SpecError: at `bank`: there is none of this object, for this gripper and engine; at `pinned`: other counts.
        """
        banks = Banks(env, fit or OfGripper(arm.aperture), object, bank, living, pinned, body)
        super().__init__(env, object, banks, goals)
        self._shapes = ObjectShapes(env.scene, object)
        self._hand = _corners(arm)
        self._room = np.ones((2, *self.banks.score.shape), dtype=bool)
        """(2, E, G) either way round; only looked at for parts of furniture, which is all around."""
        self._liked = self.banks.score.copy()
        for row, entity in enumerate(object.entities):
            if body is not None:
                self._room[:, row] = [has_room(arm, entity, body, way) for way in _both(self.banks.pose[row])]
            elif fit is None:
                self._liked[row] -= WITHOUT_ROOM * ~has_room(arm, entity, entity.root, self.banks.pose[row])

    def goals(
        self, ids: Array, held_pose: Array, hover: float, object_pose: Array | None = None
    ) -> tuple[Array, Array]:
        """Goal sets of these envs, best first: tool poses (n, g, 7), and widths (n, g) [m].

        What the hand cannot be brought to, within `hover` [m] of it, for what the object stands on has infinite width.
        The held bodies are at (n, 7), the objects at (n, 7) where those are not their roots.
        """
        which, rows = self.which(ids), np.arange(len(ids))[:, None]
        poses = P.compose(held_pose[:, None], self.banks.pose[which])
        low = np.minimum(self._lowest(poses), self._lowest(before(poses, hover)))
        root = held_pose if object_pose is None else object_pose
        floor = root[:, 2] - self._shapes.below(ids, root)
        page, score = self.offer(ids, np.where(low > floor[:, None] + CLEARANCE, self._liked[which], -np.inf))
        return poses[rows, page], np.where(np.isfinite(score), self.banks.width[which[:, None], page], np.inf)

    def both_ways(self, ids: Array, goals: Array) -> tuple[Array, Array]:
        """Goal sets (n, g, 7) as they are, and with the two fingers changed round: tool poses (2, n, g, 7).

        And (2, n, g) bool: the arm's own hand has room there beside what is around the part.
        """
        return _both(goals), self._room[:, self.which(ids)[:, None], self._page[ids]]

    def position(self, ids: Array, held_pose: Array) -> Array:
        """(n, 3) where the chosen grasps of bodies (n, 7) are."""
        local = self.banks.pose[self.which(ids), self.number[ids], :3]
        return held_pose[:, :3] + P.rotate(held_pose[:, 3:], local)

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
