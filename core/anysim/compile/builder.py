"""The builder of a World from imported models: local names get the entity's name in front, indices become global."""

from collections.abc import Iterable
from dataclasses import replace
from math import copysign, inf
from typing import Any

from anysim.assets.meshes import VISUAL_ERROR
from anysim.assets.model import ImportedModel, ImportNote
from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.errors import AssetError
from anysim.model.world import (
    FAR,
    ORIGIN,
    Body,
    BodyKind,
    Entity,
    EntityKind,
    Geom,
    HeightField,
    HeightFieldShape,
    Joint,
    Mesh,
    MeshShape,
    Quat,
    Vec3,
    World,
)


class WorldBuilder:
    """A World under construction. Starts from an existing one, which is not changed."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.visual_error = VISUAL_ERROR if world.visual_error is None else world.visual_error
        self.bodies: list[Body] = list(world.bodies)
        self.joints: list[Joint] = list(world.joints)
        self.geoms: list[Geom] = list(world.geoms)
        self.sites = list(world.sites)
        self.actuators = list(world.actuators)
        self.entities = list(world.entities)
        self.robots = list(world.robots)
        self._meshes = {mesh.name: mesh for mesh in world.meshes}
        self._heightfields = {field.name: field for field in world.heightfields}
        self._textures = {texture.name: texture for texture in world.textures}
        self._materials = {material.name: material for material in world.materials}
        self.excluded = set(world.excluded_pairs)
        self.tiles, self.tendons, self.constraints = world.tiles, list(world.tendons), list(world.constraints)
        self.spatial_tendons = list(world.spatial_tendons)
        self._notes = dict.fromkeys(world.notes)

    def build(self) -> World:
        """The World as it is now."""
        return replace(
            self._world,
            bodies=tuple(self.bodies),
            joints=tuple(self.joints),
            geoms=tuple(self.geoms),
            sites=tuple(self.sites),
            actuators=tuple(self.actuators),
            entities=tuple(self.entities),
            robots=tuple(self.robots),
            meshes=tuple(self._meshes.values()),
            heightfields=tuple(self._heightfields.values()),
            textures=tuple(self._textures.values()),
            materials=tuple(self._materials.values()),
            excluded_pairs=frozenset(self.excluded),
            tiles=self.tiles,
            tendons=tuple(self.tendons),
            constraints=tuple(self.constraints),
            spatial_tendons=tuple(self.spatial_tendons),
            notes=tuple(self._notes),
        )

    def add(
        self,
        name: str,
        kind: EntityKind,
        model: ImportedModel,
        *,
        root: BodyKind,
        position: Vec3 = ORIGIN,
        quaternion: Quat = IDENTITY_QUATERNION,
        label: str = "",
        source: str = "",
        license: str = "",
        category: str = "",
        instance: int = 0,
        family: str = "",
    ) -> Entity:
        """Add a model as an entity, its root floating or static at the given pose. Returns the entity."""
        body, joint = len(self.bodies), len(self.joints)
        shift = lambda index: index if index == WORLD else index + body  # noqa: E731
        full = lambda local: f"{name}.{local}" if local else name  # noqa: E731
        own = {mesh.name: self.add_mesh(mesh) for mesh in model.meshes}
        self._add_looks(model)
        for number, part in enumerate(model.bodies):
            moved = replace(part, name=full(part.name), parent=shift(part.parent))
            if number == 0:
                moved = replace(moved, kind=root, parent=WORLD, position=position, quaternion=quaternion)
            self.bodies.append(moved)
        for part in model.joints:
            mimic = None if part.mimic is None else part.mimic._replace(joint=part.mimic.joint + joint)
            ends = [x if abs(x) < FAR else copysign(inf, x) for x in (part.lower, part.upper)]
            part = replace(part, name=full(part.name), body=part.body + body, mimic=mimic)
            self.joints.append(replace(part, lower=ends[0], upper=ends[1]))
        self.tendons += [part.renumbered(lambda j: j + joint, f"{name}.") for part in model.tendons]
        self.constraints += [part.renumbered(shift, f"{name}.") for part in model.constraints]
        self.spatial_tendons += [part.renumbered(shift, f"{name}.") for part in model.spatial_tendons]
        for part in model.geoms:
            shape: Any = part.shape
            if isinstance(shape, MeshShape):
                shape = replace(shape, mesh=own[shape.mesh])
            elif isinstance(shape, HeightFieldShape):
                shape = HeightFieldShape(full(shape.heightfield))
            self.geoms.append(replace(part, name=full(part.name), body=shift(part.body), shape=shape))
        self.note(category or name, model.report)
        self.sites += [replace(part, name=full(part.name), body=shift(part.body)) for part in model.sites]
        self.add_heightfields(replace(field, name=full(field.name)) for field in model.heightfields)
        self.excluded |= {(low + body, high + body) for low, high in model.excluded_pairs}
        entity = Entity(
            name,
            kind,
            body,
            len(self.bodies),
            joint,
            len(self.joints),
            label=label or name,
            source=source,
            license=license,
            category=category or name,
            instance=instance,
            family=family or ("articulation" if model.joints else "rigid"),
            affordances=model.affordances,
        )
        self.entities.append(entity)
        return entity

    def note(self, name: str, report: Iterable[ImportNote]) -> None:
        """Keep what an importer says of the thing that is called so."""
        self._notes |= dict.fromkeys((name, str(note)) for note in report)

    def add_mesh(self, mesh: Mesh) -> str:
        """Store a mesh once, however many use it; returns its name in the World, which says its content."""
        tag = f"_{mesh.hash[:8]}"
        name = mesh.name if mesh.name.endswith(tag) else mesh.name + tag
        self._meshes.setdefault(name, replace(mesh, name=name))
        return name

    def _add_looks(self, model: ImportedModel) -> None:
        """Store textures and materials once, however many use them.

        Raises:
            AssetError: two different images have one name.
        """
        for texture in model.textures:
            known = self._textures.setdefault(texture.name, texture)
            if known.hash != texture.hash:
                raise AssetError(
                    f"two different images are called '{texture.name}', in the folders of two files; rename one of them"
                )
        self._materials |= {material.name: material for material in model.materials}

    def add_heightfields(self, fields: Iterable[HeightField]) -> None:
        """Store height fields under their own names."""
        self._heightfields |= {field.name: field for field in fields}
