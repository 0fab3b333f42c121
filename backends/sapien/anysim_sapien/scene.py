"""One env: a sapien.Scene of its own with everything in it, built natively from the World.

A scene is thrown away and built again where PhysX would remember something: at a reset, when a snapshot comes back,
and for parameters that PhysX reads once. Nothing here knows of rendering, so no graphics device is needed.
"""

import threading
from typing import Any, ClassVar, NamedTuple
from weakref import WeakSet

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.world import Body, BodyKind, Constraint, ConstraintKind, JointType, Solver
from anysim_mechanics.exclusion_groups import Group
from anysim_mechanics.journal import Op
from anysim_mechanics.mimic_tendons import tendon_of
from anysim_sapien.library import physx, sapien
from anysim_sapien.packing import Packing, pack
from anysim_sapien.parts import SceneParts, Tree
from anysim_sapien.recipe import Recipe, Values
from anysim_sapien.shapes import make_shape, to_pose

FAST = 1e9
"""Stands for no limit where PhysX has a highest speed: 100 m/s and 50 rad/s by default."""

COUPLING = 1e6
"""Stiffness of a mimic joint's tendon [N m/rad or N/m], taken implicitly."""

WELD = 1e7, 6e3
"""Stiffness [1/s^2] and damping [1/s] of the drive that keeps a weld from turning, taken implicitly."""

UNBOUNDED = 3.4e38

_configuring = threading.Lock()
"""PhysX takes the configuration of a scene from a global, at the moment the scene is made."""


class LastMotion(NamedTuple):
    """What a substep left in an env's links."""

    velocities: list[Array]
    """Of the centres of mass of `layout.links` [m/s]."""
    forces: list[Array]
    """Per articulation those of the joints (n, 6) [N, N m]."""


class EnvScene(SceneParts):
    """A scene, and its parts in the World's order."""

    alive: ClassVar[WeakSet["EnvScene"]] = WeakSet()
    """Scenes that somebody still holds."""

    def __init__(self, recipe: Recipe, values: Values) -> None:
        super().__init__(recipe)
        world = recipe.world
        EnvScene.alive.add(self)
        self.values = Values(*(np.array(part) for part in values))
        """The parameters that it was built with."""
        self.gravity = _single(self.values.gravity)
        """[m/s^2], as PhysX has it."""
        self.system = _system(recipe, values.gravity)
        self.scene: Any = sapien.Scene([self.system])
        self.shapes: list[list[Any]] = [[] for _ in world.geoms]
        self.copies = recipe.copies(values.geom_friction, values.geom_restitution)
        """What the shapes of each geom that collides must be."""
        self.body_of: dict[Any, int] = {}
        """World body of each PhysX component, -1 for the world's own geoms."""
        self._packed: bytes | None = None
        self._left: LastMotion | None = LastMotion([], [])
        if WORLD in recipe.geoms_on:
            self._enter(WORLD, physx.PhysxRigidStaticComponent(), sapien.Pose())
        for body in recipe.layout.actors:
            self._actor(body)
        for members in recipe.layout.trees:
            self._add_tree(members)
        for constraint in world.constraints:
            self._hold(constraint)
        self._links = [self.bodies[body] for body in recipe.layout.links]
        self._order: list[Array] | None = None
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
                geom, group = recipe.world.geoms[index], recipe.groups.get(body, Group())
                shape = make_shape(recipe.world, geom, copy, group, recipe.options, recipe.common.ground_files)
                component.attach(shape)
                self.shapes[index].append(shape)
        entity = sapien.Entity()
        entity.add_component(component)
        entity.set_pose(pose)
        self.body_of[component] = body
        if body != WORLD:
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

    def _add_tree(self, members: tuple[int, ...]) -> None:
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
        self.trees.append(Tree(handle, members, order, np.zeros(len(order), dtype=np.float32)))
        for index, joint in zip(order.tolist(), handle.active_joints, strict=True):
            self.joints[index] = joint

    def _join(self, body: int) -> None:
        """Say where a link's joint is, which must follow what moves centres of mass.

        PhysX keeps the frames of joints relative to the centres of mass, and shifts them, rounding, whenever one moves:
        with each shape and with the inertial. Said last, links are where they should be three times as closely.
        """
        in_parent, in_child = self.recipe.common.frames[self.recipe.world.body_joint[body]]
        self.bodies[body].joint.set_pose_in_parent(in_parent)
        self.bodies[body].joint.set_pose_in_child(in_child)

    def _hold(self, one: Constraint) -> None:
        """Hold the frames of a constraint together by a joint of PhysX' six axes.

        Shifts are locked. Turns are not, even where PhysX is told so: a stiff drive holds them.
        """
        ends = (one.body, one.position, one.quaternion), (one.other, one.other_position, one.other_quaternion)
        if any(body != WORLD and self.bodies[body] is None for body, *_ in ends):
            return
        (body, *frame), (other, *other_frame) = ends
        joint = physx.PhysxDriveComponent(self.bodies[body])
        joint.set_parent(None if other == WORLD else self.bodies[other])
        joint.set_pose_in_child(to_pose(np.concatenate(frame)))
        joint.set_pose_in_parent(to_pose(np.concatenate(other_frame)))
        for lock in (joint.set_limit_x, joint.set_limit_y, joint.set_limit_z):
            lock(0.0, 0.0)
        if one.kind is ConstraintKind.WELD:
            joint.set_drive_property_slerp(*WELD, UNBOUNDED, "acceleration")
        self.entities[body].add_component(joint)

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

    # ------------------------------------------------------------------ changing and reading

    def note(self, op: Op, *numbers: Array | float) -> None:
        self.left()
        self._packed = None
        super().note(op, *numbers)

    def stepped(self, n: int) -> None:
        """Have the journal know of steps that were made."""
        self._packed = self._left = None
        self.journal.stepped(n)

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

    def left(self) -> LastMotion:
        """What the last substep left in the links, whatever was written since."""
        if self._left is None:
            forces = [tree.handle.link_incoming_joint_forces for tree in self.trees]
            self._left = LastMotion(self.link_velocities(), forces)
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
