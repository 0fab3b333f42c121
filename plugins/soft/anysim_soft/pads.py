"""Sticky pads: hands that hold cloth or a rope by the points which were nearest when they closed.

A declared approximation of fingers that pinch it: nothing slips, and the hand's links touch it in no other place.
Which points are held, and where in the hand, is part of the family's memory.
"""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, PluginError
from anysim.families.base import Family, FamilySetting
from anysim.math import pose as P
from anysim_soft.spec import PadSpec
from anysim_soft.subworld import Slots

OPEN, HOLDING, EMPTY = 0, 1, 2
STAGES = ("open", "holding", "empty")
"""A pad that has closed on nothing, or whose cloth came off, is empty until it opens."""


class Pads:
    """The P pads of a garment or a rope, each with up to K points.

    Attributes:
        stage: (N, P) an index into STAGES.
        force: (N, P) [N] with which it pulls at each.
    """

    stage: Array
    force: Array

    def __init__(self, setting: FamilySetting, specs: Mapping[str, PadSpec]) -> None:
        self.names, self.specs = tuple(specs), tuple(specs.values())
        self._most = max((spec.points for spec in self.specs), default=0)
        engine, self._world = setting.engine, setting.engine.world
        self._frames, self._joints = [], np.zeros(len(self.specs), dtype=np.intp)
        for number, (name, spec) in enumerate(specs.items()):
            path = f"world.families.{setting.name}.pads.{name}"
            try:
                self._frames.append(engine.index.frame(spec.tool))
                self._joints[number] = engine.index.joint(spec.joint)
            except AnysimError as error:
                raise PluginError(f"{path}: {error}") from None
        self._path = f"world.families.{setting.name}.pads"
        self._closed = np.array([spec.closed for spec in self.specs])

    def __len__(self) -> int:
        return len(self.specs)

    def remember(self, family: Family, points: int) -> None:
        """Make the arrays of the memory of a family with so many points."""
        p, k = len(self), self._most
        self.stage = family.remember("pad_stage", p, dtype=np.int64, bounds=(0, len(STAGES) - 1))
        self._count = family.remember("pad_count", p, dtype=np.int64, bounds=(0, k))
        self._nodes = family.remember("pad_points", p, k, dtype=np.int64, bounds=(0, points - 1))
        self._anchors = family.remember("pad_anchors", p, k, 3)
        self.force = family.remember("pad_force", p)

    def slots(self, met: Array) -> Slots:
        """K connections for each pad; its body, and what hangs on it, does not touch it."""
        places, silent = [], set[int]()
        number = {int(body): place for place, body in enumerate(met)}
        for name, frame in zip(self.names, self._frames, strict=True):
            if frame.body not in number:
                raise PluginError(
                    f"{self._path}.{name}.tool: its body neither moves nor collides; a pad is on a robot's hand"
                )
            places += [number[frame.body]] * self._most
            silent |= {place for body, place in number.items() if self._hangs(body, frame.body)}
        return Slots(places, frozenset(silent))

    def _hangs(self, body: int, on: int) -> bool:
        while body >= 0:
            if body == on:
                return True
            body = self._world.bodies[body].parent
        return False

    # ------------------------------------------------------------------ in each step

    def look(self, env_ids: Array, points: Array, body_pose: Array, joint_pos: Array) -> None:
        """Take hold, or let go, in envs whose points are at (n, V, 3), bodies at (n, B, 7), joints at (n, J)."""
        for number, (spec, frame) in enumerate(zip(self.specs, self._frames, strict=True)):
            closed = joint_pos[:, self._joints[number]] <= self._closed[number]
            stage = self.stage[env_ids, number]
            opened, closing = env_ids[~closed], np.flatnonzero(closed & (stage == OPEN))
            lost = env_ids[closed & (stage == HOLDING) & (self.force[env_ids, number] > spec.force)]
            for rows, becomes in ((opened, OPEN), (lost, EMPTY)):
                self.stage[rows, number], self._count[rows, number], self.force[rows, number] = becomes, 0, 0.0
            for row in closing.tolist():
                env, pose = int(env_ids[row]), body_pose[row, frame.body]
                at = pose[:3] + P.rotate(pose[3:], np.array(frame.position))
                away = P.norm(points[row] - at)
                nearest = np.argsort(away, kind="stable")[: spec.points]
                nearest = nearest[away[nearest] <= spec.reach]
                count = len(nearest)
                self.stage[env, number], self._count[env, number] = (HOLDING if count else EMPTY), count
                self._nodes[env, number, :count] = nearest
                anchors = P.rotate_inverse(np.broadcast_to(pose[3:], (count, 4)), points[row, nearest] - pose[:3])
                self._anchors[env, number, :count] = anchors

    def held(self, env: int) -> tuple[Array, Array, Array]:
        """Of each slot: the point (S,), where it is held in the body's frame (S, 3), and whether it is (S,)."""
        holding = np.arange(self._most) < self._count[env, :, None]
        return self._nodes[env].ravel(), self._anchors[env].reshape(-1, 3), holding.ravel()

    def felt(self, env: int, pulls: Array) -> None:
        """Note forces (S, 3) of the last step."""
        if len(self):
            self.force[env] = P.norm(pulls.reshape(len(self), self._most, 3).sum(axis=1))

    # ------------------------------------------------------------------ what others see

    def points(self, env_ids: Array, count: int) -> Array:
        """(n, V) bool: which of `count` points are held."""
        found = np.zeros((len(env_ids), count), dtype=bool)
        for number in range(len(self)):
            holding = np.arange(self._most) < self._count[env_ids, number, None]
            rows, slots = np.nonzero(holding)
            found[rows, self._nodes[env_ids[rows], number, slots]] = True
        return found

    def facts(self, env: int) -> dict[str, dict[str, object]]:
        """What can be said of each pad."""
        return {
            name: {
                "stage": STAGES[int(self.stage[env, number])],
                "points": self._nodes[env, number, : self._count[env, number]].tolist(),
                "force": float(self.force[env, number]),
            }
            for number, name in enumerate(self.names)
        }
