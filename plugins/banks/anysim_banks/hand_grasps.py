"""Grasps of a hand with several fingers: wrist poses by synergies; the bar that is wrapped lies across the fingers.

The tool's x is along the piece's longest axis, as the palm of a hand lies on a bottle, and its z comes from any side.
Where that axis passes the tool, how far from the palm and how far along the fingers, is sampled too.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Sphere
from anysim_banks.collision import MARGIN, geometry_of
from anysim_banks.hand import Hand
from anysim_banks.hand_trial import CLOSING, LINKS, PRESS, RATE, TOUCH, HandTrial
from anysim_banks.method import Tried, within_region
from anysim_banks.pieces import Piece
from anysim_banks.sampling import USED, Candidates, tool_turn
from anysim_banks.subject import Subject
from anysim_banks.trial import CREEP, HARDEST, LONG, SHIFT, TURN

ALONG, OUT = (-0.04, 0.03), (-0.03, 0.02)
"""[m] where the axis passes the tool: along the fingers (y), and out of the palm (z)."""
THICKEST = 0.09
"""[m] across: what fingers go around."""
WAYS = (0.0, 0.04, 0.08)
"""[m] before the grasp, at which the open hand must be free."""


class HandGrasps(NamedTuple):
    """Grasps of a subject with such a hand."""

    subject: Subject
    tool: Hand

    def sampled(self, count: int, rng: np.random.Generator) -> Candidates:
        """At most `count` grasps, alike many on each piece that is not too thick; the kind is the synergy."""
        names, found = np.array(list(self.tool.synergies)), []
        fit = [(i, piece, *_bar(piece)) for i, piece in enumerate(self.subject.pieces)]
        fit = [one for one in fit if one[4] <= THICKEST]
        for number, piece, axis, half, across in fit:
            n = -(-count // len(fit))
            turn = rng.uniform(0, 2 * np.pi, n)
            first, second = np.roll(np.eye(3), -axis, axis=1)[:, [1, 2]].T
            x = np.eye(3)[axis] * rng.choice([-1.0, 1.0], n)[:, None]
            z = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
            quaternion = tool_turn(np.cross(z, x), z)
            middle = np.zeros((n, 3))
            middle[:, axis] = USED * half * rng.uniform(-1, 1, n)
            place = np.stack([np.zeros(n), rng.uniform(*ALONG, n), rng.uniform(*OUT, n)], axis=1)
            local = np.concatenate([middle - P.rotate(quaternion, place), quaternion], axis=1)
            pose = P.compose(np.broadcast_to(piece.pose, local.shape), local)
            found.append(Candidates(pose, np.full(n, across), rng.choice(names, n), np.full(n, number)))
        if not found:
            rows = np.zeros(0)
            return Candidates(np.zeros((0, 7)), rows, np.zeros(0, dtype="<U16"), np.zeros(0, dtype=int))
        whole = Candidates(*(np.concatenate(column) for column in zip(*found, strict=True)))
        return within_region(whole.take(rng.permutation(len(whole.width))[:count]), self.subject)

    def free(self, candidates: Candidates) -> Array:
        """(n,) bool: the open hand touches nothing, at the grasp and on its way there."""
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        request, result = coal.CollisionRequest(), coal.CollisionResult()
        request.security_margin = MARGIN
        around = [(geometry_of(piece), _transform(coal, piece.pose)) for piece in self.subject.around]
        hand = [(geometry_of(piece), piece.pose) for piece in self.tool.pieces]
        free = np.ones(len(candidates.width), dtype=bool)
        for row, pose in enumerate(candidates.pose):
            ways = [P.compose(pose, np.array([0.0, 0.0, -way, 0.0, 0.0, 0.0, 1.0])) for way in WAYS]
            for shape, where in ((s, _transform(coal, P.compose(way, p))) for way in ways for s, p in hand):
                result.clear()
                if any(coal.collide(shape, where, other, there, request, result) for other, there in around):
                    free[row] = False
                    break
        return free

    def trial(self, engine: str) -> Tried:
        return HandTrial(self.tool, self.subject, engine)

    def about(self) -> Mapping[str, object]:
        test = {"hardest": HARDEST, "shift": SHIFT, "turn": TURN, "long": LONG, "creep": list(CREEP)}
        closing = {"links": LINKS, "rate": RATE, "press": PRESS, "touch": TOUCH, "steps": CLOSING}
        postures = {name: posture.tolist() for name, posture in self.tool.synergies.items()}
        hand = {"joints": list(self.tool.joints), "opened": self.tool.opened.tolist(), "synergies": postures}
        return {"hand": hand, "test": test | closing}

    def failed(self, raw: int, free: int, held: int) -> str:
        return (
            f"no grasp of {self.subject.asset} {self.subject.affordance.name} with the hand of {self.tool.name} was "
            f"held: {raw} were sampled on what is at most {THICKEST:g} m thick, {free} free of collision, {held} held, "
            "none of those for half a second; another affordance may do"
        )


def _bar(piece: Piece) -> tuple[int, float, float]:
    """The longest axis of a piece, half its length and how thick it is across that [m]."""
    match piece.shape:
        case Box(half):
            size = np.array(half)
        case Sphere(radius):
            size = np.full(3, radius)
        case Capsule(radius, half):
            size = np.array([radius, radius, half + radius])
        case Cylinder(radius, half):
            size = np.array([radius, radius, half])
        case _:
            assert piece.hull is not None  # of a mesh; pieces have no other shapes
            size = np.abs(piece.hull.corners.reshape(-1, 3)).max(axis=0)
    axis = int(np.argmax(size))
    return axis, float(size[axis]), 2.0 * float(np.delete(size, axis).max())


def _transform(coal: Any, pose: Array) -> Any:
    return coal.Transform3s(P.to_matrix(pose[3:]), pose[:3])
