"""foxglove.SceneUpdate: the visible shapes of a World, each on its body, in the colours of the episode."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Geom, HeightFieldShape, MeshShape, Plane, Sphere, World
from anysim_export.rerun.shapes import field_mesh
from anysim_mcap.foxglove.parts import color, pose, stamp, vector


def scene_update(engine: SimEngine) -> Any:
    """What there is in the first env: an entity of each body with visible shapes; textures are left out."""
    from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    world, entities = engine.world, dict[str, Any]()
    colors, present = engine.get_parameters("geom.color")[0], engine.presence[0]
    for geom, rgba in zip(world.geoms, colors, strict=True):
        if not geom.visible or (geom.body >= 0 and not present[world.body_entity[geom.body]]):
            continue
        name = world.bodies[geom.body].name if geom.body >= 0 else "world"
        if name not in entities:
            entities[name] = SceneEntity(timestamp=stamp(0), frame_id=name, id=name, frame_locked=True)
        _draw(entities[name], world, geom, rgba)
    return SceneUpdate(entities=entities.values())


def _draw(entity: Any, world: World, geom: Geom, rgba: Array) -> None:
    """Add a shape to the primitives of an entity."""
    at = np.array([*geom.position, *geom.quaternion])
    placed: dict[str, Any] = {"pose": pose(at), "color": color(rgba)}
    match geom.shape:
        case Box(half):
            entity.cubes.add(size=vector(2 * np.array(half)), **placed)
        case Sphere(radius):
            entity.spheres.add(size=vector([2 * radius] * 3), **placed)
        case Cylinder(radius, half):
            _add_cylinder(entity, radius, half, placed)
        case Capsule(radius, half):
            _add_cylinder(entity, radius, half, placed)
            for end in (-half, half):
                middle = P.compose(at, np.array([0.0, 0.0, end, 0.0, 0.0, 0.0, 1.0]))
                entity.spheres.add(size=vector([2 * radius] * 3), pose=pose(middle), color=placed["color"])
        case Plane(size):
            corners = [[-size, -size, 0.0], [size, -size, 0.0], [size, size, 0.0], [-size, size, 0.0]]
            _add_mesh(entity, np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), placed)
        case MeshShape(name):
            mesh = next(one for one in world.meshes if one.name == name)
            _add_mesh(entity, mesh.vertices, mesh.faces, placed)
        case HeightFieldShape(name):
            _add_mesh(entity, *field_mesh(next(one for one in world.heightfields if one.name == name)), placed)


def _add_cylinder(entity: Any, radius: float, half: float, placed: dict[str, Any]) -> None:
    entity.cylinders.add(size=vector([2 * radius, 2 * radius, 2 * half]), bottom_scale=1.0, top_scale=1.0, **placed)


def _add_mesh(entity: Any, vertices: Array, faces: Array, placed: dict[str, Any]) -> None:
    from foxglove_schemas_protobuf.Point3_pb2 import Point3

    points = [Point3(x=x, y=y, z=z) for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    entity.triangles.add(points=points, indices=np.asarray(faces).ravel().tolist(), **placed)
