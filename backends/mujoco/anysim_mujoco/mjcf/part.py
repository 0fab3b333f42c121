"""Bodies of an MJCF file, alone: one that is an asset, or one as a part of the scene that the file is.

A part is named `/BODY`, `/3` where the third body of the world has no name, and `/` is all that is fixed to the world.
What a scene says once and for all of it (options, lights, cameras) is no matter of its parts.
"""

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from anysim.assets.model import ImportedModel, ImportNote
from anysim.conventions import Array
from anysim.errors import AssetError, listing, suggest
from anysim_mujoco.mjcf import unheld

PLANE, THICK = 20.0, 0.5
"""[m] Half the edge of a box in the place of a plane without a size, and half its thickness."""
_COPIED = "name rgba friction contype conaffinity condim priority solref solimp material group".split()


def bodies_of(spec: Any) -> dict[str, Any]:
    """The bodies of a file's world by their names as parts."""
    bodies = list(spec.worldbody.bodies)
    taken = {body.name for body in bodies}
    named: dict[str, Any] = {}
    for number, body in enumerate(bodies, 1):
        name = body.name or str(number)
        named[name if body.name or name not in taken else f"{name}_"] = body
    return named


def scene_part(spec: Any, path: Path, name: str) -> list[ImportNote]:
    """Leave one part of a scene in a file; what its elements say in vain.

    Raises:
        AssetError: there is no such body.
    """
    bodies, notes = bodies_of(spec), list[ImportNote]()
    kept = (mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_XBODY)
    loose = [one for one in spec.sensors if one.objtype not in kept]
    for one in (*loose, *spec.pairs):  # which the scene has told of
        spec.delete(one)
    if name:
        if name not in bodies:
            raise AssetError(f"{path}: there is no body '{name}'{suggest(name, list(bodies))} ({listing(bodies, 8)})")
        shaped = [geom for geom in spec.worldbody.geoms if geom.meshname or geom.hfieldname]
        for geom in shaped:  # tendons may refer to them
            geom.type, geom.meshname, geom.hfieldname, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, "", "", [1e-3, 0, 0]
        if not bodies[name].name:
            bodies[name].name = f"body{name}"
        notes += keep(spec, path, bodies[name].name)
        fixed = {site.name for site in spec.worldbody.sites}
        for one in [one for one in spec.sensors if one.objname in fixed and one.objtype == mujoco.mjtObj.mjOBJ_SITE]:
            spec.delete(one)
    else:
        for looking in (*spec.cameras, *spec.lights, *bodies.values()):
            spec.delete(looking)
        notes += _solid_planes(spec)
    used = [(geom.meshname, geom.hfieldname) for geom in spec.geoms]
    for kind, meshes in enumerate((spec.meshes, spec.hfields)):
        for mesh in list(meshes):
            if mesh.name not in {pair[kind] for pair in used}:
                spec.delete(mesh)
    notes += unheld.of_part(spec, world=not name)
    return [note for note in notes if note.where != "geom contype"]  # the scene has excluded pairs


def ground_of(model: Any) -> int:
    """The geom of a compiled file that is the ground of its world: a level plane at height 0 that collides; else -1."""
    for g in range(int(model.body_geomnum[0])):
        level = abs(float(_normal(model.geom_quat[g])[2]) - 1.0) < 1e-9 and float(model.geom_pos[g][2]) == 0.0
        if (
            model.geom_type[g] == mujoco.mjtGeom.mjGEOM_PLANE
            and level
            and model.geom_contype[g] | model.geom_conaffinity[g]
        ):
            return g
    return -1


def _normal(quaternion: Array) -> Array:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)[:, 2]


def _solid_planes(spec: Any) -> list[ImportNote]:
    """Take the ground out, which is the terrain, and put boxes in the place of other planes."""
    notes: list[ImportNote] = []
    model = spec.compile()
    ground = ground_of(model)
    planes = [(geom, geom.id) for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
    for geom, number in planes:
        if number != ground:
            normal, size = _normal(model.geom_quat[number]), model.geom_size[number]
            half = [float(s) if s > 0 else PLANE for s in size[:2]]
            given = {key: value for key in _COPIED if (value := getattr(geom, key)) is not None}
            given = {key: v.copy() if isinstance(v, np.ndarray) else v for key, v in given.items()}
            where = f"geom '{geom.name or number}' of the world"
            text = f"is a plane, which becomes a box of {2 * half[0]:g} m by {2 * half[1]:g} m by {2 * THICK:g} m"
            notes.append(ImportNote("repaired", where, text))
            place = np.asarray(model.geom_pos[number]) - THICK * normal
            turn = np.asarray(model.geom_quat[number]).copy()
            spec.delete(geom)
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[*half, THICK], pos=place, quat=turn, **given)
        else:
            spec.delete(geom)
    return notes


def owner_of(root: str, bodies: Iterable[str]) -> str:
    """What all bodies of a tree are called after: `oven` of `oven.base` and `oven.door`; else the name of the root."""
    first = root.partition(".")[0]
    return first if "." in root and all(name.startswith(f"{first}.") for name in bodies) else root


def unqualified(model: ImportedModel, name: str) -> ImportedModel:
    """A part of a scene whose names begin where that of the part ends: `cup.handle` of the part `cup` is `handle`."""
    root = model.bodies[0].name
    owner = owner_of(root, [body.name for body in model.bodies])
    qualified = re.compile(rf"^{re.escape(owner if owner != root else name or root)}\.(?=.)")
    short = lambda text: "" if text == owner == root else qualified.sub("", text, count=1)  # noqa: E731
    several = {
        key: tuple(replace(part, name=short(part.name)) for part in getattr(model, key))
        for key in ("bodies", "joints", "geoms", "sites")
    }
    if any(len({part.name for part in parts}) < len(parts) for parts in several.values()):
        return model
    links = {short(link): body for link, body in model.links.items()}
    sensors = tuple(hint._replace(frame=short(hint.frame)) for hint in model.sensors)
    return replace(model, **several, links=links, geom_links=tuple(map(short, model.geom_links)), sensors=sensors)


def keep(spec: Any, path: Path, body: str) -> list[ImportNote]:
    """Take all bodies of the world out but one. MuJoCo removes what refers to them, and shortens keyframes."""
    others = [one for one in spec.worldbody.bodies if one.name != body]
    if len(others) == len(spec.worldbody.bodies):
        names = [one.name for one in others if one.name]
        raise AssetError(f"{path}: its world has no body '{body}'{suggest(body, names)} (bodies: {listing(names)})")
    for looking in (*spec.cameras, *spec.lights):  # maybe at a body that goes; the importer leaves them behind anyway
        spec.delete(looking)
    rest = spec.copy()
    rest.delete(rest.body(body))
    whole = _ties(spec)
    for one in others:
        spec.delete(one)
    return [
        ImportNote("dropped", body, f"{kind} between it and other bodies of the file are left out ({count})")
        for kind, count in (whole - _ties(rest) - _ties(spec)).items()
    ]


def _ties(spec: Any) -> Counter[str]:
    """How many elements there are that may tie one body to another."""
    kinds = {"equalities": spec.equalities, "tendons": spec.tendons, "pairs": spec.pairs}
    return Counter({kind: len(elements) for kind, elements in kinds.items()})
