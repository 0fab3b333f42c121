"""The drives of all envs: which articulations need the computed law, and what it remembers between steps.

See `anysim_pybullet.kernels.drive_law` for the law. An articulation without drives, damping, armature, compensated
gravity or a wrench is left to Bullet alone.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.commands import MODES, Control
from anysim.world.model import ControlMode, World
from anysim_pybullet import kernels as K
from anysim_pybullet.tree import Frames, Tree

_POSITION, _EFFORT = MODES.index(ControlMode.POSITION), MODES.index(ControlMode.EFFORT)


class Laws:
    """Arrays of the drive law, env by env: per joint, per body, and what the last step left."""

    def __init__(self, world: World, frames: Frames, trees: list[Tree], num_envs: int) -> None:
        n, bodies, joints, actuators = num_envs, world.bodies, world.joints, world.actuators
        self._world, self._trees = world, trees
        self._driven = np.array([a.joint for a in actuators], dtype=int)
        self.kp = np.tile(np.array([a.kp for a in actuators], dtype=float), (n, 1))
        self.kd = np.tile(np.array([a.kd for a in actuators], dtype=float), (n, 1))
        self.limit = np.tile(np.array([a.effort_limit for a in actuators], dtype=float), (n, 1))
        self.drives = np.zeros((n, len(joints), 7))
        self.drives[:, :, K.DAMPING] = [j.damping for j in joints]
        self.drives[:, :, K.ARMATURE] = [j.armature for j in joints]
        self.drives[:, :, K.LIMIT] = np.inf
        for tree in trees:
            self.drives[:, tree.joints, K.MULTIPLIER] = tree.multiplier
        self.bodies = np.zeros((n, len(bodies), 11))
        for i, body in enumerate(bodies):
            row = self.bodies[:, i]
            row[:, K.MASS] = body.inertial.mass
            row[:, K.COM : K.COM + 3] = frames.inertial[i, :3]
            row[:, K.INERTIA : K.INERTIA + 6] = body.inertial.inertia
            row[:, K.COMPENSATED] = body.gravity_compensation
        self.gravity = np.tile(np.array(world.physics.gravity), (n, 1))
        self.effort = np.zeros((n, len(joints)))
        self._starts = np.cumsum([0, *(self._length(t) for t in trees)])
        self.memory = np.zeros((n, int(self._starts[-1])))
        self.roots = np.tile(np.array([[*b.position, *b.quaternion] for b in bodies]).reshape(-1, 7), (n, 1, 1))
        self.wrench: Array | None = None
        self.gathered = [_Gathered(t) for t in trees]
        self.refresh()

    @staticmethod
    def _length(tree: Tree) -> int:
        return 1 + tree.size * (2 + tree.size) if len(tree.joints) else 0

    def refresh(self) -> None:
        """Find the articulations that need the law, after a change of parameters."""
        law = np.zeros(len(self._world.joints), dtype=bool)
        law[self._driven] = True
        law |= np.any(self.drives[:, :, [K.DAMPING, K.ARMATURE]] != 0, axis=(0, 2))
        lifted: Array = np.any(self.bodies[:, :, K.COMPENSATED] != 0, axis=0)
        self.needs = [bool(law[t.joints].any() or lifted[t.bodies].any()) for t in self._trees]

    def apply(self, control: Control) -> None:
        """Take over commands: what the modes leave of the gains, and the part of the law that has no state in it."""
        stiffness, drag = self.kp * (control.mode == _POSITION), self.kd * (control.mode != _EFFORT)
        at = self.drives[:, self._driven]
        at[:, :, K.STIFFNESS], at[:, :, K.DRAG], at[:, :, K.LIMIT] = stiffness, drag, self.limit
        at[:, :, K.PULL] = stiffness * control.position + drag * control.velocity + control.effort
        self.drives[:, self._driven] = at

    def forget(self, ids: Array | int, trees: Array | None = None) -> None:
        """The velocities of these envs (of these trees) were written: the last step explains nothing now."""
        for number in range(len(self._trees)) if trees is None else trees.tolist():
            if self._starts[number + 1] > self._starts[number]:
                self.memory[ids, self._starts[number]] = 0.0

    def remembered(self, env: int, tree: int) -> Array:
        """The memory of one articulation, a view."""
        return self.memory[env, self._starts[tree] : self._starts[tree + 1]]


class _Gathered:
    """Buffers of one articulation, reused in every step."""

    def __init__(self, tree: Tree) -> None:
        n = len(tree.joints)
        self.motion, self.out = np.zeros((2, n)), np.zeros(2 * n + 6)
        self.wrench = np.zeros((n + 1, 6))
        self.root = np.zeros(13)


class Pusher:
    """Applies the law in one env, step by step."""

    def __init__(self, env: Any, index: int, laws: Laws, p: Any, dt: float) -> None:
        self._p, self._env, self._laws, self._index, self._dt = p, env, laws, index, dt
        self._work = [self._task(tree) for tree in env.plan.trees if self._needed(tree)]

    def _needed(self, tree: Tree) -> bool:
        wrench = self._laws.wrench
        pushed = wrench is not None and bool(wrench[self._index, tree.bodies].any())
        return (self._laws.needs[tree.number] or pushed) and (tree.free or len(tree.joints) > 0)

    def _task(self, tree: Tree) -> tuple[Any, ...]:
        """All that a step of one articulation needs: names become indices here, once per call of `step`."""
        laws, index = self._laws, self._index
        buffer = laws.gathered[tree.number]
        buffer.wrench[...] = 0.0 if laws.wrench is None else laws.wrench[index, tree.bodies]
        buffer.root[:7], buffer.root[7:] = laws.roots[index, tree.bodies[0]], 0.0
        return (
            tree, self._env.root_ids[tree.number], [self._env.joint_link[j] for j in tree.joints.tolist()], buffer,
            laws.bodies[index, tree.bodies], laws.drives[index, tree.joints], laws.remembered(index, tree.number),
        )  # fmt: skip

    def run(self, steps: int) -> bool:
        """Advance; False where the state was found not finite, and the env stood still from then on."""
        p, client = self._p, self._env.id
        if not self._work:
            for _ in range(steps):
                p.stepSimulation(physicsClientId=client)
            return True
        for _ in range(steps):
            for task in self._work:
                if not self._push(p, client, *task):
                    return False
            p.stepSimulation(physicsClientId=client)
        for tree, _, _, buffer, *_ in self._work:
            n = len(tree.joints)
            self._laws.effort[self._index, tree.joints] = buffer.out[n : 2 * n]
            if not self._laws.needs[tree.number]:  # only its wrench asked for the law, and that ends with this call
                self._laws.forget(self._index, np.array([tree.number]))
        return True

    def _push(
        self, p: Any, client: int, tree: Tree, uid: int, links: list[int], buffer: _Gathered, bodies: Array,
        drives: Array, memory: Array,
    ) -> bool:  # fmt: skip
        place: Any = None
        if tree.free:
            place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
            if not links:
                return self._push_body(p, client, uid, place, bodies[0], buffer.wrench[0])
            self._free_root(tree, place, turn, p.getBaseVelocity(uid, physicsClientId=client), buffer.root)
        states = p.getJointStates(uid, links, physicsClientId=client)
        buffer.motion[0] = [s[0] for s in states]
        buffer.motion[1] = [s[1] for s in states]
        good = K.drive_law(
            self._dt, tree.joint_ints, tree.joint_floats, bodies, drives, buffer.wrench,
            self._laws.gravity[self._index], buffer.root, buffer.motion, tree.first, memory, buffer.out,
        )  # fmt: skip
        if not good:
            return False
        out = buffer.out.tolist()
        n = len(links)
        p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=out[:n], physicsClientId=client)
        if tree.free and any(out[2 * n :]):
            force = np.array(out[2 * n : 2 * n + 3])
            arm = np.array(place) - buffer.root[:3]
            self._outer(p, client, uid, place, force, np.array(out[2 * n + 3 :]) - np.cross(arm, force))
        return True

    def _push_body(self, p: Any, client: int, uid: int, place: Any, body: Array, wrench: Array) -> bool:
        force = wrench[:3] - body[K.MASS] * body[K.COMPENSATED] * self._laws.gravity[self._index]
        self._outer(p, client, uid, place, force, wrench[3:])
        return True

    @staticmethod
    def _outer(p: Any, client: int, uid: int, place: Any, force: Array, torque: Array) -> None:
        if force.any():
            p.applyExternalForce(uid, -1, force.tolist(), place, p.WORLD_FRAME, physicsClientId=client)
        if torque.any():
            p.applyExternalTorque(uid, -1, torque.tolist(), p.WORLD_FRAME, physicsClientId=client)

    def _free_root(self, tree: Tree, place: Any, turn: Any, velocity: Any, root: Array) -> None:
        row, pose, twist = np.zeros((1, 20)), np.zeros((1, 7)), np.zeros((1, 6))
        row[0, :3], row[0, 3:7], row[0, 14:17], row[0, 17:] = place, turn, velocity[0], velocity[1]
        K.frames(row, self._env.local[tree.bodies[:1]], _ROOT, pose, twist)
        root[:7], root[7:] = pose[0], twist[0]


_ROOT = np.array([True])
