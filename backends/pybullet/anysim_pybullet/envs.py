"""The clients of all envs of an engine: building, writing, stepping, saving and restoring one of them."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from anysim.c_output import quiet
from anysim.conventions import Array
from anysim.engine.control import Control
from anysim.engine.state import SnapshotLevel
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import BodyKind, World
from anysim_mechanics.one_world.base import EnvWorlds, Painter
from anysim_mechanics.one_world.last_substep import LastSubstep
from anysim_pybullet import contacts
from anysim_pybullet.audit import handles, read_back
from anysim_pybullet.bullet import bullet
from anysim_pybullet.cast import Cast
from anysim_pybullet.client import Env, Plan
from anysim_pybullet.law import Laws, Pusher
from anysim_pybullet.options import PybulletOptions
from anysim_pybullet.parameters import Parameters
from anysim_pybullet.state import Mirror

_MIRRORED = ("pose", "twist", "position", "velocity")


class Envs(EnvWorlds):
    """The clients, and all that is kept beside them."""

    parameters: Parameters

    def __init__(self, world: World, present: Array, options: PybulletOptions) -> None:
        """With the entities (N, E) that are there in each env."""
        self.world, self.plan = world, Plan(world, options)
        self.clients: list[Env] = []
        self.last = LastSubstep(world, len(present), self._exerted, self._touched)
        try:
            for row in present:
                self.clients.append(Env(self.plan, self.plan.cast(row)))
            self.laws = Laws(world, self.plan.frames, self.plan.trees, self.clients, self.last.effort)
            self.parameters = Parameters(world, self.clients, self.laws, self._rebuild, options)
            self.mirror = Mirror(world, self.clients, self.laws)
            self.lost = self.mirror.fault
            self._tree_of = np.zeros(len(world.bodies), dtype=int)
            for tree in self.plan.trees:
                self._tree_of[tree.bodies] = tree.number
            self._static = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.STATIC], dtype=int)
            self._begin: list[int] = [0] * len(present)
            self._initial: list[dict[str, Array]] = [{} for _ in present]
            for env in range(len(present)):
                self._settle(env)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        while self.clients:
            self.clients.pop().close()
        self.plan.close()

    def _exerted(self, env: int) -> None:
        if self.laws.motors is not None:  # the law writes its own efforts
            self.mirror.refresh(env)

    def _touched(self, env: int) -> Array:
        return contacts.sensor_forces(self.world, self.clients[env])

    # ------------------------------------------------------------------ the initial state

    def _settle(self, env: int) -> None:
        """Bring a client that was just built into the World's initial state, and have Bullet remember it."""
        world, mirror = self.world, self.mirror
        self.parameters.push_surfaces(env)
        mirror.pose[env], mirror.twist[env] = world.initial_body_pose, 0.0
        mirror.position[env], mirror.velocity[env] = [j.initial for j in world.joints], 0.0
        self._put_motion(env)
        mirror.wrote(env)
        mirror.refresh(env)
        self.laws.roots[env] = mirror.pose[env]
        self._begin[env] = bullet().saveState(physicsClientId=self.clients[env].id)
        self._initial[env] = self._mirrored(env)

    def _mirrored(self, env: int) -> dict[str, Array]:
        return {name: getattr(self.mirror, name)[env].copy() for name in _MIRRORED}

    def _mirror(self, env: int, rows: Mapping[str, Array]) -> None:
        """Make these what is known of an env."""
        for name in _MIRRORED:
            getattr(self.mirror, name)[env] = rows[name]
        self.mirror.hold(env)

    def _put_motion(self, env: int, statics: bool = True) -> None:
        """Give Bullet the joints and roots that the mirror has."""
        cast = self.clients[env].cast
        self._set_joints(env, cast.joints)
        roots = [int(tree.bodies[0]) for tree in cast.trees if statics or tree.free]
        self._set_roots(env, np.array(roots, dtype=int), with_pose=True)
        self.mirror.hold(env)

    def populate(self, env: int, present: Array) -> None:
        cast = self.plan.cast(present)
        if cast is not self.clients[env].cast:
            self.mirror.refresh(env)
            try:
                self._renew(env, cast)
            except BaseException:
                self.lost[env] = True  # what is half built is not built upon
                raise

    def _renew(self, env: int, cast: Cast) -> None:
        """Build an env anew; one that was given up in a new client, since what is not finite stays in the old one."""
        client, com = self.clients[env], self.parameters.shifted_com(env)
        if self.lost[env]:
            client.close()
            self.clients[env] = Env(self.plan, cast, com)
        else:
            bullet().removeState(self._begin[env], physicsClientId=client.id)
            client.rebuild(cast, com)
        self.lost[env] = False
        self.laws.refresh()
        self._settle(env)
        self.parameters.renew(env)

    def reset(self, env: int) -> None:
        initial = self._initial[env]
        self._clear(env, initial["pose"])
        bullet().restoreState(self._begin[env], physicsClientId=self.clients[env].id)
        self._mirror(env, initial)
        self.laws.forget(env)

    def _clear(self, env: int, pose: Array) -> None:
        """Make an env forget its contacts, before a state is restored in which fixed bodies are at `pose` (B, 7).

        An env that was given up gets a new client: what is not finite stays in Bullet's collision detection.
        """
        self.mirror.refresh(env)
        client = self.clients[env]
        if self.lost[env] or not client.part():
            self.lost[env] = True
            self._renew(env, client.cast)
        fixed = self._static[client.cast.bodies[self._static]]
        self.mirror.pose[env, fixed] = pose[fixed]
        self._set_roots(env, fixed, with_pose=True)

    def _rebuild(self, env: int) -> None:
        """Build an env anew, in its present state: for what Bullet reads once. It has forgotten its contacts."""
        self.last.settle(env)
        self.mirror.refresh(env)
        kept = self._mirrored(env)
        self._renew(env, self.clients[env].cast)
        self._mirror(env, kept)
        self._put_motion(env)
        self.laws.forget(env)

    # ------------------------------------------------------------------ stepping and reading

    def step(self, env: int, n_steps: int) -> None:
        client = self.clients[env]
        lifter = self.laws.lifter(client, env)
        if lifter is None:
            sound = Pusher(client, env, self.laws, bullet(), self.world.physics.dt).run(n_steps)
        else:
            sound = lifter.run(bullet(), n_steps, self.mirror.known_position(env))
        self.mirror.stepped(env, sound)

    def read(self, name: str) -> Array:
        return self.mirror.field(name)

    def apply_control(self, control: Control) -> None:
        self.laws.apply(control)

    def apply_wrench(self, wrench: Array | None) -> None:
        self.laws.wrench = wrench

    # ------------------------------------------------------------------ writing

    def write_joints(self, env: int, joints: Array, position: Array | None, velocity: Array | None) -> None:
        self.mirror.refresh(env)
        if position is not None:
            self.mirror.position[env, joints] = position
        if velocity is not None:
            self.mirror.velocity[env, joints] = velocity
        self._set_joints(env, joints)
        self._wrote(env, np.array([self.world.joints[j].body for j in joints], dtype=int))

    def write_bodies(self, env: int, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        self.mirror.refresh(env)
        if pose is not None:
            self.mirror.pose[env, bodies] = pose
        if twist is not None:
            self.mirror.twist[env, bodies] = twist
        self._set_roots(env, bodies, with_pose=pose is not None)
        self._wrote(env, bodies)

    def _wrote(self, env: int, bodies: Array) -> None:
        self.mirror.wrote(env)
        self.laws.forget(env, np.unique(self._tree_of[bodies]))

    def _set_joints(self, env: int, joints: Array) -> None:
        p, client = bullet(), self.clients[env]
        position, velocity = self.mirror.position[env].tolist(), self.mirror.velocity[env].tolist()
        for j in joints.tolist():
            uid, link = client.body_at[self.world.joints[j].body][0], client.joint_link[j]
            p.resetJointState(uid, link, position[j], velocity[j], physicsClientId=client.id)

    def _set_roots(self, env: int, bodies: Array, with_pose: bool) -> None:
        """Give Bullet poses of roots' centres of mass, and their velocities, which writing a pose makes zero."""
        p, client, poses, twists = (
            bullet(),
            self.clients[env],
            self.mirror.pose[env, bodies],
            self.mirror.twist[env, bodies],
        )
        local = client.local[bodies, :7]
        places = P.compose(poses, local).tolist() if with_pose else []
        arms = P.rotate(poses[:, 3:], local[:, :3])
        speeds, rates = (twists[:, :3] + P.cross(twists[:, 3:], arms)).tolist(), twists[:, 3:].tolist()
        for row, body in enumerate(bodies.tolist()):
            uid = client.body_at[body][0]
            if with_pose:
                p.resetBasePositionAndOrientation(uid, places[row][:3], places[row][3:], physicsClientId=client.id)
            if self.world.bodies[body].kind is BodyKind.STATIC:
                self.laws.roots[env, body] = poses[row]
            else:
                p.resetBaseVelocity(uid, speeds[row], rates[row], physicsClientId=client.id)

    # ------------------------------------------------------------------ snapshots

    def rows(self, env: int, level: SnapshotLevel) -> Mapping[str, ArrayLike]:
        self.mirror.refresh(env)
        lift = self.laws.lift
        rows = self._mirrored(env) | {"fault": self.lost[env], "memory": self.laws.memory[env]}
        rows |= {"lift": lift.torque[env], "lift_age": lift.age[env]}
        if level is SnapshotLevel.TRAJECTORY:  # with Bullet's own file
            file = self.plan.folder / "state.bullet"
            bullet().saveBullet(str(file), physicsClientId=self.clients[env].id)
            content = np.frombuffer(file.read_bytes(), dtype=np.uint8)
            rows |= {"bullet": content, "length": np.int64(len(content))}
        return rows

    def put_rows(self, env: int, rows: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._clear(env, rows["pose"])
        if level is SnapshotLevel.TRAJECTORY:
            self._load(env, rows["bullet"][: int(rows["length"])].tobytes())
        self._mirror(env, rows)
        self.lost[env] = rows["fault"]
        if level is not SnapshotLevel.TRAJECTORY:
            self._put_motion(env, statics=False)
        self.laws.memory[env] = rows["memory"]
        self.laws.lift.torque[env], self.laws.lift.age[env] = rows["lift"], rows["lift_age"]

    def _load(self, env: int, content: bytes) -> None:
        p, failure = bullet(), None
        file = self.plan.folder / "state.bullet"
        file.write_bytes(content)
        with quiet() as words:
            try:
                p.restoreState(fileName=str(file), physicsClientId=self.clients[env].id)
            except p.error as error:
                failure = error
        if failure is not None:
            raise EngineError(f"Bullet cannot restore env {env}: {failure}; {words.tail}") from failure

    # ------------------------------------------------------------------ sensing and checks

    def contacts(self, env: int) -> list[tuple[Array, ...]]:
        return [contacts.contact_points(self.clients[env])]

    def raycast(self, env: int, origins: Array, directions: Array) -> tuple[Array, Array]:
        return contacts.raycast(self.clients[env], origins, directions)

    def painter(self) -> Painter:
        from anysim_pybullet.render import Painter

        return Painter(self.world, self.parameters.looks)

    def read_back(self) -> Mapping[str, Array]:
        return read_back(self.clients[0])

    def handles(self) -> Mapping[str, int]:
        return handles(self.clients)

    def raw_loop(self, control: Control) -> Callable[[int], None]:
        from anysim_pybullet.raw import raw_loop

        return raw_loop(self, control)
