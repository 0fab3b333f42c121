"""The World as trees, each a root body with its links: index arrays for kernels, made once at build.

A link's frame here has the axes of its body and lies on its joint: at the anchor of a revolute joint, else at the
body's origin. That is where a URDF wants it.
"""

from dataclasses import dataclass, replace

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType, World


def members(world: World) -> dict[int, list[int]]:
    """By root body, the bodies of its tree: the root first, parents before children."""
    root: list[int] = []
    trees: dict[int, list[int]] = {}
    for i, body in enumerate(world.bodies):
        root.append(i if body.kind is not BodyKind.LINK else root[body.parent])
        trees.setdefault(root[i], []).append(i)
    return trees


@dataclass(frozen=True)
class Tree:
    """A root and its links. `bodies` are World indices, the root first; joint i moves body i + 1."""

    number: int
    bodies: Array  # (n + 1,)
    joints: Array  # (n,)
    free: bool
    first: int  # 6 with a free root: where the joints begin in the generalised velocity
    joint_ints: Array  # (n, 3), for the kernels
    joint_floats: Array  # (n, 15)
    multiplier: Array  # (n,)
    tendons: Array  # (t, 4 + n), for the kernels

    @property
    def size(self) -> int:
        """The length of the generalised velocity."""
        return self.first + len(self.joints)


@dataclass(frozen=True)
class Frames:
    """Per body: where its link's frame and its principal axes are."""

    anchor: Array  # (B, 3) origin of the link's frame in the body's
    moments: Array  # (B, 3) principal moments
    inertial: Array  # (B, 7) principal axes at the centre of mass, in the link's frame


def frames_of(world: World) -> Frames:
    """Anchors and principal axes of all bodies."""
    anchor = np.zeros((len(world.bodies), 3))
    for joint in world.joints:
        if joint.type is JointType.REVOLUTE:
            anchor[joint.body] = joint.anchor
    moments, inertial = np.zeros((len(world.bodies), 3)), np.zeros((len(world.bodies), 7))
    for i, body in enumerate(world.bodies):
        moments[i], axes = inertia.principal(body.inertial.inertia)
        inertial[i] = [*(np.array(body.inertial.com) - anchor[i]), *axes]
    return Frames(anchor, moments, inertial)


def shifted(frames: Frames, com: Array) -> Frames:
    """The frames of bodies whose centres of mass are at `com` (B, 3), in the bodies' frames."""
    inertial = frames.inertial.copy()
    inertial[:, :3] = com - frames.anchor
    return replace(frames, inertial=inertial)


def trees_of(world: World, frames: Frames) -> list[Tree]:
    """One tree for each root body, in the World's order."""
    return [_tree(world, frames, number, bodies) for number, bodies in enumerate(members(world).values())]


def _tree(world: World, frames: Frames, number: int, bodies: list[int]) -> Tree:
    place = {body: i for i, body in enumerate(bodies)}
    joints = [world.body_joint[b] for b in bodies[1:]]
    row = {joint: i for i, joint in enumerate(joints)}
    ints, floats = np.full((len(joints), 3), -1, dtype=np.int64), np.zeros((len(joints), 15))
    multiplier = np.ones(len(joints))
    for i, j in enumerate(joints):
        joint, body = world.joints[j], world.bodies[bodies[i + 1]]
        ints[i, :2] = place[body.parent], joint.type is JointType.PRISMATIC
        pose = link_pose(world, frames, bodies[i + 1])
        floats[i] = [*joint.axis, *pose[:3], *P.to_matrix(pose[3:]).ravel()]
        leader = joint
        while leader.mimic is not None and leader.mimic.joint in row:
            ints[i, 2] = row[leader.mimic.joint]
            multiplier[i] *= leader.mimic.multiplier
            leader = world.joints[leader.mimic.joint]
    free = world.bodies[bodies[0]].kind is BodyKind.FREE
    indices = np.array(bodies, dtype=int), np.array(joints, dtype=int)
    return Tree(number, *indices, free, 6 if free else 0, ints, floats, multiplier, _tendons(world, row))


def _tendons(world: World, row: dict[int, int]) -> Array:
    """Those of a tree; `row` has the places of its joints.

    Raises:
        EngineError: a tendon joins joints of two trees.
    """
    rows = []
    for tendon in world.tendons:
        inside = [joint in row for joint in tendon.joints]
        if any(inside) and not all(inside):
            raise EngineError(f"the tendon '{tendon.name}' joins joints of several articulations; give each its own")
        if all(inside) and (tendon.stiffness or tendon.damping):
            shares = np.zeros(len(row))
            np.add.at(shares, [row[joint] for joint in tendon.joints], tendon.coefficients)
            rows.append([tendon.stiffness, tendon.damping, *tendon.rest, *shares])
    return np.array(rows, dtype=float).reshape(-1, 4 + len(row))


def link_pose(world: World, frames: Frames, body: int) -> Array:
    """(7,) a link's frame in its parent link's frame, at zero joint position."""
    b = world.bodies[body]
    quaternion = np.array(b.quaternion)
    place = np.array(b.position) + P.rotate(quaternion, frames.anchor[body]) - frames.anchor[b.parent]
    return np.concatenate([place, quaternion])
