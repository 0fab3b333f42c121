"""The neutral model: what every engine builds from. Frozen, in SI units, names turned into indices.

A `World` lists bodies depth first (children in source order). A body is free (it floats), static (a root welded to
the world) or a link (moved by one joint against its parent). Links that a source joins rigidly are lumped into one
body; their frames survive as sites. All joints here have one degree of freedom; a free body's six are its pose.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from anysim.conventions import Array
from anysim.model.appearance import Material as Material, Texture as Texture
from anysim.model.couplings import (
    Constraint as Constraint,
    ConstraintKind as ConstraintKind,
    SpatialTendon as SpatialTendon,
    Tendon as Tendon,
    Waypoint as Waypoint,
    Wrap as Wrap,
)
from anysim.model.parts import (
    FAR as FAR,
    HASHED_IF_GIVEN,
    NEVER_HASHED,
    ORIGIN as ORIGIN,
    Actuation as Actuation,
    Actuator as Actuator,
    Body as Body,
    BodyKind as BodyKind,
    Camera as Camera,
    Channel as Channel,
    ContactSensor as ContactSensor,
    ControlMode as ControlMode,
    Entity as Entity,
    EntityKind as EntityKind,
    Geom as Geom,
    Inertial as Inertial,
    Joint as Joint,
    JointType as JointType,
    Light as Light,
    Mimic as Mimic,
    Physics as Physics,
    Quat as Quat,
    Robot as Robot,
    Scenery as Scenery,
    Site as Site,
    Slot as Slot,
    Solver as Solver,
    Tile as Tile,
)
from anysim.model.shapes import (
    Box as Box,
    Capsule as Capsule,
    Compliance as Compliance,
    Cylinder as Cylinder,
    HeightField as HeightField,
    HeightFieldShape as HeightFieldShape,
    Mesh as Mesh,
    MeshShape as MeshShape,
    Plane as Plane,
    Shape as Shape,
    Sphere as Sphere,
    Surface as Surface,
    Vec3 as Vec3,
)

if TYPE_CHECKING:
    from anysim.model.ground import Ground


@dataclass(frozen=True)
class World:
    """Everything an engine needs to build, and nothing about any engine."""

    name: str = "world"
    physics: Physics = Physics()
    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    geoms: tuple[Geom, ...] = ()
    sites: tuple[Site, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    cameras: tuple[Camera, ...] = ()
    lights: tuple[Light, ...] = ()
    contact_sensors: tuple[ContactSensor, ...] = ()
    entities: tuple[Entity, ...] = ()
    robots: tuple[Robot, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    heightfields: tuple[HeightField, ...] = ()
    excluded_pairs: frozenset[tuple[int, int]] = frozenset()
    """Pairs of bodies (low, high) that never collide; -1 stands for geoms fixed to the world.

    A parent and its child never collide and are not listed.
    """
    textures: tuple[Texture, ...] = ()
    materials: tuple[Material, ...] = ()
    """Those that geoms have, and those that they may be given later."""
    slots: tuple[Slot, ...] = ()
    """Logical objects that may differ between envs. An entity that is in none of them is there in every env."""
    tiles: tuple[Tile, ...] = ()
    """Pieces of tiled ground, row by row; an env's scene stands on one of them. Empty where there is one ground."""
    tendons: tuple[Tendon, ...] = field(default=(), metadata=HASHED_IF_GIVEN)
    constraints: tuple[Constraint, ...] = field(default=(), metadata=HASHED_IF_GIVEN)
    spatial_tendons: tuple[SpatialTendon, ...] = field(default=(), metadata=HASHED_IF_GIVEN)
    scenery: Scenery = field(default=Scenery(), metadata=HASHED_IF_GIVEN)
    notes: tuple[tuple[str, str], ...] = field(default=(), compare=False, metadata=NEVER_HASHED)
    """The name of a thing, and what its source says that is not so here; see `anysim.assets.model.ImportNote`."""
    visual_error: float | None = field(default=None, compare=False, metadata=NEVER_HASHED)
    """How far [m] what is only looked at may be off in what is added later; see `anysim.assets.meshes.light_mesh`."""

    @cached_property
    def hash(self) -> str:
        """A digest that is equal wherever this world is, on any machine. See `anysim.model.hash`."""
        from anysim.model.hash import world_hash

        return world_hash(self)

    @cached_property
    def ground(self) -> "Ground":
        """Heights of the ground, from the neutral geometry."""
        from anysim.model.ground import Ground

        return Ground(self)

    @cached_property
    def body_joint(self) -> tuple[int, ...]:
        """For each body the joint that moves it, or -1."""
        table = [-1] * len(self.bodies)
        for index, joint in enumerate(self.joints):
            table[joint.body] = index
        return tuple(table)

    def carried_by(self, body: int) -> tuple[int, ...]:
        """The bodies that a body carries by joints, itself first."""
        found = [body]
        for number in range(body + 1, len(self.bodies)):  # parents stand before their children
            if self.bodies[number].parent in found:
                found.append(number)
        return tuple(found)

    @cached_property
    def body_entity(self) -> tuple[int, ...]:
        """For each body the entity it belongs to."""
        table = [-1] * len(self.bodies)
        for index, entity in enumerate(self.entities):
            table[entity.body_start : entity.body_stop] = [index] * (entity.body_stop - entity.body_start)
        return tuple(table)

    @cached_property
    def body_geoms(self) -> tuple[tuple[int, ...], ...]:
        """For each body its geoms; those of the world itself are not among them."""
        table: list[list[int]] = [[] for _ in self.bodies]
        for index, geom in enumerate(self.geoms):
            if geom.body >= 0:
                table[geom.body].append(index)
        return tuple(map(tuple, table))

    @cached_property
    def entity_numbers(self) -> Mapping[str, int]:
        """The number of each entity by its name."""
        return {entity.name: number for number, entity in enumerate(self.entities)}

    @cached_property
    def logical_objects(self) -> Mapping[str, Slot]:
        """Every logical object by name, robots too; what is the same in every env is a slot of one entity."""
        from anysim.model.slots import logical_objects

        return logical_objects(self)

    @cached_property
    def categories(self) -> Mapping[str, tuple[Slot, ...]]:
        """The instances of each category of objects, in order."""
        from anysim.model.slots import categories

        return categories(self)

    @cached_property
    def loose(self) -> Array:
        """(B,) bool, read-only: free bodies that carry no links."""
        parents = {body.parent for body in self.bodies}
        single = [body.kind is BodyKind.FREE and i not in parents for i, body in enumerate(self.bodies)]
        loose = np.array(single, dtype=bool)
        loose.setflags(write=False)
        return loose

    @cached_property
    def geom_texture(self) -> tuple[int, ...]:
        """For each geom the index of its texture, or -1."""
        table = {texture.name: i for i, texture in enumerate(self.textures)}
        return tuple(table[geom.texture] if geom.texture else -1 for geom in self.geoms)

    @cached_property
    def geom_material(self) -> tuple[int, ...]:
        """For each geom the index of its material, or -1."""
        table = {material.name: i for i, material in enumerate(self.materials)}
        return tuple(table[geom.material] if geom.material else -1 for geom in self.geoms)

    @cached_property
    def initial_presence(self) -> Array:
        """(E,) bool, read-only: what is there in an env before anything was drawn, the nominal population."""
        present = np.ones(len(self.entities), dtype=bool)
        for slot in self.slots:
            present[list(slot.entities[slot.initially :])] = False
        present.setflags(write=False)
        return present

    @cached_property
    def initial_body_pose(self) -> Array:
        """Poses (B, 7) of all bodies right after a reset, in the world frame."""
        from anysim.model.forward_kinematics import forward_kinematics

        roots = np.array([[*b.position, *b.quaternion] for b in self.bodies]).reshape(-1, 7)
        joints = np.array([j.initial for j in self.joints])
        poses = forward_kinematics(self, roots[None], joints[None])[0]
        poses.setflags(write=False)
        return poses
