"""The visual and collision geometry of URDF links."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from anysim.assets.bounded_files import check
from anysim.assets.meshes import WholeMesh, collision_mesh, visual_parts, whole_of
from anysim.assets.model import ImportNote
from anysim.assets.uri import Folders, MissingReferenceError, resolve_reference
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import Box, Capsule, Cylinder, Geom, Mesh, MeshShape, Quat, Shape, Sphere, Vec3
from anysim_schemas.limits import ASSET_BYTES
from anysim_urdf import xml as urdf_xml
from anysim_urdf.xml import LinkElement, ModelElements

_GREY = (0.7, 0.7, 0.7, 1.0)


class GeometryReader:
    """Collects geoms and meshes, link by link.

    Geoms are named `<link>.collision0`, `<link>.visual0`, and `<link>.visual0_1` where a file has several colours.
    """

    def __init__(
        self,
        file: ModelElements,
        root: Path,
        scale: float,
        packages: Mapping[str, Path],
        visual_error: float,
        notes: list[ImportNote],
    ) -> None:
        self._file, self._root, self._scale, self._packages, self._notes = file, root, scale, packages, notes
        self._visual_error = visual_error
        self.geoms: list[Geom] = []
        self.geom_links: list[str] = []
        self.meshes: dict[str, Mesh] = {}
        self.wholes: dict[str, WholeMesh] = {}
        self._read: dict[tuple[Path, Vec3], int] = {}
        self._folders: Folders = {}

    def read(self, link: LinkElement, body: int, pose: Array) -> None:
        """Add the geometry of a link whose frame has this pose (7,) in the body."""
        before = len(self.geoms)
        for i, visual in enumerate(link.visuals):
            self._visual(link.name, f"{link.name}.visual{i}", visual, body, pose)
        seen = len(self.geoms) > before
        for i, collision in enumerate(link.collisions):
            self._collision(link.name, f"{link.name}.collision{i}", collision, body, pose, visible=not seen)
        if link.visuals and not link.collisions:
            self._note("info", link.name, "has no collision geometry and touches nothing")

    def _add(self, link: str, geom: Geom) -> None:
        self.geoms.append(geom)
        self.geom_links.append(link)

    def _visual(self, link: str, name: str, visual: urdf_xml.Shape, body: int, pose: Array) -> None:
        position, quaternion = self._pose(visual, pose)
        if visual.kind != "mesh":
            shape = self._primitive(visual)
            self._add(link, Geom(name, body, shape, position, quaternion, visual.color or _GREY, collides=False))
            return
        try:
            path = self._path(link, visual)
        except MissingReferenceError as error:
            self._note("dropped", link, f"is not fully shown: {str(error).partition(' refers to ')[2]}")
            return
        try:
            parts = visual_parts(path, self._mesh_scale(visual), error=self._visual_error)
        except AssetError as error:  # the file is there; what cannot be read of it is only not seen
            self._note("dropped", link, f"is not fully shown: {str(error).replace(str(path), path.name)}")
            return
        for i, part in enumerate(parts):
            shape = MeshShape(self._keep(part.mesh))
            own = name if i == 0 else f"{name}_{i}"
            color = visual.color or part.color or _GREY
            self._add(link, Geom(own, body, shape, position, quaternion, color, collides=False))

    def _collision(
        self, link: str, name: str, collision: urdf_xml.Shape, body: int, pose: Array, *, visible: bool
    ) -> None:
        position, quaternion = self._pose(collision, pose)
        if collision.kind != "mesh":
            shape = self._primitive(collision)
        else:
            path = self._path(link, collision)
            try:
                size = self._mesh_scale(collision)
                shape = MeshShape(self._keep(collision_mesh(path, size)))
                self.wholes[shape.mesh] = whole_of(path, size)
            except AssetError as error:
                raise AssetError(f"{self._file.where('link', link)}: {error}") from error
        self._add(link, Geom(name, body, shape, position, quaternion, _GREY, visible=visible))

    def _pose(self, shape: urdf_xml.Shape, pose: Array) -> tuple[Vec3, Quat]:
        return split(P.compose(pose, np.concatenate([shape.origin[:3] * self._scale, shape.origin[3:]])))

    def _primitive(self, shape: urdf_xml.Shape) -> Shape:
        size = [value * self._scale for value in shape.size]
        if shape.kind == "box":
            return Box((size[0] / 2, size[1] / 2, size[2] / 2))
        if shape.kind == "capsule":  # its length is that of the cylinder between the caps
            return Capsule(size[0], size[1] / 2)
        return Sphere(size[0]) if shape.kind == "sphere" else Cylinder(size[0], size[1] / 2)

    def _path(self, link: str, mesh: urdf_xml.Shape) -> Path:
        who = self._file.where("link", link)
        path = resolve_reference(
            mesh.filename,
            file=self._file.path,
            root=self._root,
            asked_by=who,
            packages=self._packages,
            found=self._folders,
        )
        self._read[path, self._mesh_scale(mesh)] = path.stat().st_size
        check(self._file.path, ASSET_BYTES, sum(self._read.values()))
        return path

    def _mesh_scale(self, mesh: urdf_xml.Shape) -> Vec3:
        return (mesh.size[0] * self._scale, mesh.size[1] * self._scale, mesh.size[2] * self._scale)

    def _keep(self, mesh: Mesh) -> str:
        """Store a mesh once, under a name that says its content."""
        name = f"{mesh.name}_{mesh.hash[:8]}"
        if name not in self.meshes:
            self.meshes[name] = Mesh(name, mesh.vertices, mesh.faces, mesh.hash)
        return name

    def _note(self, kind: Literal["repaired", "dropped", "info"], link: str, message: str) -> None:
        self._notes.append(ImportNote(kind, self._file.where("link", link), message))
