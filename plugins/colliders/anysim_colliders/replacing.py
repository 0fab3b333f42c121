"""Other collision geometry in place of the hulls of an imported model's meshes."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from anysim.assets.meshes import WholeMesh
from anysim.assets.model import ImportedModel, ImportNote, noted
from anysim.conventions import IDENTITY_QUATERNION
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import ORIGIN, Geom, Mesh, MeshShape, Quat, Shape, Vec3


class Collider(NamedTuple):
    """A shape in the frame of the mesh that it stands for, with its triangles where it is a mesh."""

    shape: Shape
    position: Vec3 = ORIGIN
    quaternion: Quat = IDENTITY_QUATERNION
    mesh: Mesh | None = None


class Substitute(NamedTuple):
    """What stands for a mesh, and in words what it is."""

    colliders: tuple[Collider, ...]
    words: str


def replaced(
    model: ImportedModel, kept: Collection[str], make: Callable[[Mesh, WholeMesh], Substitute]
) -> ImportedModel:
    """The model with what `make` makes of each hull and its whole mesh, and a note on each mesh.

    Args:
        model: whose masses and looks do not change.
        kept: links whose geoms stay as they are.
        make: is asked once for each mesh, however many geoms have it.
    """
    hulls = {mesh.name: mesh for mesh in model.meshes}
    made: dict[str, Substitute] = {}
    geoms: list[Geom] = []
    links: list[str] = []
    taken = {geom.name for geom in model.geoms}
    for geom, link in zip(model.geoms, model.geom_links, strict=True):
        shape = geom.shape
        if link in kept or not geom.collides or not isinstance(shape, MeshShape) or shape.mesh not in model.wholes:
            geoms.append(geom)
            links.append(link)
            continue
        if shape.mesh not in made:
            made[shape.mesh] = make(hulls[shape.mesh], model.wholes[shape.mesh])
        frame = P.pose(geom.position, geom.quaternion)
        for number, one in enumerate(made[shape.mesh].colliders):
            position, quaternion = split(P.compose(frame, P.pose(one.position, one.quaternion)))
            name = geom.name if number == 0 else _free(f"{geom.name}_{number}", taken)
            geoms.append(replace(geom, name=name, shape=one.shape, position=position, quaternion=quaternion))
            links.append(link)
    meshes = hulls | {one.mesh.name: one.mesh for m in made.values() for one in m.colliders if one.mesh is not None}
    used = {geom.shape.mesh for geom in geoms if isinstance(geom.shape, MeshShape)}
    notes = [ImportNote("info", "collision", f"mesh '{name}' collides as {m.words}") for name, m in made.items()]
    changed = replace(
        model,
        geoms=tuple(geoms),
        geom_links=tuple(links),
        meshes=tuple(mesh for name, mesh in meshes.items() if name in used or name not in made),
    )
    return noted(changed, *notes)


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def volume_words(volume: float, hull: Mesh, whole: WholeMesh) -> str:
    """How much more [m^3] there is than in the mesh, beside what its hull would add."""
    if not np.isfinite(whole.volume) or whole.volume <= 0:
        return "its triangles are not closed, so what they enclose is not known"
    around = inertia.volume(MeshShape(hull.name), {hull.name: hull})
    own, hulls = (round(size / whole.volume - 1, 3) + 0.0 for size in (volume, around))
    return f"volume {own:+.1%}, its hull {hulls:+.1%}"
