"""Pads: hands that hold cloth or a rope by the points which were nearest when they closed, or that pinch cloth.

Sticky pads are a declared approximation: nothing slips. Of a pinch friction decides. Either way the hand's links touch
it in no other place. Which points are held, and where in the hand, is part of the family's memory.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, PluginError
from anysim.families.base import Family, FamilySetting
from anysim.math import pose as P
from anysim_soft.pinch import Jaw, PadContact, jaw_of
from anysim_soft.spec import PadSpec
from anysim_soft.subworld import Slots

OPEN, HOLDING, EMPTY = 0, 1, 2
STAGES = ("open", "holding", "empty")
"""A pad that has closed on nothing, or whose cloth came off, is empty until it opens; one that pinches, while it is."""
PRESSED = 0.5
"""Of its force, with which both pads press when a pinch begins: slip is measured from there."""
TOUCHING = 0.001
"""[m] between pads that have closed on nothing."""
PINCHED = 32
"""Points between the pads of a pinch that are remembered at most, those nearest to its frame."""


class Pads:
    """The P pads of a garment or a rope, each with up to K points.

    Attributes:
        stage: (N, P) an index into STAGES.
        force: (N, P) [N] with which it pulls at each, or with which each of two pads presses that pinch.
        slip: (N, P) [m] of a pinch: how far what was between the pads at first has moved in the hand, the median.
    """

    stage: Array
    force: Array

    def __init__(self, setting: FamilySetting, specs: Mapping[str, PadSpec]) -> None:
        self.names, self.specs = tuple(specs), tuple(specs.values())
        self._sticky = np.array([n for n, spec in enumerate(self.specs) if spec.grip == "sticky"], dtype=np.intp)
        self._pinching = np.array([n for n, spec in enumerate(self.specs) if spec.grip == "pinch"], dtype=np.intp)
        self._slots = max((self.specs[n].points for n in self._sticky), default=0)
        self._most = max(self._slots, PINCHED) if len(self._pinching) else self._slots
        engine, self._world = setting.engine, setting.engine.world
        self._frames, self._joints = [], np.zeros(len(self.specs), dtype=np.intp)
        for number, (name, spec) in enumerate(specs.items()):
            try:
                self._frames.append(engine.index.frame(spec.tool))
                self._joints[number] = engine.index.joint(spec.joint)
            except AnysimError as error:
                raise setting.fault(f"pads.{name}", str(error)) from None
        self._path = f"world.families.{setting.name}.pads"
        self._jaws: list[Jaw] = []
        self._closed = np.array([spec.closed for spec in self.specs])

    @property
    def pinch(self) -> bool:
        """One of them pinches."""
        return len(self._pinching) > 0

    def __len__(self) -> int:
        return len(self.specs)

    def remember(self, family: Family, points: int, faces: int) -> None:
        """Make the arrays of the memory of a family with so many points and triangles."""
        p, k = len(self), self._most
        self.stage = family.remember("pad_stage", p, dtype=np.int64, bounds=(0, len(STAGES) - 1))
        self._count = family.remember("pad_count", p, dtype=np.int64, bounds=(0, k))
        self._nodes = family.remember("pad_points", p, k, dtype=np.int64, bounds=(0, points - 1))
        self._anchors = family.remember("pad_anchors", p, k, 3)
        self.force = family.remember("pad_force", p)
        if len(self._pinching):
            self._spots = family.remember("pad_spots", p, k, dtype=np.int64, bounds=(0, max(faces - 1, 0)))
            self._known = family.remember("pad_known", p, dtype=np.int64, bounds=(0, k))
            self._shares, self.slip = family.remember("pad_shares", p, k, 3), family.remember("pad_slip", p)

    def slots(self, met: Array) -> Slots:
        """K connections for each sticky pad, a jaw for each that pinches; its body and what hangs on it are silent."""
        places, silent = [], set[int]()
        number = {int(body): place for place, body in enumerate(met)}
        for name, spec, frame in zip(self.names, self.specs, self._frames, strict=True):
            if frame.body not in number:
                raise PluginError(
                    f"{self._path}.{name}.tool: its body neither moves nor collides; a pad is on a robot's hand"
                )
            if spec.grip == "sticky":
                places += [number[frame.body]] * self._slots
            silent |= {place for body, place in number.items() if self._hangs(body, frame.body)}
        if not self._jaws:
            self._jaws = [self._jaw(n, number) for n in self._pinching.tolist()]
        return Slots(places, frozenset(silent), self._jaws)

    def _jaw(self, pad: int, number: Mapping[int, int]) -> Jaw:
        frame, spec = self._frames[pad], self.specs[pad]
        try:
            return jaw_of(self._world, frame, int(self._joints[pad]), number[frame.body], spec.size, spec.force)
        except PluginError as error:
            raise PluginError(f"{self._path}.{self.names[pad]}.joint: {error}") from None

    def _hangs(self, body: int, on: int) -> bool:
        while body >= 0:
            if body == on:
                return True
            body = self._world.bodies[body].parent
        return False

    # ------------------------------------------------------------------ in each step

    def look(self, env_ids: Array, points: Array, body_pose: Array, joint_pos: Array) -> None:
        """Take hold, or let go, in envs whose points are at (n, V, 3), bodies at (n, B, 7), joints at (n, J)."""
        for number in self._sticky.tolist():
            spec, frame = self.specs[number], self._frames[number]
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
        own, slots = self._sticky, slice(self._slots)
        holding = np.arange(self._slots) < self._count[env, own, None]
        return self._nodes[env, own, slots].ravel(), self._anchors[env, own, slots].reshape(-1, 3), holding.ravel()

    def felt(self, env: int, pulls: Array) -> None:
        """Note forces (S, 3) of the last step at the slots."""
        if len(self._sticky):
            self.force[env, self._sticky] = P.norm(pulls.reshape(len(self._sticky), self._slots, 3).sum(axis=1))

    # ------------------------------------------------------------------ pinches

    def openings(self, joint_pos: Array) -> Array:
        """(J, 2) [m] how far the fingers of hands that pinch are from the middle, of joints at (J',)."""
        return np.array([joint_pos[list(jaw.joints)] - jaw.lower for jaw in self._jaws]).reshape(-1, 2)

    def shut(self, joint_pos: Array) -> Array:
        """(J,) bool: the hands that pinch are closed."""
        return joint_pos[self._joints[self._pinching]] <= self._closed[self._pinching]

    def pinched(self, env: int, points: Array, faces: Array, shut: Array, pressed: Sequence[PadContact]) -> None:
        """Note what is between pads, of points (V, 3) [m] and triangles (F, 3); `shut` (J,): which hands are closed."""
        for number, closed, found in zip(self._pinching.tolist(), shut.tolist(), pressed, strict=True):
            both, known = float(found.force.min()), int(self._known[env, number]) if closed else 0
            self.force[env, number], self._count[env, number] = found.force.mean() if closed else 0.0, 0
            if closed and not known and found.resting and both >= PRESSED * self.specs[number].force:
                known = min(len(found.faces), self._most)
                corners = points[faces[found.faces[:known]]]
                self._spots[env, number, :known] = found.faces[:known]
                self._shares[env, number, :known] = shares = _shares(corners, found.places[:known])
                self._anchors[env, number, :known] = _in_hand(shares, corners, found.hand)
            self._known[env, number] = known
            self.slip[env, number] = self._slipped(env, number, points, faces, found.hand) if known else 0.0
            if known and both > 0.0:
                tool = found.hand[:3] + P.rotate(found.hand[3:], np.array(self._frames[number].position))
                held = np.unique(faces[found.faces])
                held = held[np.argsort(P.norm(points[held] - tool), kind="stable")[: self._most]]
                self._count[env, number], self._nodes[env, number, : len(held)] = len(held), held
                self.stage[env, number] = HOLDING
            else:
                self.stage[env, number] = EMPTY if known or (closed and found.gap < TOUCHING) else OPEN

    def _slipped(self, env: int, number: int, points: Array, faces: Array, hand: Array) -> float:
        """[m] how far what was between the pads at first has moved in the hand: the median."""
        spots = slice(int(self._known[env, number]))
        corners = points[faces[self._spots[env, number, spots]]]
        moved = _in_hand(self._shares[env, number, spots], corners, hand) - self._anchors[env, number, spots]
        return float(np.median(P.norm(moved)))

    # ------------------------------------------------------------------ what others see

    def points(self, env_ids: Array, count: int, *, pinched: bool = False) -> Array:
        """(n, V) bool: which of `count` points are held, or pinched: those of triangles that such pads press on."""
        found = np.zeros((len(env_ids), count), dtype=bool)
        for number in self._pinching.tolist() if pinched else range(len(self)):
            holding = np.arange(self._most) < self._count[env_ids, number, None]
            rows, slots = np.nonzero(holding)
            found[rows, self._nodes[env_ids[rows], number, slots]] = True
        return found

    def facts(self, env: int) -> dict[str, dict[str, object]]:
        """What can be said of each pad."""
        said: dict[str, dict[str, object]] = {
            name: {
                "stage": STAGES[int(self.stage[env, number])],
                "points": self._nodes[env, number, : self._count[env, number]].tolist(),
                "force": float(self.force[env, number]),
            }
            for number, name in enumerate(self.names)
        }
        for number in self._pinching.tolist():
            said[self.names[number]]["slip"] = float(self.slip[env, number])
        return said


def _shares(corners: Array, places: Array) -> Array:
    """(n, 3) barycentric coordinates of places (n, 3) in triangles (n, 3, 3), each of what is nearest in its plane."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    to = places - corners[:, 0]
    aa, ab, bb, at, bt = P.dot(a, a), P.dot(a, b), P.dot(b, b), P.dot(a, to), P.dot(b, to)
    size = np.maximum(aa * bb - ab * ab, 1e-18)
    u, v = (bb * at - ab * bt) / size, (aa * bt - ab * at) / size
    found = np.clip(np.stack([1.0 - u - v, u, v], axis=1), 0.0, 1.0)
    return found / found.sum(axis=1, keepdims=True)


def _in_hand(shares: Array, corners: Array, hand: Array) -> Array:
    """(n, 3) [m] places in triangles (n, 3, 3) by barycentric coordinates (n, 3), in the frame of a hand (7,)."""
    places = np.einsum("nc,nci->ni", shares, corners) - hand[:3]
    return P.rotate_inverse(np.broadcast_to(hand[3:], (len(places), 4)), places)
