"""Drives that are computed outside of a library in each step, and given to it as torques.

`DriveArrays` keeps what the law of `anysim_mechanics.articulation.drive_law` needs, env by env, and what it remembers
of the last step; `TreeDrives` applies it to one articulation over the steps of a call.
"""

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import Control
from anysim.model.world import Actuation, World
from anysim_mechanics import articulation as K
from anysim_mechanics.drive_gains import DriveGains
from anysim_mechanics.trees import Frames, Tree

_TERMS = np.array([K.STIFFNESS, K.DRAG, K.PULL, K.FEED, K.BOUND, K.LIMIT])
"""Columns of drives that follow from commands and gains, in the order of `DriveGains.write`."""


class DriveArrays:
    """Arrays of the drive law: per joint, per body, and what the last step left.

    Attributes:
        drives: (N, J, 12), bodies: (N, B, 11): see the columns in `articulation`.
        damping: (N, B, 2) [1/s] of free bodies. gravity: (N, 3) [m/s^2].
        memory: (N, L), a row per env, part of its state. roots: (N, B, 7) poses of roots that stand still.
        acting: what the law uses: `drives`, or a copy in which some joints are left to the library.
    """

    def __init__(self, world: World, frames: Frames, trees: list[Tree], num_envs: int) -> None:
        n, bodies, joints = num_envs, world.bodies, world.joints
        self.trees, self.gains = trees, DriveGains(world, n)
        self.implicit = world.physics.actuation is not Actuation.EXPLICIT_PD
        self.drives = np.zeros((n, len(joints), 12))
        self.drives[:, :, K.DAMPING] = [j.damping for j in joints]
        self.drives[:, :, K.ARMATURE] = [j.armature for j in joints]
        self.drives[:, :, [K.LIMIT, K.BOUND]] = np.inf
        self.drives[:, :, K.DRY] = [j.friction for j in joints]
        self.drives[:, :, K.SPRING] = [j.stiffness for j in joints]
        self.drives[:, :, K.RELAXED] = [j.spring_rest for j in joints]
        for tree in trees:
            self.drives[:, tree.joints, K.MULTIPLIER] = tree.multiplier
        self.acting = self.drives
        self.bodies = np.zeros((n, len(bodies), 11))
        for i, body in enumerate(bodies):
            row = self.bodies[:, i]
            row[:, K.MASS] = body.inertial.mass
            row[:, K.COM : K.COM + 3] = frames.inertial[i, :3]
            row[:, K.INERTIA : K.INERTIA + 6] = body.inertial.inertia
            row[:, K.COMPENSATED] = body.gravity_compensation
        self.damping = np.tile(np.array([b.damping for b in bodies], dtype=float).reshape(-1, 2), (n, 1, 1))
        self.gravity = np.tile(np.array(world.physics.gravity), (n, 1))
        self.roots = np.tile(np.array([[*b.position, *b.quaternion] for b in bodies]).reshape(-1, 7), (n, 1, 1))
        self._starts = np.cumsum([0, *(1 + t.size * (2 + t.size) if len(t.joints) else 0 for t in trees)])
        self.memory = np.zeros((n, int(self._starts[-1])))

    def command(self, control: Control) -> None:
        """Take over commands: what the modes leave of the gains, and the part of the law that has no state in it."""
        self.gains.write(control, self.drives.swapaxes(1, 2), _TERMS)

    def lifted(self) -> Array:
        """(B,) bool: bodies whose weight is compensated in any env."""
        return np.any(self.bodies[:, :, K.COMPENSATED] != 0, axis=0)

    def needed(self, loose: Array) -> list[bool]:
        """Which trees the law acts on, where the library's own motors move all but the joints that are `loose` (J,)."""
        law = np.any(self.drives[:, :, [K.DAMPING, K.ARMATURE]] != 0, axis=(0, 2))
        law[self.gains.joint] = True
        sprung: Array = np.any(self.drives[:, :, K.SPRING] != 0, axis=0)
        damped: Array = np.any(self.damping != 0, axis=(0, 2))
        lifted = self.lifted()
        return [
            bool(
                (law & loose)[t.joints].any()
                or sprung[t.joints].any()
                or len(t.tendons)
                or damped[t.bodies].any()
                or (lifted[t.bodies].any() and (t.free or loose[t.joints].any()))
            )
            for t in self.trees
        ]

    def forget(self, ids: Array | int, trees: Array | None = None) -> None:
        """The velocities of these envs (of these trees) were written: the last step explains nothing now."""
        for number in range(len(self.trees)) if trees is None else trees.tolist():
            if self._starts[number + 1] > self._starts[number]:
                self.memory[ids, self._starts[number]] = 0.0

    def remembered(self, env: int, tree: int) -> Array:
        """The memory of one articulation, a view."""
        return self.memory[env, self._starts[tree] : self._starts[tree + 1]]


class TreeDrives:
    """The law of one articulation of an env, over the steps of a call.

    Attributes:
        motion: (2, n) joint positions and velocities. root: (13,) pose and twist of the root's frame. Written before
            each `solve`; that of a root that stands still is there already.
        torque: (n,) for the joints, effort: (n,) of the drives, base: (6,) force and moment on a free root's origin.
        lift: (3,) [N] what compensates the weight of the root.
    """

    def __init__(self, arrays: DriveArrays, env: int, tree: Tree, wrench: Array | None, dt: float) -> None:
        """`wrench` (B, 6) [N, N m] is that of the call, at the centres of mass."""
        n = len(tree.joints)
        self.tree, gravity, bodies = tree, arrays.gravity[env], arrays.bodies[env, tree.bodies]
        self.wrench = np.zeros((n + 1, 6)) if wrench is None else wrench[tree.bodies]
        self.motion, self.root, out = np.zeros((2, n)), np.zeros(13), np.zeros(2 * n + 6)
        self.root[:7] = arrays.roots[env, tree.bodies[0]]
        self.torque, self.effort, self.base = out[:n], out[n : 2 * n], out[2 * n :]
        self.lift = -bodies[0, K.MASS] * bodies[0, K.COMPENSATED] * gravity
        constants = dt, arrays.implicit, tree.joint_ints, tree.joint_floats, bodies, arrays.acting[env, tree.joints]
        state = (
            tree.tendons,
            self.wrench,
            gravity,
            self.root,
            self.motion,
            tree.first,
            arrays.remembered(env, tree.number),
        )
        self._terms = *constants, *state, out

    def solve(self) -> bool:
        """Work out the next step; False where the state is not finite."""
        return K.drive_law(*self._terms)
