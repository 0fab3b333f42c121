"""A moment as raw numbers: vertices of everything in metres, by SciPy's rotations. Shares no code with `moment`."""

import colorsys
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from anysim.conventions import Array
from anysim.geometry.triangles import triangles
from anysim.model.shapes import MeshShape, is_ground
from anysim.model.world import World


class RawScene:
    """Vertices and triangles of each entity of a World with its bodies at `poses` (B, 7)."""

    def __init__(self, world: World, poses: Array) -> None:
        self.world, self.poses = world, poses
        self._made: dict[tuple[str, bool], tuple[Array, Array]] = {}

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {entity.name: k for k, entity in enumerate(self.world.entities)}

    def triangles(self, entity: str, base_only: bool = False) -> tuple[Array, Array]:
        """(V, 3) vertices [m] and (F, 3) faces of what an entity collides with, else of what is seen of it."""
        key = (entity, base_only)
        if key not in self._made:
            one = self.world.entities[self._numbers[entity]]
            bodies = [one.body_start] if base_only else list(range(one.body_start, one.body_stop))
            points: list[Array] = []
            faces: list[Array] = []
            total = 0
            for body in bodies:
                own = [g for g in self.world.geoms if g.body == body and not is_ground(g.shape)]
                for geom in [g for g in own if g.collides] or own:
                    if isinstance(geom.shape, MeshShape):
                        mesh = next(m for m in self.world.meshes if m.name == getattr(geom.shape, "mesh", ""))
                        vertices, corners = np.array(mesh.vertices), np.array(mesh.faces)
                    else:
                        made = triangles(geom.shape)
                        if made is None:
                            continue
                        vertices, corners = made
                    local = Rotation.from_quat(np.array(geom.quaternion)).apply(vertices) + np.array(geom.position)
                    turned = Rotation.from_quat(np.array(self.poses[body, 3:])).apply(local) + self.poses[body, :3]
                    points.append(turned)
                    faces.append(corners + total)
                    total += len(turned)
            if not points:
                points, faces = [self.poses[one.body_start, None, :3]], [np.zeros((0, 3), dtype=int)]
            self._made[key] = np.concatenate(points), np.concatenate(faces)
        return self._made[key]

    def bounds(self, entity: str, base_only: bool = False) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) [m]."""
        points = self.triangles(entity, base_only)[0]
        return points.min(axis=0), points.max(axis=0)

    def middle(self, entity: str, base_only: bool = False) -> Array:
        """Of the box around an entity (3,) [m]."""
        low, high = self.bounds(entity, base_only)
        return (low + high) / 2.0

    def hits(self, entity: str, start: Array, towards: Array) -> Array:
        """Distances along a ray at which it meets an entity's triangles, sorted; in lengths of `towards`."""
        points, faces = self.triangles(entity)
        if not len(faces):
            return np.empty(0)
        a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
        normal = np.cross(b - a, c - a)
        along = normal @ towards
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.einsum("ij,ij->i", normal, a - start) / along
        t = np.where(np.abs(along) > 1e-15, t, np.nan)
        at = start + t[:, None] * towards
        inside = np.isfinite(t) & (t >= 0.0)
        for first, second in ((a, b), (b, c), (c, a)):
            inside &= np.einsum("ij,ij->i", np.cross(second - first, at - first), normal) >= -1e-12
        return np.sort(t[inside])


def colour_of(red: float, green: float, blue: float) -> str:
    """The name of a colour by its hue, saturation and value: the definition of `docs/language.md`, in floats."""
    hue, saturation, value = colorsys.rgb_to_hsv(red, green, blue)
    hue, value = hue * 360.0, value * 255.0
    if value <= 40.0:
        return "black"
    if saturation <= 0.25:
        grays = ((96.0, "dark gray"), (176.0, "gray"), (232.0, "light gray"))
        return next((name for end, name in grays if value < end), "white")
    ends = (
        (15, "red"),
        (46, "orange"),
        (68, "yellow"),
        (160, "green"),
        (200, "teal"),
        (255, "blue"),
        (312, "purple"),
        (340, "pink"),
    )
    name = next((name for end, name in ends if hue < end), "red")
    if name in ("red", "orange", "yellow") and saturation <= 0.5 and value >= 150.0:
        return "beige"
    if name == "orange" and value < 200.0:
        return "brown"
    if name == "yellow" and value < 160.0:
        return "olive"
    return f"dark {name}" if name in ("red", "blue") and value < 112.0 else name
