"""The drives of all envs: which articulations need the computed law, and how Bullet is given what it says.

See `anysim_mechanics.computed_drives` for the law. An articulation without drives, damping, springs, armature,
compensated gravity or a wrench is left to Bullet alone.
"""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import EFFORT, Control
from anysim.kinematics.dynamics import drag, gain
from anysim.model.world import Actuation, World
from anysim_mechanics import articulation as K
from anysim_mechanics.computed_drives import DriveArrays, TreeDrives
from anysim_mechanics.gravity_compensation import GravityCompensation
from anysim_mechanics.trees import Frames, Tree
from anysim_pybullet import reading
from anysim_pybullet.client import Env
from anysim_pybullet.lift import Lifter
from anysim_pybullet.motors import Motors

_ONLY_COUPLED = np.array([0, 0, 0, 0, 1, 0, 1, 0, 1, 0, 1, 1], dtype=float)
"""Takes everything away from the drive of a joint that a motor moves, but limits, its multiplier and its spring."""


class Laws(DriveArrays):
    """The arrays of the drive law, Bullet's motors, and what is shared between them."""

    def __init__(self, world: World, frames: Frames, trees: list[Tree], envs: list[Env], effort: Array) -> None:
        """`effort` (N, J) is where what the drives exert is written."""
        super().__init__(world, frames, trees, len(envs))
        self._envs, self.effort = envs, effort
        native = world.physics.actuation is Actuation.NATIVE and len(world.actuators) > 0
        self.motors = Motors(world, trees, len(envs)) if native else None
        self.lift = GravityCompensation(self)
        self.rubs = False
        """Whether there is dry friction, or was."""
        self._feeds = False
        """Whether a drive is in effort mode."""
        self.wrench: Array | None = None
        self.refresh()

    def refresh(self) -> None:
        """Forget what is kept of parameters and clients: after a change of them, also after an env was built anew."""
        if self.motors is not None:
            self.motors.forget()
        self._sort_trees()

    def _sort_trees(self) -> None:
        """Find the articulations that need the law, and those whose weight is carried beside motors."""
        loose: Array = np.ones(self.drives.shape[1], dtype=bool)
        if self.motors is not None:
            loose = np.logical_not(np.all(self.motors.running, axis=0))
        self.rubs = self.rubs or bool(self.drives[:, :, K.DRY].any())
        self.needs, lifted = self.needed(loose), self.lifted()
        self._lifters: dict[int, Lifter] = {}
        self.lifts = [
            bool(lifted[t.bodies].any() and len(t.joints)) and not needed
            for t, needed in zip(self.trees, self.needs, strict=True)
        ]

    def apply(self, control: Control) -> None:
        """Take over commands: all of them, or for motors their targets and what the drives in effort mode do."""
        motors, gains = self.motors, self.gains
        if motors is None:
            self.command(control)
            return
        if not motors.know(control.mode):
            before = motors.running.copy()
            damping, armature = self.drives[:, :, K.DAMPING], self.drives[:, :, K.ARMATURE]
            motors.prepare(control.mode, gains, damping, armature, self._envs)
            self.acting = self.drives.copy()
            self.acting[:, gains.joint, K.LIMIT] = gains.limit
            self.acting[motors.running] *= _ONLY_COUPLED
            self._feeds = bool((control.mode == EFFORT).any())
            if not np.array_equal(before, motors.running):
                self.forget(np.arange(len(self._envs)))
                self._sort_trees()
        motors.apply(control)
        if self._feeds:
            self.acting[:, gains.joint, K.FEED] = np.where(control.mode == EFFORT, control.effort, 0.0)

    def lifter(self, env: Env, index: int) -> Lifter | None:
        """What is left to do in an env where Bullet's motors do everything else; None where the law is needed."""
        if self.motors is None or self.wrench is not None or any(self.needs):
            return None
        if self.rubs:
            for tree in env.cast.trees:
                self.share_friction(env, index, tree, acts=False)
        lifter = self._lifters.get(index)
        if lifter is None:
            lifter = Lifter(env, index, self.lift, [t for t in env.cast.trees if self.lifts[t.number]])
            self._lifters[index] = lifter
        return lifter

    def share_friction(self, env: Env, index: int, tree: Tree, *, acts: bool) -> None:
        """Dry friction is the law's where it acts on an articulation, else Bullet's."""
        for joint in tree.joints.tolist():
            env.set_dry_friction(joint, 0.0 if acts else float(self.drives[index, joint, K.DRY]))

    def forget(self, ids: Array | int, trees: Array | None = None) -> None:
        self.lift.forget(ids)
        super().forget(ids, trees)


class _Task(NamedTuple):
    """An articulation that the law acts on, its Bullet body and links, and what brakes its root.

    A free body without joints that nothing brakes is pushed with the same `force` and `torque` in every step of a call;
    those that are zero are empty.
    """

    law: TreeDrives
    uid: int
    links: list[int]
    brake: "Brake | None"
    force: list[float] | None
    torque: list[float]


class Pusher:
    """Applies the law in one env, step by step."""

    def __init__(self, env: Env, index: int, laws: Laws, p: Any, dt: float) -> None:
        self._p, self._env, self._laws, self._index = p, env, laws, index
        wrench = None if laws.wrench is None else laws.wrench[index]
        self._work: list[_Task] = []
        lifted: list[Tree] = []
        for tree in env.cast.trees:
            pushed = wrench is not None and bool(wrench[tree.bodies].any())
            acts = (laws.needs[tree.number] or pushed) and (tree.free or len(tree.joints) > 0)
            if acts:
                law, brake = TreeDrives(laws, index, tree, wrench, dt), Brake.of(laws, p, env, index, tree, dt)
                uid, links = env.root_ids[tree.number], env.tree_links[tree.number]
                if tree.free and not links and brake is None:
                    outer = law.wrench[0, :3] + law.lift, law.wrench[0, 3:]
                    self._work.append(_Task(law, uid, links, brake, *(v.tolist() if v.any() else [] for v in outer)))
                else:
                    self._work.append(_Task(law, uid, links, brake, None, []))
            elif laws.lifts[tree.number]:
                lifted.append(tree)
            if laws.rubs:
                laws.share_friction(env, index, tree, acts=acts)
        self._lifter = Lifter(env, index, laws.lift, lifted)

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
        for law, *_ in self._work:
            if len(law.tree.joints):
                self._laws.effort[self._index, law.tree.joints] = law.effort
            if not self._laws.needs[law.tree.number]:  # only its wrench asked for the law, and that ends with this call
                self._laws.forget(self._index, np.array([law.tree.number]))
        return True

    def _push(self, p: Any, client: int, task: _Task) -> bool:
        law, uid, links, brake, force, torque = task
        if force is not None:
            if force:
                place, _ = p.getBasePositionAndOrientation(uid, physicsClientId=client)
                p.applyExternalForce(uid, -1, force, place, p.WORLD_FRAME, physicsClientId=client)
            if torque:
                p.applyExternalTorque(uid, -1, torque, p.WORLD_FRAME, physicsClientId=client)
            return True
        place: Any = None
        if law.tree.free:
            place, turn = p.getBasePositionAndOrientation(uid, physicsClientId=client)
            if not links:
                assert brake is not None
                velocity = p.getBaseVelocity(uid, physicsClientId=client)
                wrench = law.wrench[0] + brake.wrench(np.array(turn), *map(np.array, velocity))
                self._outer(p, client, uid, place, wrench[:3] + law.lift, wrench[3:])
                return True
            velocity = p.getBaseVelocity(uid, physicsClientId=client)
            row = np.array([[*place, *turn, *velocity[0], *velocity[1], *reading.UNUSED]])
            local = self._env.local[law.tree.bodies[:1]]
            reading.frames(row, local, 1, law.root[None, :7], law.root[None, 7:])
        states = p.getJointStates(uid, links, physicsClientId=client)
        law.motion[0] = [s[0] for s in states]
        law.motion[1] = [s[1] for s in states]
        if not law.solve():
            return False
        p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=law.torque.tolist(), physicsClientId=client)
        if law.tree.free and law.base.any():
            pull, arm = law.base[:3], np.array(place) - law.root[:3]
            self._outer(p, client, uid, place, pull, law.base[3:] - np.cross(arm, pull))
        return True

    @staticmethod
    def _outer(p: Any, client: int, uid: int, place: Any, force: Array, torque: Array) -> None:
        if force.any():
            p.applyExternalForce(uid, -1, force.tolist(), place, p.WORLD_FRAME, physicsClientId=client)
        if torque.any():
            p.applyExternalTorque(uid, -1, torque.tolist(), p.WORLD_FRAME, physicsClientId=client)


class Brake(NamedTuple):
    """The damping of a free body. Bullet's own grows with the square of the speed."""

    gains: Array
    mass: Array
    moments: Array

    @staticmethod
    def of(laws: Laws, p: Any, env: Env, index: int, tree: Tree, dt: float) -> "Brake | None":
        """What slows the root of a tree down; None where nothing does."""
        rates = laws.damping[index, tree.bodies[0]]
        if not rates.any():
            return None
        info = p.getDynamicsInfo(env.root_ids[tree.number], -1, physicsClientId=env.id)
        return Brake(gain(rates, dt), np.array(info[0]), np.array(info[2]))

    def wrench(self, turn: Array, velocity: Array, rate: Array) -> Array:
        """(6,) at the centre of mass; Bullet's frame of a body has its principal axes."""
        return drag(self.gains, self.mass, self.moments, turn, velocity, rate)
