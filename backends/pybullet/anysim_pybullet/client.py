"""One env: a Bullet client of its own, built from the plan that all envs share."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from anysim.c_output import quiet
from anysim.conventions import WORLD, Array
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import ConstraintKind, Geom, HeightField, HeightFieldShape, MeshShape, Plane, Quat, Vec3, World
from anysim_mechanics.pair_factors import PairRules
from anysim_mechanics.trees import Frames, Tree, frames_of, shifted, trees_of
from anysim_pybullet.bullet import bullet, connect, disconnect
from anysim_pybullet.cast import Cast
from anysim_pybullet.declared import LINKS
from anysim_pybullet.options import PybulletOptions, sweeps
from anysim_pybullet.urdf import body_link, joint_name, shape_link, tree_urdf, world_geom_urdf, write_meshes

STATIC_GROUP, MOVING_GROUP = 2, 1
MIMIC_FORCE = 1e6
"""[N, N m] that keeps a joint with its leader, and held frames together: more than anything here exerts."""

HOLDING_ERP = 0.8
"""The share of a gap between held frames that a step closes."""

QUARTER = np.array([0.0, 0.0, sqrt(0.5), sqrt(0.5)])
"""A quarter turn about z."""

APART = 500.0
"""[m] between trees that are moved apart, larger than any of them."""

UNBOUNDED = 1e30
"""Bullet's own distance at which contacts begin; its margins bound it to 2 cm."""

SPEED_LIMIT = 1e15
"""Bullet cuts joint and root velocities at 100 unless told otherwise."""

HOLD = 1e-5
"""[m] of rolling friction. Without any, a capsule on a level box sets off by itself, 8 mm in the first second."""

WIDE = 20_000
"""Heights of ground that is kept where an env is built anew: Bullet takes a microsecond for each."""

KEPT = 64
"""How often it is kept before all is built anew: Bullet keeps 38 kB of a robot that was removed until then."""


class Plan:
    """What all envs of an engine share: the trees, their URDF files, the pairs that never touch."""

    def __init__(self, world: World, options: PybulletOptions) -> None:
        self.world, self.options, self.sweeps = world, options, sweeps(options, world)
        self.frames: Frames = frames_of(world)
        self.trees: list[Tree] = trees_of(world, self.frames)
        self.rules = PairRules(world, self.trees, options.contact_erp)
        self._casts = lru_cache(maxsize=64)(self._make_cast)
        self._folder = tempfile.TemporaryDirectory(prefix="anysim-pybullet-")
        self.folder = Path(self._folder.name)
        try:
            self._meshes = meshes = write_meshes(world, self.folder)
            self._urdf = [self._tree_file(tree, self.frames, f"t{tree.number}") for tree in self.trees]
            self._others = 0
            self.ground: list[tuple[int, Geom, str]] = []
            for number, geom in self.rules.shapes_on(np.array([WORLD]))[WORLD]:
                match geom.shape:
                    case Plane() | HeightFieldShape():
                        file = ""
                    case MeshShape(name, concave=True):
                        file = str(meshes[name])
                    case _:
                        file = self._write(f"w{number}", world_geom_urdf(geom, meshes))
                self.ground.append((number, geom, file))
        except BaseException:
            self.close()
            raise
        self.fields: dict[str, HeightField] = {f.name: f for f in world.heightfields}
        self.wide = sum(len(f.heights) * len(f.heights[0]) for f in world.heightfields) > WIDE
        """Whether ground takes longer to build than all the rest."""

    def close(self) -> None:
        """Remove the files."""
        self._folder.cleanup()

    def cast(self, present: Array) -> Cast:
        """What an env has where these entities (E,) are there."""
        return self._casts(present.tobytes())

    def _make_cast(self, present: bytes) -> Cast:
        return Cast.of(self.world, self.trees, self.rules.geoms, np.frombuffer(present, dtype=bool))

    def urdf_of(self, tree: Tree, frames: Frames) -> str:
        """The file of a tree whose bodies have these frames: that of the build, or one of its own."""
        if np.array_equal(frames.inertial[tree.bodies], self.frames.inertial[tree.bodies]):
            return self._urdf[tree.number]
        self._others += 1  # Bullet may keep a file that it has read under its name
        return self._tree_file(tree, frames, f"t{tree.number}_{self._others}")

    def forget(self, file: str) -> None:
        """Remove a file that `urdf_of` made for one env."""
        if file not in self._urdf:
            Path(file).unlink()

    def _tree_file(self, tree: Tree, frames: Frames, name: str) -> str:
        shapes = self.rules.shapes_on(tree.bodies)
        return self._write(name, tree_urdf(self.world, frames, tree, shapes, self._meshes))

    def _write(self, name: str, text: str) -> str:
        path = self.folder / f"{name}.urdf"
        path.write_text(text, encoding="ascii")
        return str(path)


class Env:
    """A client with one copy of the World, or of what is there of it. `root_ids[t]` is the Bullet body of tree t.

    `body_at`, `joint_link`, `shape_at` say where the World's bodies, joints and the shapes of `PairRules` are; what is
    not there is at -1.
    """

    def __init__(self, plan: Plan, cast: Cast, com: Array | None = None) -> None:
        """`com` (B, 3) are the centres of mass in the bodies' frames, where they are not the World's."""
        self.plan = plan
        self._choose(cast, com)
        self.id = connect()
        try:
            self._build()
        except BaseException:
            disconnect(self.id)
            raise

    def close(self) -> None:
        """Free the client. May be called again."""
        if self.id >= 0:
            disconnect(self.id)
        self.id = -1

    def rebuild(self, cast: Cast, com: Array | None = None) -> None:
        """Build what is there now, in the same client: half the work of a new one, and with the same bits after it."""
        keeps = cast is self.cast and self.plan.wide and self._kept < KEPT
        self._choose(cast, com)
        if keeps:
            self._kept += 1
            self._renew_trees()
        else:
            self._build()

    def _renew_trees(self) -> None:
        """Build the trees anew on the ground that is there: a large one takes longer than all the rest.

        Twice, for the bits of a whole build: Bullet orders contacts by numbers that it gives to links, and those that
        a removed body gives back are taken in the opposite order.
        """
        p, ground = bullet(), {number for number, *_ in self.plan.ground}
        with self._building(p):
            for _ in range(2):
                for tree in reversed(self.cast.trees):
                    p.removeBody(self.root_ids[tree.number], physicsClientId=self.id)
                self.shape_at = {number: place for number, place in self.shape_at.items() if number in ground}
                self._begin = {number: begin for number, begin in self._begin.items() if number in ground}
                self.body_of = {uid: self.body_of[uid] for uid, _ in self.shape_at.values()}
                self.rubbing = {}
                for tree in self.cast.trees:
                    self._add_tree(p, tree)
            self._filter(p)
            self._couple(p)
            self._measure(p)
            self._hold(p)

    def _choose(self, cast: Cast, com: Array | None) -> None:
        self.cast, self.frames = cast, self.plan.frames if com is None else shifted(self.plan.frames, com)

    # ------------------------------------------------------------------ building

    def _build(self) -> None:
        p, world, plan = bullet(), self.plan.world, self.plan
        self._kept = 0
        self.body_at: list[tuple[int, int]] = [(-1, -1)] * len(world.bodies)
        self.joint_link: list[int] = [-1] * len(world.joints)
        self.rubbing: dict[int, float] = {}
        """The dry friction that Bullet applies, by joint."""
        self.shape_at: dict[int, tuple[int, int]] = {}
        self.body_of: dict[int, dict[int, int]] = {}  # World body by Bullet body and link, -1 for the world
        self.root_ids: list[int] = [-1] * len(plan.trees)
        self._begin: dict[int, float] = {}  # where contacts of a shape begin, where that is not Bullet's default
        with self._building(p):
            self._settings(p)
            for number, geom, file in plan.ground:
                self._add_ground(p, number, geom, file)
            for tree in self.cast.trees:
                self._add_tree(p, tree)
            self._filter(p)
            self._couple(p)
            # else Bullet keeps the first file of a name that it reads, and restores that state again and again
            p.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self.id)
            self._measure(p)
            self._hold(p)

    @contextmanager
    def _building(self, p: Any) -> Iterator[None]:
        """Silence, and an error of anysim's for one of Bullet's."""
        failure: Exception | None = None
        with quiet() as words:
            try:
                yield
            except p.error as error:
                failure = error
        if failure is not None:
            name = self.plan.world.name
            raise EngineError(f"Bullet cannot build the world '{name}': {failure}; {words.tail}") from failure

    def _measure(self, p: Any) -> None:
        """Note where Bullet has put things."""
        plan = self.plan
        self.tree_links = [[self.joint_link[j] for j in tree.joints.tolist()] for tree in plan.trees]
        self.local = np.concatenate([self.frames.inertial, self.frames.anchor], axis=1)
        for tree in self.cast.trees:
            info = p.getDynamicsInfo(self.root_ids[tree.number], -1, physicsClientId=self.id)
            self.local[tree.bodies[0], :7] = [*info[3], *info[4]]

    def _settings(self, p: Any) -> None:
        physics, options = self.plan.world.physics, self.plan.options
        # The usual broad phase keeps boxes that are larger for what moved before, so that touch begins earlier there:
        # a state would not be all that the future depends on. The simple one knows the present alone.
        p.resetSimulation(p.RESET_USE_SIMPLE_BROADPHASE, physicsClientId=self.id)
        # without ordered pairs neither equal runs nor saved states are exact
        p.setPhysicsEngineParameter(
            deterministicOverlappingPairs=1,
            fixedTimeStep=physics.dt,
            numSubSteps=0,
            numSolverIterations=self.plan.sweeps,
            solverResidualThreshold=options.residual,
            erp=options.joint_erp,
            contactERP=options.contact_erp,
            restitutionVelocityThreshold=0.01,
            physicsClientId=self.id,
        )
        p.setGravity(*physics.gravity, physicsClientId=self.id)

    def _add_ground(self, p: Any, number: int, geom: Geom, file: str) -> None:
        place, turn = np.array(geom.position, dtype=float), geom.quaternion
        if isinstance(geom.shape, Plane):
            shape = p.createCollisionShape(p.GEOM_PLANE, planeNormal=[0, 0, 1], physicsClientId=self.id)
        elif isinstance(geom.shape, HeightFieldShape):
            shape, middle = self._height_field(p, self.plan.fields[geom.shape.heightfield])
            place = place + P.rotate(np.array(turn), np.array([0.0, 0.0, middle]))
            turn = P.multiply(np.array(turn), QUARTER).tolist()
        elif isinstance(geom.shape, MeshShape) and geom.shape.concave:
            # from the file: arrays pass through shared memory, which is too small for large ground
            flags = p.GEOM_FORCE_CONCAVE_TRIMESH
            shape = p.createCollisionShape(p.GEOM_MESH, fileName=file, flags=flags, physicsClientId=self.id)
            if shape < 0:
                raise EngineError(f"Bullet cannot make a triangle mesh of geom '{geom.name}'")
        else:
            flags = p.URDF_IGNORE_VISUAL_SHAPES | p.URDF_USE_IMPLICIT_CYLINDER
            uid = p.loadURDF(file, useFixedBase=1, flags=flags, physicsClientId=self.id)
            self._know(number, uid, -1)
            return
        # something to look at, which nobody does here: Bullet makes 350 bytes of it a cell where there is nothing
        speck = p.createVisualShape(p.GEOM_SPHERE, radius=1e-3, physicsClientId=self.id)
        uid = p.createMultiBody(0, shape, speck, place.tolist(), turn, physicsClientId=self.id)
        self._know(number, uid, -1)

    def _know(self, number: int, uid: int, link: int) -> None:
        self.shape_at[number] = (uid, link)
        self.body_of.setdefault(uid, {})[link] = self.plan.world.geoms[self.plan.rules.geoms[number]].body

    def _height_field(self, p: Any, field: HeightField) -> tuple[int, float]:
        """The shape, in a frame that is a `QUARTER` turned: Bullet cuts cells along the other diagonal than the World.

        Also the middle of the range of heights, which Bullet puts at the shape's frame.
        """
        heights = np.asarray(field.heights, dtype=float)
        rows, cols = heights.shape
        shape = p.createCollisionShape(
            p.GEOM_HEIGHTFIELD,
            meshScale=[field.size[1] / (rows - 1), field.size[0] / (cols - 1), 1.0],
            heightfieldData=heights.T[::-1].ravel().tolist(),
            numHeightfieldRows=rows,
            numHeightfieldColumns=cols,
            physicsClientId=self.id,
        )
        return shape, 0.5 * float(heights.min() + heights.max())

    def _add_tree(self, p: Any, tree: Tree) -> None:
        world, client = self.plan.world, self.id
        flags = (
            p.URDF_USE_INERTIA_FROM_FILE
            | p.URDF_USE_SELF_COLLISION
            | p.URDF_IGNORE_VISUAL_SHAPES
            | p.URDF_USE_IMPLICIT_CYLINDER
        )
        file = self.plan.urdf_of(tree, self.frames)
        uid = p.loadURDF(file, useFixedBase=0 if tree.free else 1, flags=flags, physicsClientId=client)
        self.plan.forget(file)
        if p.getNumJoints(uid, physicsClientId=client) > LINKS:
            name = world.bodies[tree.bodies[0]].name
            raise EngineError(
                f"'{name}' needs several shapes a surface, more than the {LINKS} links that Bullet tells of"
            )
        self.root_ids[tree.number] = uid
        links: dict[str, int] = {body_link(int(tree.bodies[0])): -1}
        joints: dict[str, int] = {}
        for i in range(p.getNumJoints(uid, physicsClientId=client)):
            info = p.getJointInfo(uid, i, physicsClientId=client)
            joints[info[1].decode()], links[info[12].decode()] = i, i
        for body in tree.bodies.tolist():
            link = links[body_link(body)]
            self.body_at[body] = (uid, link)
            self.body_of.setdefault(uid, {})[link] = body
        for body, shapes in self.plan.rules.shapes_on(tree.bodies).items():
            for k, (number, _) in enumerate(shapes):
                self._know(number, uid, links[shape_link(number) if k else body_link(body)])
        for link in (-1, *links.values()):
            p.changeDynamics(
                uid,
                link,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                maxJointVelocity=SPEED_LIMIT,
                rollingFriction=HOLD,
                physicsClientId=client,
            )
        for j in tree.joints.tolist():
            self.joint_link[j] = joints[joint_name(j)]
            # every joint begins with a motor that holds it; what is left of it is the joint's dry friction
            self.set_dry_friction(j, world.joints[j].friction)

    def set_dry_friction(self, joint: int, friction: float) -> None:
        """Bullet's velocity motor with target 0: a constraint with a bounded force, which is dry friction."""
        if self.rubbing.get(joint) == friction:
            return
        self.rubbing[joint] = friction
        p = bullet()
        uid = self.body_at[self.plan.world.joints[joint].body][0]
        p.setJointMotorControl2(
            uid, self.joint_link[joint], p.VELOCITY_CONTROL, targetVelocity=0.0, force=friction, physicsClientId=self.id
        )

    def _filter(self, p: Any) -> None:
        """Switch off the pairs of shapes that never collide; the rest of the World collides."""
        world, rules = self.plan.world, self.plan.rules
        for number, (uid, link) in self.shape_at.items():
            body = world.geoms[rules.geoms[number]].body
            still = body == WORLD or world.bodies[body].kind == "static"
            group, mask = (STATIC_GROUP, MOVING_GROUP) if still else (MOVING_GROUP, MOVING_GROUP | STATIC_GROUP)
            p.setCollisionFilterGroupMask(uid, link, group, mask, physicsClientId=self.id)
        shapes = self.cast.shapes
        for first, second in zip(*np.nonzero(np.triu(rules.weight[np.ix_(shapes, shapes)] == 0.0, 1)), strict=True):
            (uid_a, link_a), (uid_b, link_b) = self.shape_at[int(shapes[first])], self.shape_at[int(shapes[second])]
            p.setCollisionFilterPair(uid_a, uid_b, link_a, link_b, 0, physicsClientId=self.id)

    def _hold(self, p: Any) -> None:
        """Hold the frames of the World's constraints together; Bullet has them at the bodies' centres of mass."""
        kinds = {ConstraintKind.CONNECT: p.JOINT_POINT2POINT, ConstraintKind.WELD: p.JOINT_FIXED}
        for one in self.plan.world.constraints:
            ends = (one.body, one.position, one.quaternion), (one.other, one.other_position, one.other_quaternion)
            if any(body != WORLD and self.body_at[body][0] < 0 for body, *_ in ends):
                continue
            (uid, link), place, turn = self._end(*ends[0])
            (other, other_link), other_place, other_turn = self._end(*ends[1])
            frames = place, other_place, turn, other_turn
            number = p.createConstraint(
                uid, link, other, other_link, kinds[one.kind], [0, 0, 0], *frames, physicsClientId=self.id
            )
            p.changeConstraint(number, maxForce=MIMIC_FORCE, erp=HOLDING_ERP, physicsClientId=self.id)

    def _end(self, body: int, position: Vec3, quaternion: Quat) -> tuple[tuple[int, int], list[float], list[float]]:
        """Bullet's body and link, and a frame of the body in the axes of its inertia."""
        pose, place = P.pose(position, quaternion), (-1, -1)
        if body != WORLD:
            place = self.body_at[body]
            local = self.local[body]
            pose[:3] -= local[7:]
            pose = P.compose(P.inverse(local[:7]), pose)
        return place, pose[:3].tolist(), pose[3:].tolist()

    def _couple(self, p: Any) -> None:
        world = self.plan.world
        for index in self.cast.joints.tolist():
            joint = world.joints[index]
            if joint.mimic is None:
                continue
            uid = self.body_at[joint.body][0]
            leader = world.joints[joint.mimic.joint]
            gear = p.createConstraint(
                uid,
                self.joint_link[index],
                self.body_at[leader.body][0],
                self.joint_link[joint.mimic.joint],
                p.JOINT_GEAR,
                [1, 0, 0],
                [0, 0, 0],
                [0, 0, 0],
                physicsClientId=self.id,
            )
            p.changeConstraint(
                gear,
                gearRatio=-joint.mimic.multiplier,
                relativePositionTarget=joint.mimic.offset,
                erp=0.8,
                maxForce=MIMIC_FORCE,
                physicsClientId=self.id,
            )

    # ------------------------------------------------------------------ contacts of the past

    def part(self) -> bool:
        """Move everything that can move far apart, so that Bullet forgets what touched; a restored state keeps it else.

        Returns:
            False where links of one robot touch each other: those cannot be parted, and the client must be replaced.
        """
        p = bullet()
        for tree in self.cast.trees:
            if tree.free or len(tree.joints):
                uid, away = self.root_ids[tree.number], [APART * (tree.number + 1), 0.0, 10 * APART]
                p.resetBasePositionAndOrientation(uid, away, [0.0, 0.0, 0.0, 1.0], physicsClientId=self.id)
        p.performCollisionDetection(physicsClientId=self.id)
        return not p.getContactPoints(physicsClientId=self.id)

    # ------------------------------------------------------------------ surfaces

    def set_surfaces(self, friction: Array, restitution: Array) -> None:
        """Give Bullet its numbers for the coefficients (K,) of the shapes' geoms."""
        p, rules = bullet(), self.plan.rules
        numbers = rules.numbers(friction, restitution, self.cast.shapes)
        for row, number in enumerate(self.cast.shapes.tolist()):
            offset = self.plan.world.geoms[rules.geoms[number]].surface.contact_offset
            # Bullet begins a contact before the touch and takes the gap off the speed after it: no bounce is left
            begin = 0.0 if restitution[number] > 0 else UNBOUNDED if offset is None else offset
            if begin != self._begin.get(number, UNBOUNDED):
                self._begin[number] = begin
                p.changeDynamics(*self.shape_at[number], contactProcessingThreshold=begin, physicsClientId=self.id)
            p.changeDynamics(
                *self.shape_at[number],
                lateralFriction=float(numbers.friction[row]),
                spinningFriction=float(numbers.spinning[row]),
                restitution=float(numbers.restitution[row]),
                physicsClientId=self.id,
            )
