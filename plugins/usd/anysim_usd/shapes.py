"""The shapes of a stage as neutral geometry: solids as they are where they are not stretched, else as meshes."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim import cache
from anysim.assets.bounded_files import check
from anysim.assets.meshes import hull_of, light_mesh, whole_read
from anysim.assets.model import ImportNote, WholeMesh
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.geometry.triangles import triangles, turned
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import Box, Capsule, Cylinder, Geom, Mesh, MeshShape, Shape, Sphere
from anysim_schemas.limits import MESH_FACES
from anysim_usd.library import pxr
from anysim_usd.looks import LookReader, Rgba
from anysim_usd.numbers import get, real
from anysim_usd.space import Placement, Space

KINDS = frozenset(("Cube", "Sphere", "Cylinder", "Cylinder_1", "Capsule", "Capsule_1", "Cone", "Plane", "Mesh"))
_TO_Z = {  # the turn (4,) xyzw from a shape along z to one along an axis
    "X": np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]),
    "Y": np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]),
    "Z": np.array([0.0, 0.0, 0.0, 1.0]),
}
_EVEN = 1e-9
_THICK = 1.0  # [m] of a plane that is no ground
_WIDE = 40.0  # [m] of one that has no end


class Solid(NamedTuple):
    """A shape in a frame (7,) of the world; or triangles in the world, where it has no simple one."""

    shape: Shape | None
    pose: Array
    vertices: Array | None = None
    faces: Array | None = None


class ShapeReader:
    """Collects geoms and meshes of the bodies of a model, in the frames of these."""

    def __init__(
        self, path: Path, space: Space, looks: LookReader, visual_error: float, notes: list[ImportNote]
    ) -> None:
        self._path, self._space, self.looks, self._notes = path, space, looks, notes
        self._error = visual_error
        self.geoms: list[Geom] = []
        self.geom_links: list[str] = []
        self.meshes: dict[str, Mesh] = {}
        self.wholes: dict[str, WholeMesh] = {}
        self.prims: dict[str, list[str]] = {}
        """The geoms of each prim, by its path."""
        self._count: dict[tuple[str, str], int] = {}

    # ------------------------------------------------------------------ geoms

    def read(self, prims: list[Any], link: str, body: int, frame: Array) -> None:
        """Add the shapes of a link: what of its prims is seen or touched, in a body whose frame is (7,)."""
        touching = [prim for prim in prims if collides(prim)]
        before = len(self.geoms)
        for prim in prims:
            seen = _is_seen(prim)
            if not seen and prim not in touching:
                continue
            if prim in touching:
                self._touch(prim, link, body, frame, seen=seen)
            else:
                self._see(prim, link, body, frame)
        added = self.geoms[before:]
        if added and not any(geom.collides for geom in added):
            self._note("info", f"body '{link}'", "has no collision geometry and touches nothing")

    def _name(self, prim: Any, link: str, kind: str) -> str:
        own = get(prim, "anysim:name")
        number = self._count[link, kind] = self._count.get((link, kind), -1) + 1
        return str(own) if own and all(geom.name != own for geom in self.geoms) else f"{link}.{kind}{number}"

    def _add(self, prim: Any, link: str, geom: Geom) -> None:
        self.geoms.append(geom)
        self.geom_links.append(link)
        self.prims.setdefault(str(prim.GetPath()), []).append(geom.name)

    def _touch(self, prim: Any, link: str, body: int, frame: Array, *, seen: bool) -> None:
        solid = self.solid(prim)
        if solid is None:
            return
        solid = self._approximated(prim, solid)
        surface, name = self.looks.surface(prim), self._name(prim, link, "collision")
        hull = solid.shape is None
        if hull:
            shape, pose = self._hulled(prim, solid, frame)
        else:
            shape, pose = solid.shape, P.compose(P.inverse(frame), solid.pose)
        assert shape is not None
        position, quaternion = split(pose)
        visible = seen and not hull
        color = self.looks.color(prim)
        self._add(prim, link, Geom(name, body, shape, position, quaternion, color, surface, True, visible))
        if seen and hull:
            self._see(prim, link, body, frame)

    def _see(self, prim: Any, link: str, body: int, frame: Array) -> None:
        solid = self.solid(prim)
        if solid is None:
            return
        name = self._name(prim, link, "visual")
        if solid.shape is not None:
            position, quaternion = split(P.compose(P.inverse(frame), solid.pose))
            color = self.looks.color(prim)
            self._add(prim, link, Geom(name, body, solid.shape, position, quaternion, color, collides=False))
            return
        local = P.compose(P.inverse(frame), solid.pose)
        vertices = _into(solid.pose, solid.vertices)
        for i, (faces, color) in enumerate(self._colored(prim, np.asarray(solid.faces))):
            used, numbers = np.unique(faces, return_inverse=True)
            part, corners = vertices[used], numbers.reshape(-1, 3)
            source = cache.digest(part.tobytes(), corners.astype(np.int32).tobytes())
            shape = MeshShape(self._keep(light_mesh(prim.GetName(), part, corners, source, error=self._error)))
            position, quaternion = split(local)
            own = name if i == 0 else f"{name}_{i}"
            self._add(prim, link, Geom(own, body, shape, position, quaternion, color, collides=False))

    def _hulled(self, prim: Any, solid: Solid, frame: Array) -> tuple[Shape, Array]:
        vertices = _into(solid.pose, solid.vertices)
        faces, name = np.asarray(solid.faces, dtype=np.int32), prim.GetName()
        source = cache.digest(vertices.tobytes(), faces.tobytes())
        shape = MeshShape(self._keep(hull_of(name, vertices, source)))
        self.wholes[shape.mesh] = whole_read(name, vertices, faces, source)
        return shape, P.compose(P.inverse(frame), solid.pose)

    def _keep(self, mesh: Mesh) -> str:
        name = f"{mesh.name}_{mesh.hash[:8]}"
        self.meshes.setdefault(name, Mesh(name, mesh.vertices, mesh.faces, mesh.hash))
        return name

    def _colored(self, prim: Any, faces: Array) -> list[tuple[Array, Rgba]]:
        """The triangles of a mesh by colour: those of its subsets, and the rest."""
        subsets = [child for child in prim.GetChildren() if str(child.GetTypeName()) == "GeomSubset"]
        if not subsets or str(prim.GetTypeName()) != "Mesh":
            return [(faces, self.looks.color(prim))]
        owner = _face_owner(prim)[_solid_faces(prim)]
        left = np.ones(len(faces), dtype=bool)
        found: list[tuple[Array, Rgba]] = []
        for subset in subsets:
            if self.looks.bound(subset) is None:
                continue
            chosen = np.isin(owner, np.array(get(subset, "indices") or (), dtype=int)) & left
            if chosen.any():
                left &= ~chosen
                found.append((faces[chosen], self.looks.color(subset)))
        return [*found, (faces[left], self.looks.color(prim))] if left.any() else found

    def _approximated(self, prim: Any, solid: Solid) -> Solid:
        """The shape that a mesh collides as, by its MeshCollisionAPI."""
        if str(prim.GetTypeName()) != "Mesh" or solid.vertices is None:
            return solid
        kind = str(get(prim, "physics:approximation") or "none")
        place = self._space.of(prim)
        points = _into(place.pose, solid.vertices)
        low, high = points.min(axis=0), points.max(axis=0)
        middle = np.array([*((low + high) / 2), 0.0, 0.0, 0.0, 1.0])
        if kind == "boundingCube" and (high - low).min() > 0:
            half = (high - low) / 2
            return Solid(Box((float(half[0]), float(half[1]), float(half[2]))), P.compose(place.pose, middle))
        if kind == "boundingSphere":
            radius = float(np.linalg.norm(points - middle[:3], axis=1).max())
            return Solid(Sphere(radius), P.compose(place.pose, middle))
        if kind not in ("convexHull", "none"):
            self._note("info", f"mesh '{prim.GetName()}'", f"collides as {kind} in its file, here as its convex hull")
        elif kind == "none" and not _convex(solid.vertices, np.asarray(solid.faces)):
            self._note(
                "info", f"mesh '{prim.GetName()}'", "collides by each triangle in its file, here as its convex hull"
            )
        return solid

    # ------------------------------------------------------------------ shapes

    def solid(self, prim: Any) -> Solid | None:
        """The shape of a prim; None where it has none, which a note says.

        Raises:
            AssetError: a size that is no number, a mesh whose indices lead nowhere.
        """
        kind = str(prim.GetTypeName()).removesuffix("_1")
        place = self._space.of(prim)
        if kind == "Mesh":
            return self._mesh(prim, place)
        unit = self._space.metres
        size = {key: abs(real(prim, key, 1.0)) * unit for key in ("size", "radius", "height", "width", "length")}
        if kind in ("Cylinder", "Capsule") and str(prim.GetTypeName()).endswith("_1"):
            top, bottom = (real(prim, f"radius{end}", 1.0) * unit for end in ("Top", "Bottom"))
            if top != bottom:
                self._note("info", f"prim '{prim.GetName()}'", "narrows; it is as wide as at its bottom here")
            size["radius"] = bottom
        wanted = {"Cube": ("size",), "Sphere": ("radius",), "Plane": ()}.get(kind, ("radius", "height"))
        if not all(np.isfinite(size[key]) for key in wanted):
            raise AssetError(f"{self._path}: prim '{prim.GetPath()}' has a size that is no number")
        if any(size[key] == 0.0 for key in wanted) and kind != "Capsule":
            self._note("dropped", f"prim '{prim.GetName()}'", "has the size 0, and is left out")
            return None
        turn = _TO_Z.get(str(get(prim, "axis") or "Z"), _TO_Z["Z"]) if kind not in ("Cube", "Sphere") else _TO_Z["Z"]
        if kind == "Plane":
            return self._plane(prim, place, turn, size)
        return _placed(kind, size, place, turn)

    def _plane(self, prim: Any, place: Placement, turn: Array, size: dict[str, float]) -> Solid:
        """A level ground at height 0 as itself, another as a box."""
        pose = P.compose(place.pose, np.array([0.0, 0.0, 0.0, *turn]))
        wide = (_WIDE, _WIDE) if collides(prim) else (min(size["width"], _WIDE), min(size["length"], _WIDE))
        below = np.array([0.0, 0.0, -_THICK / 2, 0.0, 0.0, 0.0, 1.0])
        return Solid(Box((wide[0] / 2, wide[1] / 2, _THICK / 2)), P.compose(pose, below))

    def _mesh(self, prim: Any, place: Placement) -> Solid | None:
        points, faces = mesh_of(prim, self._path)
        check(self._path, MESH_FACES, len(faces))
        if not len(faces):
            self._note("dropped", f"mesh '{prim.GetName()}'", "has no triangles, and is left out")
            return None
        if np.linalg.det(place.linear) < 0:
            faces = faces[:, ::-1]
        return Solid(None, place.pose, place.point(points * self._space.metres), faces)

    def _note(self, kind: Any, where: str, message: str) -> None:
        note = ImportNote(kind, where, message)
        if note not in self._notes:  # a shape that is seen and touched is read twice
            self._notes.append(note)


def collides(prim: Any) -> bool:
    """Whether a prim is touched."""
    if not prim.HasAPI(pxr().UsdPhysics.CollisionAPI) or str(prim.GetTypeName()) not in KINDS:
        return False
    return get(prim, "physics:collisionEnabled") is not False


def _is_seen(prim: Any) -> bool:
    image = pxr().UsdGeom.Imageable(prim)
    hidden = str(image.ComputeVisibility(pxr().Usd.TimeCode.EarliestTime())) == "invisible"
    return not hidden and str(image.ComputePurpose()) in ("default", "render")


def is_level(prim: Any, space: Space) -> bool:
    """Whether a prim is a plane that is level, at height 0, and collides: the ground."""
    if str(prim.GetTypeName()) != "Plane" or not collides(prim):
        return False
    place = space.of(prim)
    turn = _TO_Z.get(str(get(prim, "axis") or "Z"), _TO_Z["Z"])
    normal = P.rotate(P.multiply(place.pose[3:], turn), np.array([0.0, 0.0, 1.0]))
    return abs(float(normal[2]) - 1.0) < 1e-9 and abs(float(place.position[2])) < 1e-9


def _placed(kind: str, size: dict[str, float], place: Placement, turn: Array) -> Solid:
    """A solid of the file where it is: itself where scale leaves it one, else its triangles."""
    axes = np.abs(place.size)
    along = np.round(np.abs(P.rotate(turn, np.array([0.0, 0.0, 1.0]))))
    stretch = float(along @ axes)
    across = axes[along < 0.5]
    even = (
        place.straight and float(np.ptp(across)) <= _EVEN * float(axes.max(initial=0.0))
        if kind != "Cube"
        else place.straight
    )
    pose = P.compose(place.pose, np.array([0.0, 0.0, 0.0, *turn]))
    wide, half = float(across.mean()) * size["radius"], stretch * size["height"] / 2
    if kind == "Cube" and even and axes.min() > 0:
        x, y, z = (float(v) * size["size"] / 2 for v in axes)
        return Solid(Box((x, y, z)), place.pose)
    round_ = even and abs(stretch - float(across.mean())) <= _EVEN * float(axes.max(initial=0.0))
    if kind == "Sphere" and round_:
        return Solid(Sphere(wide), place.pose)
    if kind == "Capsule" and round_:
        return Solid(Capsule(wide, half) if half > 0 else Sphere(wide), pose)
    if kind == "Cylinder" and even:
        return Solid(Cylinder(wide, half), pose)
    made = {
        "Cube": Box((size["size"] / 2, size["size"] / 2, size["size"] / 2)),
        "Sphere": Sphere(size["radius"]),
        "Capsule": Capsule(size["radius"], size["height"] / 2),
        "Cylinder": Cylinder(size["radius"], size["height"] / 2),
    }
    if kind == "Cone":
        r, h = size["radius"], size["height"] / 2
        vertices, faces = turned(np.array([0.0, r, 0.0]), np.array([-h, -h, h]))
    else:
        found = triangles(made[kind])
        assert found is not None
        vertices, faces = found
    if np.linalg.det(place.linear) < 0:
        faces = faces[:, ::-1]
    return Solid(None, place.pose, place.point(P.rotate(turn, vertices)), faces)


def _into(pose: Array, points: Array | None) -> Array:
    """Points (V, 3) of the world in a frame (7,); rounded to a picometre, so that equal meshes have equal digests."""
    assert points is not None
    return np.round(P.rotate_inverse(np.broadcast_to(pose[3:], (len(points), 4)), points - pose[:3]), 12) + 0.0


def _counts(prim: Any) -> tuple[Array, Array]:
    counts = np.array(get(prim, "faceVertexCounts") or (), dtype=np.int64)
    corners = np.array(get(prim, "faceVertexIndices") or (), dtype=np.int64)
    return counts, corners


def mesh_of(prim: Any, path: Path) -> tuple[Array, Array]:
    """Points (V, 3) in the prim's own coordinates and units, and triangles (F, 3), of a mesh without its holes."""
    points = np.array(get(prim, "points") or (), dtype=float).reshape(-1, 3)
    counts, corners = _counts(prim)
    where = f"{path}: mesh '{prim.GetPath()}'"
    if (counts < 0).any() or int(counts.sum()) != len(corners):
        raise AssetError(f"{where} has {len(corners)} corners, and its faces have {int(counts.sum())}")
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise AssetError(f"{where} has {len(points)} points, and a face that asks for another")
    if not np.isfinite(points).all():
        raise AssetError(f"{where} has a point that is no number")
    check(path, MESH_FACES, int(np.maximum(counts - 2, 0).sum()))
    faces = corners[_fans(counts)]
    if str(get(prim, "orientation") or "") == "leftHanded":
        faces = faces[:, ::-1]
    return points, faces[_solid_faces(prim)]


def _fans(counts: Array) -> Array:
    """Of polygons with these numbers of corners the triangles (F, 3), as places in the list of corners."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64) if len(counts) else np.zeros(0, np.int64)
    each = np.maximum(counts - 2, 0)
    first = np.repeat(starts, each)
    step = np.arange(int(each.sum())) - np.repeat(np.cumsum(each) - each, each)
    return np.stack([first, first + step + 1, first + step + 2], axis=1).astype(np.int64)


def _face_owner(prim: Any) -> Array:
    """The polygon of each triangle of a mesh, holes among them."""
    counts, _ = _counts(prim)
    return np.repeat(np.arange(len(counts)), np.maximum(counts - 2, 0))


def _solid_faces(prim: Any) -> Array:
    """Whether each triangle is no hole."""
    return ~np.isin(_face_owner(prim), np.array(get(prim, "holeIndices") or (), dtype=np.int64))


def _convex(vertices: Array, faces: Array) -> bool:
    """Whether triangles are the outside of a convex body: no point lies in front of one."""
    if len(faces) > 2000:
        return False
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = float(np.ptp(vertices, axis=0).max(initial=0.0))
    length = np.linalg.norm(normal, axis=1)
    kept = length > 1e-12 * size * size
    plane = normal[kept] / length[kept, None]
    ahead = np.max(plane @ vertices.T - (plane * corners[kept, 0]).sum(axis=1)[:, None], axis=1)
    return bool((ahead < 1e-4 * size).all())
