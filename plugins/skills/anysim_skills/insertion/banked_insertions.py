"""Insertions from banks: with which of the turns that were tried a held thing goes into a hole."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import SpecError, SpecIssue, listing
from anysim.math import pose as P
from anysim.model.affordance_lookup import asset_hash
from anysim.skills.bank import Bank
from anysim.task.env import TaskEnv
from anysim.task.scene import BodyFrame, Frame, ObjectView
from anysim_skills.grasping.bank_files import KEYS, Banks
from anysim_skills.grasping.banked_choice import BankedChoice

_BACK = np.array([1.0, 0.0, 0.0, 0.0])
"""From a candidate's frame, whose z is ahead, to a tip's, whose z points back: half a turn about x."""


class OfTip(NamedTuple):
    """For a thing of a digest, whose tip is at a pose in its frame."""

    name: str
    hash: str
    tip: Array

    def holds(self, bank: Bank) -> bool:
        tip = np.array(bank.provenance.get("tip", ()), dtype=float)
        return bank.gripper_hash == self.hash and tip.shape == (7,) and bool(np.allclose(tip, self.tip, atol=1e-6))

    def otherwise(self, banks: Sequence[Bank]) -> tuple[str, str]:
        has = listing(sorted({bank.gripper for bank in banks}))
        return f"is for something else than '{self.name}' as it is here (banks: {has})", ""


class BankedInsertions(BankedChoice):
    """Insertions of `object` at its `tip` into the hole whose `mouth` is a frame of another object."""

    def __init__(
        self,
        env: TaskEnv,
        object: ObjectView,
        tip: Frame,
        mouth: Frame,
        bank: Path,
        living: Path | None = None,
        pinned: str = "",
        keys: tuple[str, str] = KEYS,
    ) -> None:
        """As of `BankedGrasps`.

        Raises:
            SpecError: at `bank`: there is none of this hole and tip on this engine; at `pinned`: other counts.
        """
        world = env.engine.world
        if not isinstance(mouth, BodyFrame) or not isinstance(tip, BodyFrame) or mouth.index.body < 0:
            words = f"'{mouth.name}' and '{tip.name}' have to be frames of one asset each for insertions from a bank"
            raise SpecError([SpecIssue("", keys[0], words)])
        self._body = mouth.index.body
        hole = world.body_entity[self._body]
        slot = next(name for name, slot in world.logical_objects.items() if hole in slot.entities)
        held = object.entities[0]
        place = np.array([*tip.index.position, *tip.index.quaternion])
        fit = OfTip(tip.name, asset_hash(world, held, held.root), place)
        banks = Banks(env, fit, ObjectView(env.scene, slot), bank, living, pinned, self._body, keys)
        super().__init__(env, ObjectView(env.scene, slot), banks, banks.score.shape[1])

    def good(self, ids: Array) -> Array:
        """(n, g) bool, of the goal sets: as good as the best of those that were not given up."""
        _, score = self.offer(ids, self.banks.score[self.which(ids)].copy())
        return self.alike(ids, np.isfinite(score))

    def turns(self, ids: Array) -> Array:
        """(n, g, 4) the tip's orientations in the world in these envs' goal sets."""
        body = self._env.scene.state.body_pose[ids, self._body, 3:]
        local = self.banks.pose[self.which(ids)[:, None], self._page[ids], 3:]
        return P.multiply(P.multiply(body[:, None], local), np.broadcast_to(_BACK, local.shape))

    def turn(self, ids: Array, now: Array) -> Array:
        """(n, 4) the chosen orientation of tips (n, 4); the nearest of the good ones where none is chosen."""
        good, turns = self.good(ids), self.turns(ids)
        apart = P.angle_between(np.broadcast_to(now[:, None], turns.shape), turns)
        chosen = self._page[ids] == self.number[ids, None]
        place = np.where(chosen.any(axis=1), chosen.argmax(axis=1), np.where(good, apart, np.inf).argmin(axis=1))
        return turns[np.arange(len(ids)), place]
