"""Compilation of a World's geoms into the tables of the kernels."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.model.world import Box, Capsule, Cylinder, Geom, HeightFieldShape, MeshShape, Plane, Shape, Sphere, World
from anysim_sensors.tables import BOX, CAPSULE, CYLINDER, PLANE, SPHERE, TRIANGLES, Geoms, Triangles
from anysim_sensors.trees import field_triangles, mesh_tree

PARTS = {"box": (0, 6), "link": (0, 2), "corner": (0, 9), "neighbour": (0, 3), "vertex": (0, 3), "normal": (0, 3)}
"""Shapes of the arrays of a tree where there is none."""


def geom_tables(world: World, shapes: str) -> tuple[Geoms, Triangles]:
    """The geoms of a World that collide (`collision`) or that are seen (`visual`), with the trees of their triangles.

    A mesh is its triangles: those that collide are convex hulls already, or ground.
    """
    if shapes not in ("collision", "visual"):
        raise AnysimError(f"a scene is made of 'collision' or 'visual' shapes, got '{shapes}'")
    chosen = [i for i, g in enumerate(world.geoms) if (g.collides if shapes == "collision" else g.visible)]
    geoms = [world.geoms[i] for i in chosen]
    trees: dict[str, int] = {}
    made: list[Mapping[str, Array]] = []
    for geom in geoms:
        name = _triangles_of(geom.shape)
        if name and name not in trees:
            trees[name] = len(made)
            made.append(_tree(world, geom.shape))
    triangles = _joined(made)
    mesh = np.array([trees.get(_triangles_of(g.shape), -1) for g in geoms], dtype=np.int32)
    boxes = np.concatenate([triangles.box[triangles.root], np.zeros((1, 6))])[mesh]
    entity = np.append(np.array(world.body_entity, dtype=np.int32), -1)
    body = np.array([g.body for g in geoms], dtype=np.int32)
    sizes = [_kind_and_size(g.shape) for g in geoms]
    return Geoms(
        np.array([kind for kind, _ in sizes], dtype=np.int32),
        np.array([size for _, size in sizes], dtype=float).reshape(-1, 3),
        np.array([_frame(g) for g in geoms], dtype=float).reshape(-1, 12),
        body,
        entity[body],
        mesh,
        np.array([is_ground(g.shape) and not isinstance(g.shape, Plane) for g in geoms], dtype=bool),
        np.ascontiguousarray(boxes[:, :3]),
        np.ascontiguousarray(boxes[:, 3:]),
        np.array(chosen, dtype=np.int32),
    ), triangles


def _triangles_of(shape: Shape) -> str:
    """A name for the triangles of a mesh or a height field; empty for other shapes."""
    match shape:
        case MeshShape(name):
            return f"mesh {name}"
        case HeightFieldShape(name):
            return f"field {name}"
        case _:
            return ""


def _tree(world: World, shape: Shape) -> Mapping[str, Array]:
    match shape:
        case MeshShape(name):
            mesh = next(m for m in world.meshes if m.name == name)
            return mesh_tree(mesh.vertices, mesh.faces)
        case HeightFieldShape(name):
            return mesh_tree(*field_triangles(next(f for f in world.heightfields if f.name == name)))
        case _:
            raise TypeError(f"a {type(shape).__name__} has no triangles")


def _joined(trees: list[Mapping[str, Array]]) -> Triangles:
    """All trees in one table, their indices counted on."""
    root: list[int] = []
    columns: dict[str, list[Array]] = {name: [np.zeros(shape)] for name, shape in PARTS.items()}
    nodes = triangles = vertices = 0
    for tree in trees:
        root.append(nodes)
        link, neighbour = tree["link"].copy(), tree["neighbour"]
        leaf = link[:, 0] > 0
        link[:, 1] += np.where(leaf, triangles, nodes)
        counted = {
            "link": link,
            "neighbour": np.where(neighbour < 0, -1, neighbour + triangles),
            "vertex": tree["vertex"] + vertices,
        }
        for name in PARTS:
            columns[name].append(counted.get(name, tree[name]))
        nodes, triangles = nodes + len(link), triangles + len(neighbour)
        vertices += len(tree["normal"])
    whole = {name: np.concatenate(parts) for name, parts in columns.items()}
    for name in ("link", "neighbour", "vertex"):
        whole[name] = whole[name].astype(np.int32)
    return Triangles(np.array(root, dtype=np.int32), **whole)


def _kind_and_size(shape: Shape) -> tuple[int, tuple[float, float, float]]:
    match shape:
        case Plane():
            return PLANE, (0.0, 0.0, 0.0)
        case Box(half):
            return BOX, half
        case Sphere(radius):
            return SPHERE, (radius, 0.0, 0.0)
        case Capsule(radius, half_length):
            return CAPSULE, (radius, half_length, 0.0)
        case Cylinder(radius, half_length):
            return CYLINDER, (radius, half_length, 0.0)
        case MeshShape() | HeightFieldShape():
            return TRIANGLES, (0.0, 0.0, 0.0)


def _frame(geom: Geom) -> Array:
    """(12,) the rotation matrix by rows and the position."""
    turn = P.to_matrix(np.array(geom.quaternion, dtype=float))
    return np.concatenate([turn.ravel(), np.array(geom.position, dtype=float)])
