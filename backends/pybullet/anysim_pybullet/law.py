"""The drives of all envs: which articulations need the computed law, and what it remembers between steps.

See `anysim_pybullet.kernels.drive_law` for the law. An articulation without drives, damping, armature, compensated
gravity or a wrench is left to Bullet alone.
"""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import EFFORT, Control, acting_gains
from anysim.engine.requirements import speed_bound
from anysim.kinematics.dynamics import drag, gain
from anysim.model.world import Actuation, World
from anysim_pybullet import kernels as K, reading
from anysim_pybullet.client import Env
from anysim_pybullet.lift import Lift, Lifter
from anysim_pybullet.motors import Motors, feed
from anysim_pybullet.tree import Frames, Tree

_ONLY_COUPLED = np.array([0, 0, 0, 0, 1, 0, 1, 0, 1, 0], dtype=float)
"""Takes everything away from the drive of a joint that a motor moves, but limits and its multiplier."""


class Laws:
    """Arrays of the drive law, env by env: per joint, per body, and what the last step left."""

    def __init__(self, world: World, frames: Frames, trees: list[Tree], envs: list[Env], effort: Array) -> None:
        """`effort` (N, J) is where what the drives exert is written."""
        num_envs = len(envs)
        n, bodies, joints, actuators = num_envs, world.bodies, world.joints, world.actuators
        self._world, self._trees, self._envs = world, trees, envs
        self.implicit = world.physics.actuation is not Actuation.EXPLICIT_PD
        self._speeds = np.full(len(actuators), np.inf)
        if world.physics.velocity_limits:
            self._speeds = np.array([joints[a.joint].velocity_limit for a in actuators])
        native = world.physics.actuation is Actuation.NATIVE and len(actuators) > 0
        self.motors = Motors(world, trees, n) if native else None
        self.lift = Lift(n, len(joints))
        self._driven = np.array([a.joint for a in actuators], dtype=int)
        self.kp = np.tile(np.array([a.kp for a in actuators], dtype=float), (n, 1))
        self.kd = np.tile(np.array([a.kd for a in actuators], dtype=float), (n, 1))
        self.limit = np.tile(np.array([a.effort_limit for a in actuators], dtype=float), (n, 1))
        self.drives = np.zeros((n, len(joints), 10))
        self.drives[:, :, K.DAMPING] = [j.damping for j in joints]
        self.drives[:, :, K.ARMATURE] = [j.armature for j in joints]
        self.drives[:, :, [K.LIMIT, K.BOUND]] = np.inf
        self.drives[:, :, K.DRY] = [j.friction for j in joints]
        for tree in trees:
            self.drives[:, tree.joints, K.MULTIPLIER] = tree.multiplier
        self.rubs = False
        """Whether there is dry friction, or was."""
        self._feeds = False
        """Whether a drive is in effort mode."""
        self.acting = self.drives
        """What the law uses: `drives`, or a copy in which the joints that motors move have none."""
        self.bodies = np.zeros((n, len(bodies), 11))
        for i, body in enumerate(bodies):
            row = self.bodies[:, i]
            row[:, K.MASS] = body.inertial.mass
            row[:, K.COM : K.COM + 3] = frames.inertial[i, :3]
            row[:, K.INERTIA : K.INERTIA + 6] = body.inertial.inertia
            row[:, K.COMPENSATED] = body.gravity_compensation
        self.damping = np.tile(np.array([b.damping for b in bodies], dtype=float).reshape(-1, 2), (n, 1, 1))
        self.gravity = np.tile(np.array(world.physics.gravity), (n, 1))
        self.effort = effort
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
        """Forget what is kept of parameters and clients: after a change of them, also after an env was built anew."""
        if self.motors is not None:
            self.motors.forget()
        self._sort_trees()

    def _sort_trees(self) -> None:
        """Find the articulations that need the law, and those whose weight is carried beside motors."""
        law = np.zeros(len(self._world.joints), dtype=bool)
        law[self._driven] = True
        law |= np.any(self.drives[:, :, [K.DAMPING, K.ARMATURE]] != 0, axis=(0, 2))
        loose: Array = np.ones(len(law), dtype=bool)
        if self.motors is not None:
            loose = np.logical_not(np.all(self.motors.running, axis=0))
        self.rubs = self.rubs or bool(self.drives[:, :, K.DRY].any())
        damped: Array = np.any(self.damping != 0, axis=(0, 2))
        lifted: Array = np.any(self.bodies[:, :, K.COMPENSATED] != 0, axis=0)
        self.needs = [
            bool(
                (law & loose)[t.joints].any()
                or damped[t.bodies].any()
                or (lifted[t.bodies].any() and (t.free or loose[t.joints].any()))
            )
            for t in self._trees
        ]
        self._lifters: dict[int, Lifter] = {}
        self.lifts = [
            bool(lifted[t.bodies].any() and len(t.joints)) and not needed
            for t, needed in zip(self._trees, self.needs, strict=True)
        ]

    def apply(self, control: Control) -> None:
        """Take over commands: what the modes leave of the gains, and the part of the law that has no state in it."""
        if self.motors is not None:
            self._apply_natively(control, self.motors)
            return
        stiffness, drag = acting_gains(control.mode, self.kp, self.kd)
        at = self.drives[:, self._driven]
        at[:, :, K.STIFFNESS], at[:, :, K.DRAG], at[:, :, K.LIMIT] = stiffness, drag, self.limit
        at[:, :, K.PULL] = stiffness * control.position + drag * control.velocity
        at[:, :, K.FEED], at[:, :, K.BOUND] = control.effort, speed_bound(drag, self._speeds)
        self.drives[:, self._driven] = at

    def _apply_natively(self, control: Control, motors: Motors) -> None:
        """Targets for the motors, and for the law what the drives in effort mode do."""
        if not motors.know(control.mode):
            before = motors.running.copy()
            motors.prepare(control.mode, self.kp, self.kd, self.limit, *self.damping_and_armature(), self._envs)
            self.acting = self.drives.copy()
            self.acting[:, self._driven, K.LIMIT] = self.limit
            self.acting[motors.running] *= _ONLY_COUPLED
            self._feeds = bool((control.mode == EFFORT).any())
            if not np.array_equal(before, motors.running):
                self.forget(np.arange(len(self._envs)))
                self._sort_trees()
        motors.apply(control)
        if self._feeds:
            self.acting[:, self._driven, K.FEED] = feed(control)

    def damping_and_armature(self) -> tuple[Array, Array]:
        """Those of the joints (N, J), views."""
        return self.drives[:, :, K.DAMPING], self.drives[:, :, K.ARMATURE]

    def lifter(self, env: Env, index: int) -> Lifter | None:
        """What is left to do in an env where Bullet's motors do everything else; None where the law is needed."""
        if self.motors is None or self.wrench is not None or any(self.needs):
            return None
        if self.rubs:
            for tree in env.cast.trees:
                self.share_friction(env, index, tree, acts=False)
        lifter = self._lifters.get(index)
        if lifter is None:
            lifter = Lifter(env, index, self, [t for t in env.cast.trees if self.lifts[t.number]])
            self._lifters[index] = lifter
        return lifter

    def share_friction(self, env: Env, index: int, tree: Tree, *, acts: bool) -> None:
        """Dry friction is the law's where it acts on an articulation, else Bullet's."""
        for joint in tree.joints.tolist():
            env.set_dry_friction(joint, 0.0 if acts else float(self.drives[index, joint, K.DRY]))

    def forget(self, ids: Array | int, trees: Array | None = None) -> None:
        """The velocities of these envs (of these trees) were written: the last step explains nothing now."""
        self.lift.forget(ids)
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


_Task = tuple[Tree, int, list[int], _Gathered, Array, Array, Array, "Brake | None"]
"""An articulation, its Bullet body and links, buffers, and its rows of bodies, drives, memory and damping."""


class Pusher:
    """Applies the law in one env, step by step."""

    def __init__(self, env: Any, index: int, laws: Laws, p: Any, dt: float) -> None:
        self._p, self._env, self._laws, self._index, self._dt = p, env, laws, index, dt
        self._work = [self._task(tree) for tree in env.cast.trees if self._needed(tree)]
        if laws.rubs:
            for tree in env.cast.trees:
                laws.share_friction(env, index, tree, acts=self._needed(tree))
        lifted = [t for t in env.cast.trees if laws.lifts[t.number] and not self._needed(t)]
        self._lifter = Lifter(env, index, laws, lifted)

    def _needed(self, tree: Tree) -> bool:
        wrench = self._laws.wrench
        pushed = wrench is not None and bool(wrench[self._index, tree.bodies].any())
        return (self._laws.needs[tree.number] or pushed) and (tree.free or len(tree.joints) > 0)

    def _task(self, tree: Tree) -> "_Task":
        """All that a step of one articulation needs: names become indices here, once per call of `step`."""
        laws, index = self._laws, self._index
        buffer = laws.gathered[tree.number]
        buffer.wrench[...] = 0.0 if laws.wrench is None else laws.wrench[index, tree.bodies]
        buffer.root[:7], buffer.root[7:] = laws.roots[index, tree.bodies[0]], 0.0
        return (
            tree,
            self._env.root_ids[tree.number],
            self._env.tree_links[tree.number],
            buffer,
            laws.bodies[index, tree.bodies],
            laws.acting[index, tree.joints],
            laws.remembered(index, tree.number),
            Brake.of(laws, self._p, self._env, index, tree, self._dt),
        )

    def run(self, steps: int) -> bool:
        """Advance; False where the state was found not finite, and the env stood still from then on."""
        p, client = self._p, self._env.id
        if not self._work:
            return self._lifter.run(p, steps)
        for _ in range(steps):
            for task in self._work:
                if not self._push(p, client, task):
                    return False
            if not self._lifter.push(p):
                return False
            p.stepSimulation(physicsClientId=client)
        for tree, _, _, buffer, *_ in self._work:
            n = len(tree.joints)
            self._laws.effort[self._index, tree.joints] = buffer.out[n : 2 * n]
            if not self._laws.needs[tree.number]:  # only its wrench asked for the law, and that ends with this call
                self._laws.forget(self._index, np.array([tree.number]))
        return True

    def _push(self, p: Any, client: int, task: "_Task") -> bool:
        tree, uid, links, buffer, bodies, drives, memory, brake = task
        place: Any = None
        if tree.free:
            place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
            if not links:
                wrench = buffer.wrench[0]
                if brake is not None:
                    velocity = p.getBaseVelocity(uid, physicsClientId=client)
                    wrench = wrench + brake.wrench(np.array(turn), *map(np.array, velocity))
                lift = bodies[0, K.MASS] * bodies[0, K.COMPENSATED]
                self._outer(p, client, uid, place, wrench[:3] - lift * self._laws.gravity[self._index], wrench[3:])
                return True
            self._free_root(tree, place, turn, p.getBaseVelocity(uid, physicsClientId=client), buffer.root)
        states = p.getJointStates(uid, links, physicsClientId=client)
        buffer.motion[0] = [s[0] for s in states]
        buffer.motion[1] = [s[1] for s in states]
        good = K.drive_law(
            self._dt,
            self._laws.implicit,
            tree.joint_ints,
            tree.joint_floats,
            bodies,
            drives,
            buffer.wrench,
            self._laws.gravity[self._index],
            buffer.root,
            buffer.motion,
            tree.first,
            memory,
            buffer.out,
        )
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

    @staticmethod
    def _outer(p: Any, client: int, uid: int, place: Any, force: Array, torque: Array) -> None:
        if force.any():
            p.applyExternalForce(uid, -1, force.tolist(), place, p.WORLD_FRAME, physicsClientId=client)
        if torque.any():
            p.applyExternalTorque(uid, -1, torque.tolist(), p.WORLD_FRAME, physicsClientId=client)

    def _free_root(self, tree: Tree, place: Any, turn: Any, velocity: Any, root: Array) -> None:
        pose, twist = np.zeros((1, 7)), np.zeros((1, 6))
        row = np.array([[*place, *turn, *velocity[0], *velocity[1], *reading.UNUSED]])
        reading.frames(row, self._env.local[tree.bodies[:1]], 1, pose, twist)
        root[:7], root[7:] = pose[0], twist[0]


class Brake(NamedTuple):
    """The damping of a free body. Bullet's own grows with the square of the speed."""

    gains: Array
    mass: Array
    moments: Array

    @staticmethod
    def of(laws: Laws, p: Any, env: Any, index: int, tree: Tree, dt: float) -> "Brake | None":
        """What slows the root of a tree down; None where nothing does."""
        rates = laws.damping[index, tree.bodies[0]]
        if not rates.any():
            return None
        info = p.getDynamicsInfo(env.root_ids[tree.number], -1, physicsClientId=env.id)
        return Brake(gain(rates, dt), np.array(info[0]), np.array(info[2]))

    def wrench(self, turn: Array, velocity: Array, rate: Array) -> Array:
        """(6,) at the centre of mass; Bullet's frame of a body has its principal axes."""
        return drag(self.gains, self.mass, self.moments, turn, velocity, rate)
