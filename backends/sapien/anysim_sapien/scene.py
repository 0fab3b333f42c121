"""One env: a sapien.Scene of its own with everything in it, built natively from the World.

A scene is thrown away and built again where PhysX would remember something: at a reset, when a snapshot comes back,
and for parameters that PhysX reads once. Nothing here knows of rendering, so no graphics device is needed.
"""

import threading
from typing import Any, ClassVar, NamedTuple
from weakref import WeakSet

import numpy as np

from anysim.conventions import WORLD, Array, wxyz_from_xyzw
from anysim.kinematics.dynamics import gain
from anysim.model.world import Body, BodyKind, JointType, Solver
from anysim_sapien.exclusions import Group
from anysim_sapien.journal import Journal, Op
from anysim_sapien.library import physx, sapien
from anysim_sapien.packing import Packing, pack
from anysim_sapien.recipe import Recipe, Values, tendon_of
from anysim_sapien.shapes import make_shape, to_pose

FAST = 1e9
"""Stands for no limit where PhysX has a highest speed: 100 m/s and 50 rad/s by default."""

STICKING = 1e6
"""Damping of a dry joint [N m s/rad]: what it may exert is bounded by the friction, so it only has to be large."""

COUPLING = 1e6
"""Stiffness of a mimic joint's tendon [N m/rad or N/m], taken implicitly."""

UNBOUNDED = 3.4e38

_configuring = threading.Lock()
"""PhysX takes the configuration of a scene from a global, at the moment the scene is made."""


class Tree(NamedTuple):
    """An articulation: its handle, its bodies, and its joints in the order of PhysX' degrees of freedom."""

    handle: Any
    bodies: tuple[int, ...]
    joints: Array
    force: Array
    """(n,) float32, for what joints are given in a substep."""


class Left(NamedTuple):
    """What a substep left in an env's links."""

    velocities: list[Array]
    """Of the centres of mass of `layout.links` [m/s]."""
    forces: list[Array]
    """Per articulation those of the joints (n, 6) [N, N m]."""


class EnvScene:
    """A scene, and its parts in the World's order."""

    alive: ClassVar[WeakSet["EnvScene"]] = WeakSet()
    """Scenes that somebody still holds."""

    def __init__(self, recipe: Recipe, values: Values) -> None:
        world = recipe.world
        EnvScene.alive.add(self)
        self.recipe = recipe
        self.values = Values(*(np.array(part) for part in values))
        """The parameters that it was built with."""
        self.journal = Journal()
        """What was done to it since it was built."""
        # as PhysX has them: what a snapshot says of them is what was read from PhysX. None is changed in place, so that
        # what a substep found can be kept without a copy
        self.mass, self.rubbing = np.zeros(len(world.bodies)), np.zeros(len(world.joints))
        """Masses (B,) [kg] and dry friction (J,) [N m] or [N] as they are now."""
        self.com = np.zeros((len(world.bodies), 3))
        """(B, 3) [m] centres of mass in the bodies' frames, as they are now."""
        self.slowing = np.zeros((len(world.bodies), 2))
        """(B, 2) [1/s] what PhysX takes off velocities and rates in a step, over the step."""
        self.gravity = _single(self.values.gravity)
        """[m/s^2], as PhysX has it."""
        self.system = _system(recipe, values.gravity)
        self.scene: Any = sapien.Scene([self.system])
        self.layout = recipe.layout
        self.bodies: list[Any] = [None] * len(world.bodies)
        self.entities: list[Any] = [None] * len(world.bodies)
        self.shapes: list[list[Any]] = [[] for _ in world.geoms]
        self.dry: dict[int, Any] = {}
        self.copies = recipe.copies(values.geom_friction, values.geom_restitution)
        """What the shapes of each geom that collides must be."""
        self.body_of: dict[Any, int] = {}
        """World body of each PhysX component, -1 for the world's own geoms."""
        self._packed: bytes | None = None
        self._left: Left | None = Left([], [])
        if WORLD in recipe.geoms_on:
            self._enter(WORLD, physx.PhysxRigidStaticComponent(), sapien.Pose())
        for body in recipe.layout.actors:
            self._actor(body)
        self.trees = [self._tree(members) for members in recipe.layout.trees]
        self._links = [self.bodies[body] for body in recipe.layout.links]
        self._order: list[Array] | None = None
        self.joints = self._joints()
        for index in np.flatnonzero((values.joint_friction > 0) & self.layout.joint_there):
            self.set_dry(int(index), float(values.joint_friction[index]))
        self.place_joints(recipe.common.initial, np.zeros(len(world.joints)))
        if recipe.packing is None:
            recipe.packing = Packing.of(world, recipe.layout, self)
        self.packing = recipe.packing
        """Where things are in `packed`."""
        self._number = {shape: i for i, shape in enumerate(s for shapes in self.shapes for s in shapes)}
        self.journal.clear()

    # ------------------------------------------------------------------ building

    def _enter(self, body: int, component: Any, pose: Any) -> None:
        """Give a component its shapes and put it into the scene."""
        recipe = self.recipe
        for index in recipe.geoms_on.get(body, ()):
            for copy in self.copies[index]:
                shape = make_shape(
                    recipe.world, recipe.world.geoms[index], copy, recipe.groups.get(body, Group()), recipe.options
                )
                component.attach(shape)
                self.shapes[index].append(shape)
        entity = sapien.Entity()
        entity.add_component(component)
        entity.set_pose(pose)
        self.body_of[component] = body
        if body == WORLD:
            self._ground = component
        else:
            self.bodies[body], self.entities[body] = component, entity
            if not isinstance(component, physx.PhysxRigidStaticComponent):
                self.set_inertial(body, self.values.mass[body], self.values.com[body], self.values.inertia[body])
                self._free_of_defaults(component, recipe.world.bodies[body])
                if self.values.damping[body].any():
                    self.set_damping(body, self.values.damping[body])
        self.scene.add_entity(entity)

    def _actor(self, body: int) -> None:
        recipe = self.recipe
        if recipe.world.bodies[body].kind is BodyKind.STATIC:
            self._enter(body, physx.PhysxRigidStaticComponent(), recipe.common.root_pose[body])
            return
        component = physx.PhysxRigidDynamicComponent()
        self._set_solver(component, recipe.world.bodies[body])
        self._enter(body, component, recipe.common.root_pose[body])

    def _set_solver(self, target: Any, root: Body) -> None:
        """Iterations and sleep of an actor or an articulation: its own, or those of the engine's options."""
        own, options = root.solver or Solver(), self.recipe.options
        positions, velocities = own.position_iterations, own.velocity_iterations
        target.set_sleep_threshold(own.sleep_threshold or 0.0)
        target.set_solver_position_iterations(options.position_iterations if positions is None else positions)
        target.set_solver_velocity_iterations(options.velocity_iterations if velocities is None else velocities)

    def _free_of_defaults(self, component: Any, body: Body) -> None:
        component.set_linear_damping(0.0)
        component.set_angular_damping(0.0)
        component.set_max_linear_velocity(FAST)
        component.set_max_angular_velocity(FAST)
        own = None if body.solver is None else body.solver.depenetration_speed
        component.set_max_depenetration_velocity(self.recipe.options.depenetration_velocity if own is None else own)
        component.set_disable_gravity(body.gravity_compensation)

    def _tree(self, members: tuple[int, ...]) -> Tree:
        recipe, world = self.recipe, self.recipe.world
        made: dict[int, Any] = {}
        for body in members:
            made[body] = physx.PhysxArticulationLinkComponent(made.get(world.bodies[body].parent))
            joint = made[body].joint
            if body == members[0]:
                joint.set_type("fixed" if world.bodies[body].kind is BodyKind.STATIC else "undefined")
                continue
            index = world.body_joint[body]
            spec = world.joints[index]
            # an unwrapped joint counts its turns; the other kind begins again at half a turn
            joint.set_type("prismatic" if spec.type is JointType.PRISMATIC else "revolute_unwrapped")
            joint.set_limit(np.array([[spec.lower, spec.upper]], dtype=np.float32))
            joint.set_friction(0.0)
            joint.set_max_velocity(FAST)
            joint.set_armature(np.array([self.values.armature[index]], dtype=np.float32))
            joint.set_drive_properties(0.0, spec.damping, UNBOUNDED, "force")
            joint.set_drive_velocity_target(0.0)
            joint.set_name(str(index))
        handle = made[members[0]].articulation
        self._set_solver(handle, world.bodies[members[0]])
        for body in members:
            self._enter(body, made[body], recipe.common.root_pose[members[0]])
        for body in members[1:]:
            self._join(body)
        # PhysX sorts the degrees of freedom in its own way: only names tell
        order = np.array([int(joint.name) for joint in handle.active_joints], dtype=int)
        self._tendons(handle, order)
        return Tree(handle, members, order, np.zeros(len(order), dtype=np.float32))

    def _join(self, body: int) -> None:
        """Say where a link's joint is, which must follow what moves centres of mass.

        PhysX keeps the frames of joints relative to the centres of mass, and shifts them, rounding, whenever one moves:
        with each shape and with the inertial. Said last, links are where they should be three times as closely.
        """
        in_parent, in_child = self.recipe.common.frames[self.recipe.world.body_joint[body]]
        self.bodies[body].joint.set_pose_in_parent(in_parent)
        self.bodies[body].joint.set_pose_in_child(in_child)

    def _tendons(self, handle: Any, joints: Array) -> None:
        """Mimic joints: a stiff spring between follower and leader."""
        world = self.recipe.world
        for index in sorted(int(j) for j in joints):
            if world.joints[index].mimic is not None:
                tendon = tendon_of(world, index)
                handle.create_fixed_tendon(
                    [self.bodies[body] for body in tendon.links],
                    tendon.coefficients,
                    [0.0 if c == 0.0 else 1.0 / c for c in tendon.coefficients],
                    rest_length=tendon.rest,
                    offset=0.0,
                    stiffness=COUPLING,
                    damping=0.0,
                )

    def _joints(self) -> list[Any]:
        joints: list[Any] = [None] * len(self.recipe.world.joints)
        for tree in self.trees:
            for index, joint in zip(tree.joints, tree.handle.active_joints, strict=True):
                joints[int(index)] = joint
        return joints

    # ------------------------------------------------------------------ changing

    def _note(self, op: Op, *numbers: Array | float) -> None:
        """Have the journal know of a change that is about to be made."""
        self.left()
        self._packed = None
        self.journal.note(op, *numbers)

    def stepped(self, n: int) -> None:
        """Have the journal know of steps that were made."""
        self._packed = self._left = None
        self.journal.stepped(n)

    def set_inertial(self, body: int, mass: float, com: Array, inertia: Array) -> None:
        """Mass [kg], centre of mass [m] and inertia about it (6,) [kg m^2], in the body's frame."""
        self._note(Op.INERTIAL, body, mass, com, inertia)
        component = self.bodies[body]
        if self.recipe.layout.fixed[body]:
            # the root of a fixed articulation: it cannot move, and PhysX wants positive numbers
            component.set_mass(max(float(mass), 1e-3))
            component.set_inertia([1e-3, 1e-3, 1e-3])
            component.set_cmass_local_pose(sapien.Pose())
            return
        moments, frame = self.recipe.common.principal(body, inertia)
        component.set_mass(float(mass))
        self.mass = _with(self.mass, body, component.mass)  # PhysX keeps its inverse, in single precision
        component.set_inertia(moments.tolist())
        component.set_cmass_local_pose(sapien.Pose(com, wxyz_from_xyzw(frame)))
        self.com = _with(self.com, body, component.cmass_local_pose.p)

    def set_damping(self, body: int, rates: Array) -> None:
        """Rates (2,) [1/s] at which a free body slows down.

        PhysX takes a share of `damping dt` in each step; this share is that of an exponential.
        """
        self._note(Op.DAMPING, body, rates)
        linear, angular = gain(rates, self.recipe.world.physics.dt).tolist()
        self.bodies[body].set_linear_damping(linear)
        self.bodies[body].set_angular_damping(angular)
        damping = self.bodies[body].linear_damping, self.bodies[body].angular_damping
        self.slowing = _with(self.slowing, body, damping)

    def set_dry(self, index: int, friction: float) -> None:
        """Dry friction [N m] or [N] of a joint: a drive to standstill that may exert this much and no more."""
        world = self.recipe.world
        spec = world.joints[index]
        self._note(Op.DRY, index, friction)
        drive = self.dry.get(index)
        if drive is None:
            if friction == 0.0:
                return  # no drive, no friction
            drive = physx.PhysxDriveComponent(self.bodies[spec.body])
            drive.set_parent(self.bodies[world.bodies[spec.body].parent])
            in_parent, in_child = self.recipe.common.frames[index]
            drive.set_pose_in_parent(in_parent)
            drive.set_pose_in_child(in_child)
            self.entities[spec.body].add_component(drive)
            self.dry[index] = drive
        # PhysX bounds the impulse of these drives, not the force
        bound = friction * world.physics.dt
        self.rubbing = _with(self.rubbing, index, float(np.float32(bound)) / world.physics.dt)
        if spec.type is JointType.PRISMATIC:
            drive.set_drive_property_x(0.0, STICKING, bound, "force")
        else:
            drive.set_drive_property_twist(0.0, STICKING, bound, "force")

    def dry_friction(self, index: int) -> float:
        """The dry friction [N m] or [N] that a joint has."""
        drive = self.dry.get(index)
        if drive is None:
            return 0.0
        sliding = self.recipe.world.joints[index].type is JointType.PRISMATIC
        properties = drive.get_drive_property_x() if sliding else drive.get_drive_property_twist()
        return float(properties[2]) / self.recipe.world.physics.dt

    def set_armature(self, index: int, armature: float) -> None:
        """Armature [kg m^2] or [kg] of a joint."""
        self._note(Op.ARMATURE, index, armature)
        self.joints[index].set_armature(np.array([armature], dtype=np.float32))

    def place_body(self, body: int, pose: Array) -> None:
        """Write the pose (7,) of a root body's frame."""
        self._note(Op.POSE, body, pose)
        self.entities[body].set_pose(to_pose(pose))

    def push_body(self, body: int, linear: Array, rate: Array) -> None:
        """Write the velocity of a free root's centre of mass [m/s], and its angular rate [rad/s], world axes."""
        self._note(Op.VELOCITY, body, linear, rate)
        tree = self.recipe.layout.tree_of[body]
        if tree >= 0:
            self.trees[tree].handle.set_root_linear_velocity(linear)
            self.trees[tree].handle.set_root_angular_velocity(rate)
        else:
            self.bodies[body].set_linear_velocity(linear)
            self.bodies[body].set_angular_velocity(rate)

    def place_joints(self, position: Array | None, velocity: Array | None) -> None:
        """Write all joint positions and velocities (J,)."""
        nothing = np.zeros(len(self.recipe.world.joints))
        self._note(
            Op.JOINTS,
            position is not None,
            velocity is not None,
            nothing if position is None else position,
            nothing if velocity is None else velocity,
        )
        for tree in self.trees:
            if position is not None:
                tree.handle.set_qpos(position[tree.joints].astype(np.float32))
            if velocity is not None:
                tree.handle.set_qvel(velocity[tree.joints].astype(np.float32))

    def link_order(self) -> list[Array]:
        """Per articulation the World's bodies in PhysX' order of its links."""
        if self._order is None:
            self._order = [np.array([self.body_of[link] for link in tree.handle.links]) for tree in self.trees]
        return self._order

    def contacts(self) -> list[Any]:
        """PhysX' contacts of the last step, by the numbers of their shapes: its own order is that of addresses."""
        return sorted(self.system.get_contacts(), key=lambda c: [self._number[shape] for shape in c.shapes])

    def pack(self) -> bytes:
        """The state at this moment, also between the substeps of a call."""
        return pack(self.system, self.scene)

    def packed(self) -> bytes:
        """The state, which is read from PhysX once until something is done to the scene."""
        if self._packed is None:
            self._packed = self.pack()
        return self._packed

    def left(self) -> Left:
        """What the last substep left in the links, whatever was written since."""
        if self._left is None:
            forces = [tree.handle.link_incoming_joint_forces for tree in self.trees]
            self._left = Left(self.link_velocities(), forces)
        return self._left

    def link_velocities(self) -> list[Array]:
        """Of the centres of mass of `layout.links`, at this moment."""
        return [link.linear_velocity for link in self._links]

    def poses(self) -> Array:
        """Poses (B, 7) of the bodies' frames, xyzw, float64."""
        return self._taken(self.packing.pose)

    def velocities(self) -> Array:
        """(B, 6) of free bodies' centres of mass, and their rates, float64; 0 of other bodies."""
        return self._taken(self.packing.velocity)

    def joint_positions(self) -> Array:
        """(J,) float64."""
        return self._taken(self.packing.joint_pos)

    def joint_velocities(self) -> Array:
        """(J,) float64."""
        return self._taken(self.packing.joint_vel)

    def _taken(self, places: Array) -> Array:
        return np.frombuffer(self.packed(), dtype=np.float32).take(places).astype(float)


def _with(values: Array, row: int, value: Any) -> Array:
    """A copy with another row."""
    values = values.copy()
    values[row] = value
    return values


def _single(values: Array) -> Array:
    """Rounded to single precision, in double."""
    return values.astype(np.float32).astype(float)


def _system(recipe: Recipe, gravity: Array) -> Any:
    options = recipe.options
    with _configuring:
        physx.set_scene_config(
            gravity=np.asarray(gravity, dtype=np.float32),
            bounce_threshold=options.bounce_threshold,
            enable_pcm=True,
            enable_tgs=False,
            enable_ccd=False,
            enable_enhanced_determinism=True,
            enable_friction_every_iteration=True,
            cpu_workers=0,
        )
        system = physx.PhysxCpuSystem()
    system.set_timestep(recipe.world.physics.dt)
    return system
