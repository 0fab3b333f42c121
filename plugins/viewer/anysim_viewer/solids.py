"""Visible solids of a World as triangles, joined where they look alike, from the neutral geometry alone."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.triangles import triangles
from anysim.math import pose as P
from anysim.model.appearance import lying, wrapped
from anysim.model.shapes import Capsule, HeightFieldShape, MeshShape, Plane, Shape, Sphere, is_ground
from anysim.model.world import Geom, HeightField, Texture, World


class Look(NamedTuple):
    """How a surface looks: red, green, blue, 0 to 255; opacity 0 to 1; a texture's number or -1; whether round."""

    color: tuple[int, int, int]
    opacity: float
    texture: int
    smooth: bool


class Solid(NamedTuple):
    """Triangles of one look, in the frame of their body.

    Attributes:
        look: of all of them.
        vertices: (V, 3) [m].
        faces: (F, 3).
        places: (V, 2) in the texture; empty without one.
    """

    look: Look
    vertices: Array
    faces: Array
    places: Array


class Looks(NamedTuple):
    """What may be another in each env and episode: colours (G, 4), and numbers (G,) of textures and materials."""

    color: Array
    texture: Array
    material: Array


def built_looks(world: World) -> Looks:
    """Those that the World gives."""
    color = np.array([geom.color for geom in world.geoms]).reshape(-1, 4)
    return Looks(color, np.array(world.geom_texture, dtype=int), np.array(world.geom_material, dtype=int))


class Solids:
    """Makes the solids of a World, each shape once."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._meshes = {mesh.name: mesh for mesh in world.meshes}
        self._fields = {field.name: field for field in world.heightfields}
        self._made: dict[Shape, tuple[Array, Array]] = {}

    def look(self, geom: int, looks: Looks) -> Look:
        """How a geom looks."""
        red, green, blue, alpha = (float(x) for x in np.clip(looks.color[geom], 0.0, 1.0))
        material = int(looks.material[geom])
        opacity = alpha * (1.0 if material < 0 else self.world.materials[material].opacity)
        rounded = (round(255 * red), round(255 * green), round(255 * blue))
        smooth = isinstance(self.world.geoms[geom].shape, Sphere | Capsule)
        return Look(rounded, round(opacity, 3), int(looks.texture[geom]), smooth)

    def of(self, geoms: Iterable[int], looks: Looks) -> list[Solid]:
        """The visible ones of some geoms of a body, those that look alike as one."""
        alike: dict[Look, list[int]] = {}
        for number in geoms:
            if self.world.geoms[number].visible:
                alike.setdefault(self.look(number, looks), []).append(number)
        return [self._joined(look, numbers) for look, numbers in alike.items()]

    def _joined(self, look: Look, numbers: list[int]) -> Solid:
        points, corners, places, start = [], [], [], 0
        for number in numbers:
            geom = self.world.geoms[number]
            vertices, faces = self._triangles(geom.shape)
            if look.texture >= 0:  # each triangle has its own corners, as each has its own places in the texture
                own = vertices[faces]
                flat = isinstance(geom.shape, Plane) or is_ground(geom.shape)
                places.append((lying(own) if flat else wrapped(own)).reshape(-1, 2))
                vertices, faces = own.reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
            points.append(placed(geom, vertices))
            corners.append(faces + start)
            start += len(vertices)
        uv = np.concatenate(places) if places else np.zeros((0, 2))
        return Solid(look, np.concatenate(points), np.concatenate(corners), uv)

    def _triangles(self, shape: Shape) -> tuple[Array, Array]:
        found = self._made.get(shape)
        if found is None:
            found = self._made[shape] = self._make(shape)
        return found

    def _make(self, shape: Shape) -> tuple[Array, Array]:
        match shape:
            case Plane(size):
                corners = np.array([[-size, -size, 0.0], [size, -size, 0.0], [size, size, 0.0], [-size, size, 0.0]])
                return corners, np.array([[0, 1, 2], [0, 2, 3]])
            case MeshShape(name):
                return np.asarray(self._meshes[name].vertices, dtype=float), np.asarray(self._meshes[name].faces)
            case HeightFieldShape(name):
                return relief(self._fields[name])
            case _:
                made = triangles(shape)
                assert made is not None  # what is left are primitives
                return made


def placed(geom: Geom, vertices: Array) -> Array:
    """Vertices (V, 3) of a geom in its body's frame."""
    return P.rotate(np.array(geom.quaternion, dtype=float), vertices) + np.array(geom.position, dtype=float)


def relief(field: HeightField) -> tuple[Array, Array]:
    """Vertices and triangles of a height field, cut along the diagonal that the conventions say."""
    rows, columns = field.heights.shape
    x, y = (np.linspace(-e / 2, e / 2, n) for e, n in zip(field.size, (columns, rows), strict=True))
    vertices = np.stack([*np.meshgrid(x, y), np.asarray(field.heights, dtype=float)], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    upper = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    return vertices, np.concatenate([lower, upper])


def tinted(texture: Texture, color: tuple[int, int, int], whole: bool) -> Array:
    """The pixels (S, S, 3) uint8 of a texture in a colour; `whole` for those of a face, side by side as they repeat."""
    pixels = texture.tiled() if whole else texture.pixels
    return np.rint(np.asarray(pixels, dtype=float) * np.array(color) / 255.0).astype(np.uint8)


def alike(world: World, looks: Looks, least: int) -> Mapping[int, tuple[int, ...]]:
    """Bodies that look the same, `least` of them or more, by the first of them."""
    table: dict[object, list[int]] = {}
    for body, geoms in enumerate(world.body_geoms):
        seen = [g for g in geoms if world.geoms[g].visible]
        if seen and all(looks.texture[g] < 0 for g in seen):
            key = tuple(
                (
                    world.geoms[g].shape,
                    world.geoms[g].position,
                    world.geoms[g].quaternion,
                    looks.material[g],
                    looks.color[g].tobytes(),
                )
                for g in seen
            )
            table.setdefault(key, []).append(body)
    return {bodies[0]: tuple(bodies) for bodies in table.values() if len(bodies) >= least}
