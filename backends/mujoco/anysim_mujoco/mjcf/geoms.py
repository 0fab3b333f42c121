"""The geoms of a compiled MJCF model as neutral geometry."""

from dataclasses import replace
from typing import Any, Literal

import mujoco
import numpy as np

from anysim import cache
from anysim.assets.meshes import WholeMesh, hull_of, light_mesh, whole_read
from anysim.assets.model import ImportNote
from anysim.conventions import WORLD, Array, xyzw_from_wxyz
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import (
    Box,
    Capsule,
    Cylinder,
    Geom,
    HeightField,
    HeightFieldShape,
    Mesh,
    MeshShape,
    Plane,
    Shape,
    Sphere,
    Surface,
)
from anysim_mujoco.mjcf.compliance import contact_compliance, softness

_UNSET = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


def pose_of(position: Array, quaternion: Array, scale: float) -> Array:
    """A pose (7,) from MuJoCo's position and wxyz quaternion, lengths scaled."""
    return np.concatenate([np.asarray(position) * scale, xyzw_from_wxyz(np.asarray(quaternion))])


class GeomReader:
    """Collects geoms, meshes and height fields, link by link.

    Geoms keep their names; unnamed ones are `<link>.collision0` or `<link>.visual0`. A geom that collides is drawn only
    where its link has none that is there to be looked at; a mesh that does both is drawn as it is, beside its hull.
    """

    def __init__(self, model: Any, source: str, scale: float, visual_error: float, notes: list[ImportNote]) -> None:
        self._visual_error = visual_error
        self._model, self._source, self._scale, self._notes = model, source, scale, notes
        self._taken = {model.geom(i).name for i in range(model.ngeom)}
        self.geoms: list[Geom] = []
        self.geom_links: list[str] = []
        self.meshes: dict[str, Mesh] = {}
        self.wholes: dict[str, WholeMesh] = {}
        self.heightfields: dict[str, HeightField] = {}
        self.numbers: list[int] = []
        """The MuJoCo geom of each neutral one."""

    def read(self, link: str, number: int, body: int, pose: Array) -> None:
        """Add the geoms of MuJoCo body `number`, which has this pose (7,) in the neutral body (-1: the world)."""
        model = self._model
        own = range(model.body_geomadr[number], model.body_geomadr[number] + model.body_geomnum[number])
        collides = {g: bool(model.geom_contype[g] or model.geom_conaffinity[g]) for g in own}
        shown = any(not collides[g] for g in own)
        for count, g in enumerate(own):
            where = f"geom '{model.geom(g).name or count}' of body '{link}'"
            ground = body == WORLD and model.geom_type[g] == mujoco.mjtGeom.mjGEOM_PLANE
            shape = Plane() if ground else self._shape(g, collides[g], where)
            if shape is None:
                continue
            frame = P.compose(pose, pose_of(model.geom_pos[g], model.geom_quat[g], self._scale))
            position, quaternion = split(frame)
            name = model.geom(g).name or self._name(link, "collision" if collides[g] else "visual")
            hull = collides[g] and model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH
            geom = Geom(
                name,
                body,
                shape,
                position,
                quaternion,
                self._color(g),
                self._surface(g),
                collides[g],
                visible=not (collides[g] and shown) and not hull,
            )
            self._add(geom, link, g)
            if hull and not shown:
                seen = self._mesh(int(model.geom_dataid[g]), collides=False)
                name = self._name(link, "visual")
                self._add(replace(geom, name=name, shape=seen, collides=False, visible=True), link, g)

    def _add(self, geom: Geom, link: str, number: int) -> None:
        self.geoms.append(geom)
        self.geom_links.append(link)
        self.numbers.append(number)

    def _name(self, link: str, kind: str) -> str:
        count = 0
        while (name := f"{link}.{kind}{count}") in self._taken:
            count += 1
        self._taken.add(name)
        return name

    def _shape(self, g: int, collides: bool, where: str) -> Shape | None:
        kinds, model = mujoco.mjtGeom, self._model
        a, b, c = (float(s) * self._scale for s in model.geom_size[g])
        match model.geom_type[g]:
            case kinds.mjGEOM_SPHERE:
                return Sphere(a)
            case kinds.mjGEOM_CAPSULE:
                return Capsule(a, b)
            case kinds.mjGEOM_CYLINDER:
                return Cylinder(a, b)
            case kinds.mjGEOM_BOX:
                return Box((a, b, c))
            case kinds.mjGEOM_ELLIPSOID:
                self._note("repaired", where, "is an ellipsoid, which becomes a convex mesh")
                name = f"{where.split(chr(39))[1]}_ellipsoid"
                return self._keep(hull_of(name, _sphere() * [a, b, c], cache.digest("ellipsoid", repr((a, b, c)))))
            case kinds.mjGEOM_MESH | kinds.mjGEOM_SDF:
                return self._mesh(int(model.geom_dataid[g]), collides)
            case kinds.mjGEOM_HFIELD:
                return self._heightfield(int(model.geom_dataid[g]))
            case _:
                self._note("dropped", where, "is a plane on a body")
                return None

    def _mesh(self, number: int, collides: bool) -> MeshShape:
        model = self._model
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        vertices = np.asarray(model.mesh_vert[first : first + count], dtype=float) * self._scale
        first, count = model.mesh_faceadr[number], model.mesh_facenum[number]
        faces = np.asarray(model.mesh_face[first : first + count], dtype=np.int32)
        name = model.mesh(number).name
        source = cache.digest(self._source, name, repr(self._scale), mujoco.__version__)
        if collides:
            shape = self._keep(hull_of(name, vertices, source))
            self.wholes[shape.mesh] = whole_read(name, vertices, faces, source)
            return shape
        return self._keep(light_mesh(name, vertices, faces, source, error=self._visual_error))

    def _keep(self, mesh: Mesh) -> MeshShape:
        name = f"{mesh.name}_{mesh.hash[:8]}"
        self.meshes.setdefault(name, Mesh(name, mesh.vertices, mesh.faces, mesh.hash))
        return MeshShape(name)

    def _heightfield(self, number: int) -> HeightFieldShape:
        model = self._model
        rows, cols = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
        first = model.hfield_adr[number]
        x, y, top, _ = (float(s) * self._scale for s in model.hfield_size[number])
        heights = np.asarray(model.hfield_data[first : first + rows * cols], dtype=float).reshape(rows, cols) * top
        name = model.hfield(number).name
        self.heightfields[name] = HeightField(name, heights, (2 * x, 2 * y))
        return HeightFieldShape(name)

    def _color(self, g: int) -> tuple[float, float, float, float]:
        model = self._model
        rgba, material = model.geom_rgba[g], int(model.geom_matid[g])
        if material >= 0 and np.array_equal(rgba, _UNSET):
            rgba = model.mat_rgba[material]
        r, g_, b, alpha = (round(float(v), 6) for v in rgba)
        return (r, g_, b, alpha)

    def _surface(self, g: int) -> Surface:
        model = self._model
        sliding, torsional, rolling = (float(v) for v in model.geom_friction[g])
        return Surface(
            friction=sliding,
            torsional_friction=torsional,
            rolling_friction=rolling,
            softness=softness(model.geom_solref[g]),
            impedance=(float(model.geom_solimp[g, 0]), float(model.geom_solimp[g, 1])),
            priority=int(model.geom_priority[g]),
            torsional=int(model.geom_condim[g]) >= 4,
            compliance=contact_compliance(model, g, self._scale),
        )

    def _note(self, kind: Literal["repaired", "dropped", "info"], where: str, message: str) -> None:
        self._notes.append(ImportNote(kind, where, message))


def _sphere() -> Array:
    """Points on the unit sphere: 6 rings of 9 and the poles, within the vertex budget of a hull."""
    polar = np.arange(1, 7) * np.pi / 7
    turn = np.arange(9) * 2 * np.pi / 9
    rings = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(9)),
        ],
        axis=-1,
    )
    return np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
