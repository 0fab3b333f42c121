"""All envs of an engine: building, writing, stepping, saving and restoring them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.c_output import quiet
from anysim.conventions import Array
from anysim.engine.lighting import Looks
from anysim.engine.state import SnapshotLevel
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.index import paired
from anysim.model.world import BodyKind, World
from anysim_pybullet.bullet import bullet
from anysim_pybullet.cast import Cast
from anysim_pybullet.client import Env, Plan
from anysim_pybullet.law import Laws, Pusher
from anysim_pybullet.options import PybulletOptions, own_scenery
from anysim_pybullet.parameters import Parameters
from anysim_pybullet.state import Mirror

_MIRRORED = ("pose", "twist", "position", "velocity", "contact", "fault")


class Envs:
    """The clients, and all that is kept beside them."""

    def __init__(self, world: World, present: Array, options: PybulletOptions) -> None:
        """With the entities (N, E) that are there in each env."""
        num_envs = len(present)
        self.world = world
        self.plan = Plan(world, options)
        self.clients: list[Env] = []
        try:
            for row in present:
                self.clients.append(Env(self.plan, self.plan.cast(row)))
            self.laws = Laws(world, self.plan.frames, self.plan.trees, self.clients)
            looks = Looks(world, num_envs, own_scenery(options))
            self.parameters = Parameters(world, self.clients, self.laws, self._rebuild, looks)
            self.mirror = Mirror(world, self.clients, self.laws)
            self._tree_of = np.zeros(len(world.bodies), dtype=int)
            for tree in self.plan.trees:
                self._tree_of[tree.bodies] = tree.number
            self._static = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.STATIC], dtype=int)
            self._begin: list[int] = [0] * num_envs
            self._initial: list[dict[str, Array]] = [{} for _ in range(num_envs)]
            for index in range(num_envs):
                self._settle(index)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Free all clients and files. May be called again."""
        while self.clients:
            self.clients.pop().close()
        self.plan.close()

    # ------------------------------------------------------------------ the initial state

    def _settle(self, index: int) -> None:
        """Bring a client that was just built into the World's initial state, and have Bullet remember it."""
        world, mirror, env = self.world, self.mirror, self.clients[index]
        self.parameters.push_surfaces(index)
        mirror.pose[index], mirror.twist[index] = world.initial_body_pose, 0.0
        mirror.position[index], mirror.velocity[index] = [j.initial for j in world.joints], 0.0
        self._set_joints(index, env.cast.joints)
        for tree in env.cast.trees:
            self._set_root(index, int(tree.bodies[0]), with_pose=True)
        mirror.hold(index)
        mirror.wrote(index)
        mirror.refresh(index)
        self.laws.roots[index] = mirror.pose[index]
        self._begin[index] = bullet().saveState(physicsClientId=env.id)
        self._initial[index] = {name: getattr(mirror, name)[index].copy() for name in _MIRRORED}

    def populate(self, ids: Array, present: Array) -> None:
        """Have these envs hold the entities (E, entities) that are there, and no others, in their initial state."""
        for index, row in zip(ids.tolist(), present, strict=True):
            before, cast = self.clients[index].cast, self.plan.cast(row)
            if cast is not before:
                self.mirror.refresh(index)
                try:
                    self._renew(index, cast)
                except BaseException:
                    self.mirror.fault[index] = True
                    self._renew(index, before)
                    raise

    def _renew(self, index: int, cast: Cast) -> None:
        """Build an env anew; one that was given up in a new client, since what is not finite stays in the old one."""
        if self.mirror.fault[index]:
            self.clients[index].close()
            self.clients[index] = Env(self.plan, cast, self.parameters.shifted_com(index))
        else:
            bullet().removeState(self._begin[index], physicsClientId=self.clients[index].id)
            self.clients[index].rebuild(cast, self.parameters.shifted_com(index))
        self.mirror.fault[index] = False
        self.laws.refresh()
        self._settle(index)
        self.parameters.renew(index)

    def reset(self, ids: Array) -> None:
        """Back to the initial state, with nothing left over."""
        for index in ids.tolist():
            initial = self._initial[index]
            self._clear(index, initial["pose"])
            bullet().restoreState(self._begin[index], physicsClientId=self.clients[index].id)
            for name in _MIRRORED:
                getattr(self.mirror, name)[index] = initial[name]
            self.mirror.hold(index)
            self.laws.effort[index] = 0.0
            self.laws.forget(index)

    def _clear(self, index: int, pose: Array) -> None:
        """Make an env forget its contacts, before a state is restored in which fixed bodies are at `pose` (B, 7).

        An env that was given up gets a new client: what is not finite stays in Bullet's collision detection.
        """
        self.mirror.refresh(index)
        env = self.clients[index]
        if self.mirror.fault[index] or not env.part():
            self.mirror.fault[index] = True
            self._renew(index, env.cast)
        for body in self._static[env.cast.bodies[self._static]].tolist():
            self.mirror.pose[index, body] = pose[body]
            self._set_root(index, body, with_pose=True)

    def _rebuild(self, index: int) -> None:
        """Build an env anew, in its present state: for what Bullet reads once. It has forgotten its contacts."""
        self.mirror.settle(index)
        kept = {name: getattr(self.mirror, name)[index].copy() for name in _MIRRORED}
        effort = self.laws.effort[index].copy()
        self._renew(index, self.clients[index].cast)
        for name in _MIRRORED:
            getattr(self.mirror, name)[index] = kept[name]
        self._put_motion(index)
        self.laws.effort[index] = effort
        self.laws.forget(index)

    def _put_motion(self, index: int) -> None:
        """Give Bullet the joints and roots that the mirror has."""
        cast = self.clients[index].cast
        self._set_joints(index, cast.joints)
        for tree in cast.trees:
            self._set_root(index, int(tree.bodies[0]), with_pose=True)
        self.mirror.hold(index)

    # ------------------------------------------------------------------ stepping

    def step(self, steps: int, ids: Array | None) -> None:
        """Advance all envs, or some."""
        p, dt = bullet(), self.world.physics.dt
        for index in range(len(self.clients)) if ids is None else ids.tolist():
            if not self.mirror.fault[index]:
                env, lifter = self.clients[index], self.laws.lifter(self.clients[index], index)
                if lifter is None:
                    sound = Pusher(env, index, self.laws, p, dt).run(steps)
                else:
                    sound = lifter.run(p, steps, self.mirror.known_position(index))
                self.mirror.stepped(index, sound)

    # ------------------------------------------------------------------ writing

    def write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        """See `Primitives._write_joints`."""
        bodies = np.array([self.world.joints[j].body for j in joints], dtype=int)
        for row, index in enumerate(ids.tolist()):
            self.mirror.settle(index)
            if position is not None:
                self.mirror.position[index, joints] = position[row]
            if velocity is not None:
                self.mirror.velocity[index, joints] = velocity[row]
            self._set_joints(index, joints)
            self.mirror.wrote(index)
            self.laws.forget(index, np.unique(self._tree_of[bodies]))

    def write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        """See `Primitives._write_bodies`."""
        for row, index in enumerate(ids.tolist()):
            self.mirror.settle(index)
            for column, body in enumerate(bodies.tolist()):
                if pose is not None:
                    self.mirror.pose[index, body] = pose[row, column]
                if twist is not None:
                    self.mirror.twist[index, body] = twist[row, column]
                self._set_root(index, body, with_pose=pose is not None)
            self.mirror.wrote(index)
            self.laws.forget(index, np.unique(self._tree_of[bodies]))

    def _set_joints(self, index: int, joints: Array) -> None:
        p, env, mirror = bullet(), self.clients[index], self.mirror
        for j in joints.tolist():
            p.resetJointState(
                env.body_at[self.world.joints[j].body][0],
                env.joint_link[j],
                float(mirror.position[index, j]),
                float(mirror.velocity[index, j]),
                physicsClientId=env.id,
            )

    def _set_root(self, index: int, body: int, with_pose: bool) -> None:
        """Give Bullet the pose of a root's centre of mass, and its velocity, which writing a pose makes zero."""
        p, env, mirror = bullet(), self.clients[index], self.mirror
        uid, local, pose = env.body_at[body][0], env.local[body, :7], mirror.pose[index, body]
        if with_pose:
            place = P.compose(pose, local)
            p.resetBasePositionAndOrientation(uid, place[:3].tolist(), place[3:].tolist(), physicsClientId=env.id)
        if self.world.bodies[body].kind is BodyKind.STATIC:
            self.laws.roots[index, body] = pose
            return
        twist = mirror.twist[index, body]
        speed = twist[:3] + P.cross(twist[3:], P.rotate(pose[3:], local[:3]))
        p.resetBaseVelocity(uid, speed.tolist(), twist[3:].tolist(), physicsClientId=env.id)

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        """Rows of all that is kept; at the level TRAJECTORY with Bullet's own file of each env."""
        for index in ids.tolist():
            self.mirror.settle(index)
        data = {name: getattr(self.mirror, name)[ids] for name in _MIRRORED}
        data |= {"effort": self.laws.effort[ids], "memory": self.laws.memory[ids]}
        data |= {"lift": self.laws.lift.torque[ids], "lift_age": self.laws.lift.age[ids]}
        if level is SnapshotLevel.TRAJECTORY:
            files = [self._saved(index) for index in ids.tolist()]
            rows = np.zeros((len(files), max((len(f) for f in files), default=0)), dtype=np.uint8)
            for row, file in zip(rows, files, strict=True):
                row[: len(file)] = np.frombuffer(file, dtype=np.uint8)
            data |= {"bullet": rows, "length": np.array([len(f) for f in files], dtype=np.int64)}
        return data

    def restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        """Write rows that `snapshot` made."""
        exact = level is SnapshotLevel.TRAJECTORY
        for row, index in enumerate(ids.tolist()):
            self._clear(index, data["pose"][row])
            if exact:
                self._load(index, data["bullet"][row, : int(data["length"][row])].tobytes())
            for name in _MIRRORED:
                getattr(self.mirror, name)[index] = data[name][row]
            if not exact:
                self._set_joints(index, self.clients[index].cast.joints)
                for tree in self.clients[index].cast.trees:
                    if tree.free:
                        self._set_root(index, int(tree.bodies[0]), with_pose=True)
            self.mirror.hold(index)
            self.laws.effort[index], self.laws.memory[index] = data["effort"][row], data["memory"][row]
            self.laws.lift.torque[index], self.laws.lift.age[index] = data["lift"][row], data["lift_age"][row]

    def _saved(self, index: int) -> bytes:
        file = self.plan.folder / "state.bullet"
        bullet().saveBullet(str(file), physicsClientId=self.clients[index].id)
        return file.read_bytes()

    def _load(self, index: int, content: bytes) -> None:
        p, failure = bullet(), None
        file = self.plan.folder / "state.bullet"
        file.write_bytes(content)
        with quiet() as words:
            try:
                p.restoreState(fileName=str(file), physicsClientId=self.clients[index].id)
            except p.error as error:
                failure = error
        if failure is not None:
            raise EngineError(f"Bullet cannot restore env {index}: {failure}; {words.tail}") from failure

    # ------------------------------------------------------------------ live editing

    def carried(self) -> dict[str, Any]:
        """What a rebuild takes over by name."""
        for index in range(len(self.clients)):
            self.mirror.settle(index)
        return {name: getattr(self.mirror, name) for name in _MIRRORED} | {"effort": self.laws.effort}

    def take(self, carried: Mapping[str, Array], old: World) -> None:
        """Keep the bits of what stays: poses that went through Bullet come back with other last ones."""
        for kind, names in (
            ("bodies", ("pose", "twist")),
            ("joints", ("position", "velocity", "effort")),
            ("contact_sensors", ("contact",)),
        ):
            before, after = paired(old, self.world, kind)
            for index in range(len(self.clients)):
                self.mirror.refresh(index)
            for name in names:
                target = self.laws.effort if name == "effort" else getattr(self.mirror, name)
                target[:, after] = carried[name][:, before]
        for index in range(len(self.clients)):
            self.mirror.hold(index)
