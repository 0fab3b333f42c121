"""Files of a scene, and the report of what they do not hold."""

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from anysim import registry
from anysim.assets.model import ImportNote
from anysim.errors import AnysimError, listing, suggest
from anysim_export_model.mesh_files import MeshFiles
from anysim_export_model.mjcf import mjcf
from anysim_export_model.notes import Notes
from anysim_export_model.scene import Piece, Scene
from anysim_export_model.urdf import srdf, urdf

FORMATS = ("urdf", "mjcf")
"""Those that are written here; writers of others are plugins of the kind `model_writers`."""


class ModelFiles(NamedTuple):
    """The model files that were written, their meshes, and what is not in them."""

    files: tuple[Path, ...]
    meshes: tuple[Path, ...]
    notes: tuple[ImportNote, ...]


def write(scene: Scene, kind: str, folder: Path, *, entities: tuple[str, ...] = ()) -> ModelFiles:
    """Write a scene into a folder: one file, or of URDF one for each tree. Files that are there are replaced.

    An installed writer is a function `(scene, folder, notes)` that gives the files it has written.

    Args:
        scene: what is written.
        kind: one of `FORMATS`, or the name of an installed writer.
        folder: made where it is not there.
        entities: those that are meant; all where empty.

    Raises:
        AnysimError: an unknown format or entity, or something that the format cannot say.
    """
    known = [*FORMATS, *registry.names("model_writers")]
    if kind not in known and ("model_writers", kind) not in registry.INSTALL_HINTS:
        raise AnysimError(f"there is no format '{kind}'{suggest(kind, known)} (formats: {', '.join(known)})")
    writer = None if kind in FORMATS else registry.load("model_writers", kind)
    notes, meshes = Notes(), MeshFiles(folder)
    scene = _chosen(scene, entities, notes)
    folder.mkdir(parents=True, exist_ok=True)
    if writer is not None:
        with registry.using("model_writers", kind):
            return ModelFiles(tuple(writer(scene, folder, notes)), (), notes.told())
    if kind == "mjcf":
        files = [_file(folder, scene.name, ".xml", mjcf(scene, meshes, notes))]
        return ModelFiles(tuple(files), tuple(meshes.written), notes.told())
    files = []
    for piece in scene.pieces:
        files.append(_file(folder, piece.name, ".urdf", urdf(piece, meshes, notes)))
        if (beside := srdf(piece)) is not None:
            files.append(_file(folder, piece.name, ".srdf", beside))
    _beside_trees(scene, notes)
    return ModelFiles(tuple(files), tuple(meshes.written), notes.told())


def _chosen(scene: Scene, entities: tuple[str, ...], notes: Notes) -> Scene:
    """The scene without what is not meant, and without what is not there at first."""
    names = [piece.name for piece in scene.pieces]
    for name in entities:
        if name not in names:
            raise AnysimError(f"there is no entity '{name}'{suggest(name, names)} (entities: {listing(names)})")
    kept: list[Piece] = []
    number: dict[int, int] = {-1: -1}
    for index, piece in enumerate(scene.pieces):
        if entities and piece.name not in entities:
            continue
        if not piece.there:
            notes.lost("entity", "is left out: it is not there at first", piece.name)
            continue
        number[index] = len(kept)
        kept.append(piece)
    if not kept and not (scene.world is not None and scene.fixed_geoms):
        raise AnysimError(f"'{scene.name}' has nothing that could be written")
    apart = tuple(((number[a], i), (number[b], j)) for (a, i), (b, j) in scene.apart if a in number and b in number)
    world = scene.world
    if world is not None and entities:
        names = {
            world.bodies[world.entities[world.entity_numbers[p.name]].root].name
            for p in kept
            if p.name in world.entity_numbers
        }
        cameras = tuple(
            c for c in world.cameras if c.body < 0 or world.entities[world.body_entity[c.body]].name in names
        )
        world = replace(world, cameras=cameras)
    return scene._replace(pieces=tuple(kept), apart=apart, world=world)


def _beside_trees(scene: Scene, notes: Notes) -> None:
    """Say what is in a world beside its trees, of which a URDF file has one."""
    for geom in scene.fixed_geoms:
        notes.lost("geom of the world", "is left out: a URDF is one tree", geom.name)
    for site in scene.fixed_sites:
        notes.lost("frame of the world", "is left out: a URDF is one tree", site.name)
    if scene.world is None:
        return
    for what, parts in (("camera", scene.world.cameras), ("light", scene.world.lights)):
        for part in parts:
            notes.lost(what, "is left out: a URDF has none", part.name)
    for sensor in scene.world.contact_sensors:
        notes.lost("contact sensor", "is left out", sensor.name)
    if scene.apart:
        notes.lost("pairs that never collide", "are left out between trees", scene.name)


def _file(folder: Path, name: str, ending: str, data: bytes) -> Path:
    path = folder / (re.sub(r"[^\w.-]", "_", name).strip(".") + ending)
    path.write_bytes(data)
    return path
