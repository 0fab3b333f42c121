"""A moment as raw numbers: vertices of everything in metres, by SciPy's rotations. Shares no code with `moment`."""

import colorsys

import numpy as np
from scipy.spatial.transform import Rotation

from anysim.conventions import Array
from anysim.geometry.triangles import triangles
from anysim.model.shapes import MeshShape, is_ground
from anysim.model.world import Geom, World


class RawScene:
    """Vertices and triangles of each body of a World at `poses` (B, 7)."""

    def __init__(self, world: World, poses: Array) -> None:
        self.world, self.poses = world, poses
        self.made: dict[int, tuple[Array, Array]] = {}
        """Vertices and faces by body."""
        self.splats: dict[tuple[str, int], Array] = {}
        """What `check.sight` has drawn of a body, by camera that stands still."""

    def take_over(self, other: "RawScene") -> None:
        """What another scene has made of the bodies that stand where they stand there."""
        same = (self.poses == other.poses).all(axis=1)
        self.made |= {body: made for body, made in other.made.items() if same[body]}
        self.splats |= {key: drawn for key, drawn in other.splats.items() if same[key[1]]}

    def bodies(self, entity: int, base_only: bool = False) -> list[int]:
        """The bodies of an entity by its number; the first alone where only its base counts."""
        one = self.world.entities[entity]
        return [one.body_start] if base_only else list(range(one.body_start, one.body_stop))

    def triangles(self, body: int) -> tuple[Array, Array]:
        """(V, 3) vertices [m] and (F, 3) faces of what a body collides with, else of what is seen of it."""
        if body not in self.made:
            own = [g for g in self.world.geoms if g.body == body and not is_ground(g.shape)]
            parts = [self._geom(geom, body) for geom in [g for g in own if g.collides] or own]
            points = [part[0] for part in parts]
            starts = np.cumsum([0, *(len(part) for part in points)])
            faces = [part[1] + start for part, start in zip(parts, starts, strict=False)]
            self.made[body] = (
                np.concatenate([np.empty((0, 3)), *points]),
                np.concatenate([np.empty((0, 3), dtype=int), *faces]),
            )
        return self.made[body]

    def _geom(self, geom: Geom, body: int) -> tuple[Array, Array]:
        if isinstance(geom.shape, MeshShape):
            name = geom.shape.mesh
            mesh = next(m for m in self.world.meshes if m.name == name)
            vertices, corners = np.array(mesh.vertices), np.array(mesh.faces)
        else:
            made = triangles(geom.shape)
            assert made is not None
            vertices, corners = made
        local = Rotation.from_quat(np.array(geom.quaternion)).apply(vertices) + np.array(geom.position)
        return Rotation.from_quat(np.array(self.poses[body, 3:])).apply(local) + self.poses[body, :3], corners

    def bounds(self, entity: int, base_only: bool = False) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) [m]."""
        points = np.concatenate([self.triangles(body)[0] for body in self.bodies(entity, base_only)])
        if not len(points):
            points = self.poses[self.world.entities[entity].body_start, None, :3]
        return points.min(axis=0), points.max(axis=0)

    def middle(self, entity: int, base_only: bool = False) -> Array:
        """Of the box around an entity (3,) [m]."""
        low, high = self.bounds(entity, base_only)
        return (low + high) / 2.0

    def hits(self, body: int, start: Array, towards: Array) -> Array:
        """Distances along a ray at which it meets a body's triangles from outside, sorted; in lengths of `towards`."""
        points, faces = self.triangles(body)
        if not len(faces):
            return np.empty(0)
        a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
        normal = np.cross(b - a, c - a)
        along = normal @ towards
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(np.abs(along) > 1e-15, np.einsum("ij,ij->i", normal, a - start) / along, np.nan)
        at = start + np.nan_to_num(t, nan=-1.0)[:, None] * towards
        inside = np.isfinite(t) & (t >= 0.0) & (along < 0.0)
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
