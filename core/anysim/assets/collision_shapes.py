"""Collision geometry of imported meshes, by the makers of the kind `colliders`, and notes on what hulls add."""

from collections.abc import Collection
from typing import Protocol

from anysim import registry
from anysim.assets.model import ImportedModel, ImportNote, noted
from anysim.errors import listing
from anysim.kinematics import inertia
from anysim.model.world import MeshShape
from anysim_schemas.collision_shapes import CollisionShapesSpec

EXCESS = 0.1
"""The share of a closed mesh's volume by which its hull may be larger without a note."""


class ColliderMaker(Protocol):
    """Puts other geometry in place of the hulls of `ImportedModel.wholes`, of all links but those that are kept."""

    def __call__(self, model: ImportedModel, spec: CollisionShapesSpec, kept: Collection[str]) -> ImportedModel: ...


def with_collision(model: ImportedModel, spec: CollisionShapesSpec | None, kept: Collection[str] = ()) -> ImportedModel:
    """A model whose meshes collide as the spec says; `kept` are links whose geometry something else replaces.

    Hulls stay as they are, with a note on those that are `EXCESS` larger than what is in them.

    Raises:
        AssetError: a mesh that cannot be collided with so.
        PluginError: no maker of that kind is installed.
    """
    if spec is None or spec.method == "hull":
        return _told(model, kept)
    maker: ColliderMaker = registry.load("colliders", spec.method)
    with registry.using("colliders", spec.method):
        return maker(model, spec, kept)


def _told(model: ImportedModel, kept: Collection[str]) -> ImportedModel:
    """The model with a note on the hulls that fill much of what is hollow."""
    meshes = {mesh.name: mesh for mesh in model.meshes}
    larger: dict[str, float] = {}
    for geom, link in zip(model.geoms, model.geom_links, strict=True):
        if geom.collides and link not in kept and isinstance(geom.shape, MeshShape) and geom.shape.mesh in model.wholes:
            volume = model.wholes[geom.shape.mesh].volume
            hull = inertia.volume(geom.shape, meshes)
            if hull > (1 + EXCESS) * volume > 0:
                larger[geom.name] = hull / volume - 1
    if not larger:
        return model
    worst = sorted(larger, key=lambda name: (-larger[name], name))
    parts = listing([f"{name} +{larger[name]:.0%}" for name in worst], 6)
    text = (
        f"convex hulls with over {EXCESS:.0%} more volume than their meshes: {parts}; `decompose` makes convex pieces"
    )
    return noted(model, ImportNote("info", "collision", text))
