"""The visual and collision geometry of URDF links."""

from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.world.assets import resolve_reference
from anysim.world.imported import ImportNote
from anysim.world.meshes import collision_mesh, visual_parts
from anysim.world.model import Box, Cylinder, Geom, Mesh, MeshShape, Shape, Sphere, Vec3
from anysim.world.rounding import split
from anysim.world.urdf_xml import UrdfFile

_GREY = (0.7, 0.7, 0.7, 1.0)
Color = tuple[float, float, float, float]


class GeometryReader:
    """Collects geoms and meshes, link by link.

    Geoms are named `<link>.collision0`, `<link>.visual0`, and `<link>.visual0_1` where a file has several colours.
    """

    def __init__(self, file: UrdfFile, root: Path, scale: float, notes: list[ImportNote]) -> None:
        self._file, self._root, self._scale, self._notes = file, root, scale, notes
        self._materials: dict[str, Any] = {m.name: m for m in file.robot.materials}
        for link in file.robot.links:  # a material may also be declared where it is first used
            for visual in link.visuals:
                if visual.material is not None and visual.material.color is not None:
                    self._materials.setdefault(visual.material.name, visual.material)
        self.geoms: list[Geom] = []
        self.geom_links: list[str] = []
        self.meshes: dict[str, Mesh] = {}

    def read(self, link: Any, body: int, pose: Array) -> None:
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

    def _visual(self, link: str, name: str, visual: Any, body: int, pose: Array) -> None:
        position, quaternion = self._pose(visual, pose)
        color = self._color(visual.material)
        if visual.geometry.mesh is None:
            shape = self._primitive(link, visual.geometry)
            self._add(link, Geom(name, body, shape, position, quaternion, color or _GREY, collides=False))
            return
        path = self._path(link, visual.geometry.mesh)
        try:
            parts = visual_parts(path, self._mesh_scale(link, visual.geometry.mesh))
        except AssetError as error:  # the file is there; what cannot be read of it is only not seen
            self._note("dropped", link, f"is not fully shown: {error}")
            return
        for i, part in enumerate(parts):
            shape = MeshShape(self._keep(part.mesh))
            own = name if i == 0 else f"{name}_{i}"
            self._add(link, Geom(own, body, shape, position, quaternion, color or part.color or _GREY, collides=False))

    def _collision(self, link: str, name: str, collision: Any, body: int, pose: Array, *, visible: bool) -> None:
        position, quaternion = self._pose(collision, pose)
        if collision.geometry.mesh is None:
            shape = self._primitive(link, collision.geometry)
        else:
            path = self._path(link, collision.geometry.mesh)
            try:
                mesh = collision_mesh(path, self._mesh_scale(link, collision.geometry.mesh))
            except AssetError as error:
                raise AssetError(f"{self._file.where('link', link)}: {error}") from error
            shape = MeshShape(self._keep(mesh))
        self._add(link, Geom(name, body, shape, position, quaternion, _GREY, visible=visible))

    def _pose(self, element: Any, pose: Array) -> tuple[Vec3, Color]:
        if element.origin is not None:
            local = np.array([*(element.origin[:3, 3] * self._scale), *P.from_matrix(element.origin[:3, :3])])
            pose = P.compose(pose, local)
        return split(pose)

    def _primitive(self, link: str, geometry: Any) -> Shape:
        s = self._scale
        if geometry.box is not None:
            sizes = [float(v) * s for v in geometry.box.size]
            shape: Shape = Box((sizes[0] / 2, sizes[1] / 2, sizes[2] / 2)) if len(sizes) == 3 else Box((0.0, 0.0, 0.0))
        elif geometry.sphere is not None:
            sizes = [float(geometry.sphere.radius) * s]
            shape = Sphere(sizes[0])
        else:
            sizes = [float(geometry.cylinder.radius) * s, float(geometry.cylinder.length) * s]
            shape = Cylinder(sizes[0], sizes[1] / 2)
        if (isinstance(shape, Box) and len(sizes) != 3) or not all(0 < size < inf for size in sizes):
            raise AssetError(f"{self._file.where('link', link)} has a {type(shape).__name__.lower()} of size {sizes}")
        return shape

    def _path(self, link: str, mesh: Any) -> Path:
        who = self._file.where("link", link)
        return resolve_reference(mesh.filename, file=self._file.path, root=self._root, asked_by=who)

    def _mesh_scale(self, link: str, mesh: Any) -> Vec3:
        own = np.broadcast_to(np.asarray(1.0 if mesh.scale is None else mesh.scale, dtype=float), (3,)) * self._scale
        if not np.isfinite(own).all() or not own.all():
            raise AssetError(f"{self._file.where('link', link)}: the mesh {mesh.filename} has the scale {own.tolist()}")
        return (float(own[0]), float(own[1]), float(own[2]))

    def _keep(self, mesh: Mesh) -> str:
        """Store a mesh once, under a name that says its content."""
        name = f"{mesh.name}_{mesh.hash[:8]}"
        if name not in self.meshes:
            self.meshes[name] = Mesh(name, mesh.vertices, mesh.faces, mesh.hash)
        return name

    def _color(self, material: Any) -> Color | None:
        if material is None:
            return None
        found = material if material.color is not None else self._materials.get(material.name)
        if found is None or found.color is None:
            return None
        values = [min(1.0, max(0.0, float(v))) for v in found.color.rgba]
        return (values[0], values[1], values[2], values[3] if len(values) > 3 else 1.0) if len(values) > 2 else None

    def _note(self, kind: Any, link: str, message: str) -> None:
        self._notes.append(ImportNote(kind, self._file.where("link", link), message))
