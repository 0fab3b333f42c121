"""Reach of a robot: which grasps its arm is brought to from where it stands, and where it stands well.

A grasp is reached from a base pose if inverse kinematics has the hand before it, at it, and at it all along the way of
the joint that moves what is grasped. The arm's own way there, and what else stands about, are a planner's to judge.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim.api import compile_world
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.geometry.bounds import shape_bounds
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.api import inverse_kinematics
from anysim_banks.collision import geometry_of
from anysim_banks.pieces import Piece, piece_of
from anysim_banks.subject import Subject

HOVER = 0.1
"""[m] against its approach, from where the hand comes."""
RESTARTS = 8
TRIED = 96
"""So many base poses are sampled where none is stated."""
PROBES = 48
"""So many grasps judge them, evenly taken."""
CHOSEN = 4
"""At most so many are chosen, each for the most grasps that those before it do not reach."""
NEAREST, FARTHEST = 0.25, 1.0
"""Of the arm's length: how far bases are sampled from the affordance."""
ASKEW = 0.5
"""[rad] by which a sampled base at most looks past it."""

Base = tuple[float, float, float, float]


def parse_bases(words: Sequence[str], robot: str) -> tuple[Base, ...]:
    """Base poses as the command line has them: `X,Y,Z,YAW`.

    Raises:
        AssetError: one is not four finite numbers, or no robot is named.
    """
    if words and not robot:
        raise AssetError("--base says where a robot stands, but none is named; add --robot NAME")
    found: list[Base] = []
    for word in words:
        try:
            x, y, z, yaw = (float(part) for part in word.split(","))
        except ValueError:
            x = y = z = yaw = float("nan")
        if not np.isfinite([x, y, z, yaw]).all():
            raise AssetError(f"--base '{word}' is not X,Y,Z,YAW, four numbers [m, rad], such as --base=-0.6,0,0,0")
        found.append((x, y, z, yaw))
    return tuple(found)


class ReachableGrasps(NamedTuple):
    """What a robot reaches.

    Attributes:
        bases: (x, y, z [m], yaw [rad]) of where it stands, in the frame of the asset.
        grasps: (B, G) bool, which grasps it reaches from each.
    """

    bases: tuple[Base, ...]
    grasps: Array


class Reach:
    """A robot of the catalogue and its arm, with `bases` that are stated in the frame of the asset, or none."""

    def __init__(self, robot: str, bases: Sequence[Base] = (), channel: str = "arm", tool: str = "tool") -> None:
        """Make its arm's chain and solver.

        Raises:
            AnysimError: there is no such robot, or it has no such channel or tool.
        """
        self.robot, self.bases = robot, tuple(bases)
        self._world = compile_world({"world": {"robots": {"robot": {"robot": robot}}}})
        self._chain = Chain.from_world(self._world, "robot", channel, tool)
        self._solver = inverse_kinematics(self._chain)
        self._root = self._world.initial_body_pose[self._chain.root]
        self._carriers = _carriers(self._world, self._chain)
        self._length = float(P.norm(self._chain.rest[1:, :3]).sum() + P.norm(self._chain.tool_offset[:3]))

    def of(self, subject: Subject, pose: Array, rng: np.random.Generator) -> ReachableGrasps:
        """Which grasps (G, 7), tool poses in the body's frame, are reached from the stated or from good base poses.

        Raises:
            AssetError: none is; or of the sampled base poses none is beside the asset and has a grasp within reach.
        """
        bases = self.bases or self._good(subject, pose, rng)
        grasps = np.array([self._from(base, subject, pose) for base in bases])
        if not grasps.any():
            raise AssetError(
                f"{self.robot} reaches none of {len(pose)} grasps of {subject.asset} {subject.affordance.name} from "
                f"--base {' and '.join(','.join(f'{x:g}' for x in base) for base in bases)} in the frame of the asset; "
                "state another one, or none to have them sampled"
            )
        return ReachableGrasps(bases, grasps)

    def _from(self, base: Base, subject: Subject, pose: Array) -> Array:
        """(G,) bool."""
        back = np.broadcast_to(np.array([0.0, 0.0, -HOVER, 0.0, 0.0, 0.0, 1.0]), pose.shape)
        way = [P.compose(np.broadcast_to(at, pose.shape), pose) for at in subject.way]
        stations = [P.compose(way[0], back), *way]
        root = P.compose(_placed(base), self._root)
        reached, seeds = np.arange(len(pose)), np.tile(self._chain.initial, (len(pose), 1))
        for targets in stations:  # each from where the arm was at the one before
            found = self._solver.solve(
                targets[reached],
                np.tile(root, (len(reached), 1)),
                seeds,
                random_restarts=RESTARTS,
                rng_seeds=reached.astype(np.uint64),
            )
            reached, seeds = reached[found.converged], found.joint_pos[found.converged]
        return np.isin(np.arange(len(pose)), reached)

    def _good(self, subject: Subject, pose: Array, rng: np.random.Generator) -> tuple[Base, ...]:
        probes = pose[np.unique(np.linspace(0, len(pose) - 1, PROBES).astype(int))]
        there = P.compose(subject.way[0], subject.frame)[:2]
        distance = self._length * rng.uniform(NEAREST, FARTHEST, TRIED)
        angle = rng.uniform(-np.pi, np.pi, TRIED)
        yaw = angle + np.pi + rng.uniform(-ASKEW, ASKEW, TRIED)
        x, y = there[0] + distance * np.cos(angle), there[1] + distance * np.sin(angle)
        placed = [(piece, P.compose(subject.way[0], piece.pose)) for piece in subject.around]
        floor = min(_lowest(piece, at) for piece, at in placed)
        rows = np.round(np.stack([x, y, np.full(TRIED, floor), yaw], axis=1), 4)
        asset = [(geometry_of(piece), at) for piece, at in placed]
        tried = [base for a, b, c, d in rows.tolist() if self._beside(base := (a, b, c, d), asset)]
        left = np.array([self._from(base, subject, probes) for base in tried]).reshape(len(tried), len(probes))
        chosen: list[Base] = []
        while len(chosen) < CHOSEN and left.any():
            best = int(left.sum(axis=1).argmax())
            chosen.append(tried[best])
            left = left & ~left[best]
        if not chosen:
            raise AssetError(
                f"{self.robot} reaches no grasp of {subject.asset} {subject.affordance.name} from any of the "
                f"{len(tried)} base poses beside it that were tried, of {TRIED} sampled; state one with --base, or "
                "take another robot"
            )
        return tuple(chosen)

    def _beside(self, base: Base, asset: Sequence[tuple[Any, Array]]) -> bool:
        """Whether what carries the arm is nowhere inside of an asset."""
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        request, result = coal.CollisionRequest(), coal.CollisionResult()
        for shape, local in self._carriers:
            at = P.compose(_placed(base), local)
            here = coal.Transform3s(P.to_matrix(at[3:]), at[:3])
            for other, pose in asset:
                there = coal.Transform3s(P.to_matrix(pose[3:]), pose[:3])
                result.clear()
                if coal.collide(shape, here, other, there, request, result):
                    return False
        return True


def _carriers(world: World, chain: Chain) -> list[tuple[Any, Array]]:
    """Shapes of a robot that its arm does not move, with their poses (7,) where it stands."""
    moved: set[int] = set()
    found: list[tuple[Any, Array]] = []
    for number, body in enumerate(world.bodies):
        if world.body_joint[number] in chain.joints or body.parent in moved:
            moved.add(number)
            continue
        for piece in (piece_of(world, geom) for geom in world.body_geoms[number] if world.geoms[geom].collides):
            if piece is not None:
                found.append((geometry_of(piece), P.compose(world.initial_body_pose[number], piece.pose)))
    return found


def _lowest(piece: Piece, pose: Array) -> float:
    """[m] the height of the lowest point of a piece at a pose (7,)."""
    if piece.hull is not None:
        return float((P.to_matrix(pose[3:])[2] @ piece.hull.corners.reshape(-1, 3).T).min() + pose[2])
    return float(shape_bounds(piece.shape, pose, {})[0][2])


def _placed(base: Base) -> Array:
    x, y, z, yaw = base
    return np.array([x, y, z, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
