"""The parts of a scene, and what may be done to them: every write that PhysX gets between steps is made here."""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.kinematics.dynamics import gain
from anysim.model.world import JointType
from anysim_mechanics.journal import Journal, Op
from anysim_sapien.library import physx, sapien
from anysim_sapien.recipe import Recipe
from anysim_sapien.shapes import to_pose

STICKING = 1e6
"""Damping of a dry joint [N m s/rad]: what it may exert is bounded by the friction, so it only has to be large."""


class Tree(NamedTuple):
    """An articulation: its handle, its bodies, and its joints in the order of PhysX' degrees of freedom."""

    handle: Any
    bodies: tuple[int, ...]
    joints: Array
    force: Array
    """(n,) float32, for what joints are given in a substep."""


class SceneParts:
    """What is in a scene, in the World's order; what is not there is None."""

    def __init__(self, recipe: Recipe) -> None:
        world = recipe.world
        self.recipe, self.layout = recipe, recipe.layout
        self.journal = Journal()
        """What was done to the scene since it was built."""
        # as PhysX has them: what a snapshot says of them is what was read from PhysX. None is changed in place, so that
        # what a substep found can be kept without a copy
        self.mass, self.rubbing = np.zeros(len(world.bodies)), np.zeros(len(world.joints))
        """Masses (B,) [kg] and dry friction (J,) [N m] or [N] as they are now."""
        self.com = np.zeros((len(world.bodies), 3))
        """(B, 3) [m] centres of mass in the bodies' frames, as they are now."""
        self.slowing = np.zeros((len(world.bodies), 2))
        """(B, 2) [1/s] what PhysX takes off velocities and rates in a step, over the step."""
        self.bodies: list[Any] = [None] * len(world.bodies)
        self.entities: list[Any] = [None] * len(world.bodies)
        self.joints: list[Any] = [None] * len(world.joints)
        self.trees: list[Tree] = []
        self.dry: dict[int, Any] = {}
        """The drives that are dry friction, by joint."""

    def note(self, op: Op, *numbers: Array | float) -> None:
        """Have the journal know of a change that is about to be made."""
        self.journal.note(op, *numbers)

    def set_inertial(self, body: int, mass: float, com: Array, inertia: Array) -> None:
        """Mass [kg], centre of mass [m] and inertia about it (6,) [kg m^2], in the body's frame."""
        self.note(Op.INERTIAL, body, mass, com, inertia)
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
        self.note(Op.DAMPING, body, rates)
        linear, angular = gain(rates, self.recipe.world.physics.dt).tolist()
        self.bodies[body].set_linear_damping(linear)
        self.bodies[body].set_angular_damping(angular)
        damping = self.bodies[body].linear_damping, self.bodies[body].angular_damping
        self.slowing = _with(self.slowing, body, damping)

    def set_dry(self, index: int, friction: float) -> None:
        """Dry friction [N m] or [N] of a joint: a drive to standstill that may exert this much and no more."""
        world = self.recipe.world
        spec = world.joints[index]
        self.note(Op.DRY, index, friction)
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
        self.note(Op.ARMATURE, index, armature)
        self.joints[index].set_armature(np.array([armature], dtype=np.float32))

    def place_body(self, body: int, pose: Array) -> None:
        """Write the pose (7,) of a root body's frame."""
        self.note(Op.POSE, body, pose)
        self.entities[body].set_pose(to_pose(pose))

    def push_body(self, body: int, linear: Array, rate: Array) -> None:
        """Write the velocity of a free root's centre of mass [m/s], and its angular rate [rad/s], world axes."""
        self.note(Op.VELOCITY, body, linear, rate)
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
        self.note(
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


def _with(values: Array, row: int, value: Any) -> Array:
    """A copy with another row."""
    values = values.copy()
    values[row] = value
    return values
