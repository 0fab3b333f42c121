"""Triangles as they are, of what is fixed."""

from collections.abc import Collection
from dataclasses import replace

from anysim.assets.meshes import WholeMesh
from anysim.assets.model import ImportedModel
from anysim.errors import AssetError, listing
from anysim.model.world import Mesh, MeshShape
from anysim_colliders.replacing import Collider, Substitute, replaced
from anysim_schemas.collision_shapes import CollisionShapesSpec


def as_triangles(model: ImportedModel, spec: CollisionShapesSpec, kept: Collection[str]) -> ImportedModel:
    """The model whose meshes collide triangle by triangle; for the root, which the caller has fixed.

    Raises:
        AssetError: a mesh is on a link that moves.
    """
    moving = [
        link
        for geom, link in zip(model.geoms, model.geom_links, strict=True)
        if geom.collides and geom.body > 0 and link not in kept and getattr(geom.shape, "mesh", "") in model.wholes
    ]
    if moving:
        raise AssetError(
            f"'{model.name}': `collision: {spec.method}` is for what is fixed, and its links "
            f"{listing(dict.fromkeys(moving), 6)} move; say `decompose`"
        )
    return replaced(model, kept, _triangles)


def _triangles(hull: Mesh, whole: WholeMesh) -> Substitute:
    mesh = replace(whole.mesh(), name=f"{hull.name}_triangles")
    shape = MeshShape(mesh.name, concave=True, bounded=True)
    return Substitute((Collider(shape, mesh=mesh),), f"its {len(mesh.faces)} triangles")
