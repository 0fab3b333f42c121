"""Images by TinyRenderer. Drawing has a client of its own, so that it takes no part in any env's physics.

That client holds each visible geom once, as a body that nothing moves; an env is drawn by putting the geoms where its
bodies are and giving them its colours. Its bodies have no mass and no collision shapes, and it is never stepped.
"""

import struct
import tempfile
from math import radians, tan
from pathlib import Path
from typing import Any

import numpy as np

from anysim.c_output import quiet
from anysim.conventions import WORLD, Array
from anysim.engine.cameras import CameraView
from anysim.engine.lighting import Look, Looks
from anysim.errors import EngineError
from anysim.geometry.triangles import triangles
from anysim.math import pose as P
from anysim.model.appearance import NONE, lying, wrapped
from anysim.model.world import Box, Geom, HeightField, HeightFieldShape, Mesh, MeshShape, Plane, World
from anysim_pybullet.bullet import bullet, connect, disconnect

MOST_TRIANGLES = 40_000
"""Of one shape: Bullet takes 131,072 corners, and each triangle has its own."""

GROUND_TILES = 16
"""Tiles along an edge of a plane: the renderer is poor at large triangles that reach behind the camera."""

ROUND = 16
"""Half the corners around a round shape, and the rings of a ball from pole to pole: within 0.5 % of its outline."""

SUN = (-0.35, 0.25, -1.0)
"""Where the light of a world without lights shines to."""

FAR_OFF = 6.0
"""[m] How far off the world's origin the light is. From nearer, shadows spread, and more of the ground is out of its
sight, and dark; from further, it sees small images' worth of the scene so coarsely that floors have stripes."""

SPREAD = 0.25
"""Light that comes from one side meets the sides of a ball with this share of its strength, on average."""


class Painter:
    """Draws the envs of one engine."""

    def __init__(self, world: World, looks: Looks) -> None:
        self._world, self._looks = world, looks
        self._middle = world.initial_body_pose[:, :3].mean(axis=0) if world.bodies else np.zeros(3)
        self._geoms: list[int] = []
        """The geom of each body that is drawn: several where it has more corners than Bullet takes at once."""
        self._meshes = {m.name: m for m in world.meshes}
        self._fields = {f.name: f for f in world.heightfields}
        self._client = connect()
        self._uids: list[int] = []
        self._painted: list[int] = []
        p, failure = bullet(), None
        with quiet() as words:
            try:
                self._painted = self._load_textures(p)
                for i, geom in enumerate(world.geoms):
                    if geom.visible:
                        added = self._add(p, geom)
                        self._uids += added
                        self._geoms += [i] * len(added)
            except p.error as error:
                failure = error
        if failure is not None:
            self.close()
            raise EngineError(f"Bullet cannot draw the world '{world.name}': {failure}; {words.tail}") from failure
        self._local = np.array([[*world.geoms[i].position, *world.geoms[i].quaternion] for i in self._geoms])
        self._body = np.array([world.geoms[i].body for i in self._geoms], dtype=int)
        self._colors = np.full((len(self._geoms), 4), -1.0)
        self._textures = np.full(len(self._geoms), NONE)
        entity = {WORLD: 0} | {b: e + 1 for b, e in enumerate(world.body_entity)}
        self._entity = np.zeros(max(self._uids, default=-1) + 2, dtype=np.int32)  # the last one for the background
        for uid, body in zip(self._uids, self._body.tolist(), strict=True):
            self._entity[uid] = entity[body]

    def close(self) -> None:
        """Free the client."""
        disconnect(self._client)

    def draw(
        self, view: CameraView, ids: Array, skins: tuple[Array, ...], there: Array, channels: tuple[str, ...]
    ) -> dict[str, Array]:
        """See `anysim_mechanics.one_world.base.Painter`."""
        images = view.blank(channels)
        for row, index in enumerate(ids.tolist()):
            color, texture, _ = (part[row, self._geoms] for part in skins)
            self._arrange(view.body_pose[row], color, texture.astype(int), there[row])
            look = self._looks.of(index)
            rgba, raw, owner = self._shoot(view, row, look)
            near, far = view.near, view.far
            depth = far * near / (far - (far - near) * raw.astype(np.float64))
            nothing = (owner < 0) | (raw >= 1.0)
            if "rgb" in images:
                sky = np.rint(np.clip(look.background, 0.0, 1.0) * 255).astype(np.uint8)
                images["rgb"][row] = np.where(nothing[..., None], sky, rgba)
            if "depth" in images:
                images["depth"][row] = np.where(nothing, np.inf, depth)
            if "segmentation" in images:
                images["segmentation"][row] = self._entity[np.where(nothing, -1, owner)]
        return images

    def _arrange(self, poses: Array, colors: Array, textures: Array, there: Array) -> None:
        p, client = bullet(), self._client
        # TinyRenderer draws nothing of what is wholly transparent
        colors = np.where(np.append(there, True)[self._body, None], colors, 0.0)
        frame = np.concatenate([poses, [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]])[self._body]
        placed = P.compose(frame, self._local) if len(frame) else frame
        for uid, place in zip(self._uids, placed.tolist(), strict=True):
            p.resetBasePositionAndOrientation(uid, place[:3], place[3:], physicsClientId=client)
        for k in np.flatnonzero((colors != self._colors).any(axis=1)).tolist():
            p.changeVisualShape(self._uids[k], -1, rgbaColor=colors[k].tolist(), physicsClientId=client)
        for k in np.flatnonzero(textures != self._textures).tolist():
            image = NONE if textures[k] == NONE else self._painted[textures[k]]
            p.changeVisualShape(self._uids[k], -1, textureUniqueId=image, physicsClientId=client)
        self._colors, self._textures = colors.copy(), textures

    def _shoot(self, view: CameraView, row: int, look: Look) -> tuple[Array, Array, Array]:
        eye = view.pose[row]
        p, axes = bullet(), P.to_matrix(eye[3:])
        turned = np.eye(4)
        turned[0, :3], turned[1, :3], turned[2, :3] = axes[:, 0], -axes[:, 1], -axes[:, 2]
        turned[:3, 3] = -turned[:3, :3] @ eye[:3]
        top = view.near * tan(radians(view.fov[row]) / 2)
        right = top * view.width / view.height
        # TinyRenderer looks through the lower left corner of a pixel: shifted by half a pixel, that is its middle
        aside, up = right / view.width, top / view.height
        lens = p.computeProjectionMatrix(aside - right, aside + right, up - top, up + top, view.near, view.far)
        towards, emission, brightness, tint = self._light(look)
        _, _, rgba, raw, owner = p.getCameraImage(
            view.width,
            view.height,
            turned.T.ravel().tolist(),
            lens,
            shadow=int(look.shadows),
            lightDirection=towards.tolist(),
            lightDistance=FAR_OFF,
            lightColor=(emission / tint).tolist(),
            lightAmbientCoeff=brightness,
            lightDiffuseCoeff=1.0,
            lightSpecularCoeff=0.05,
            renderer=p.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        size = (view.height, view.width)
        color = np.reshape(rgba, (*size, 4))[..., :3]
        if (tint < 1.0).any():
            color = np.rint(color * tint).astype(np.uint8)
        return color, np.reshape(raw, size), np.reshape(owner, size)

    def _light(self, look: Look) -> tuple[Array, Array, float, Array]:
        """Towards the one light that there is, its emission (3,), the ambient light, and its tint (3,).

        The renderer has one light and grey ambient light. The first of a world's lights shines; the others are light
        from everywhere. Tinted ambient light is that of its brightest colour, the whole picture tinted after it.
        """
        towards, emission = -np.array(SUN), np.full(3, 0.45)
        if len(look.direction):
            local = self._looks.local[0]
            towards = look.position[0] - self._middle if local else -look.direction[0]
            emission = look.emission[0]
        ambient = look.ambient + SPREAD * look.emission[1:].sum(axis=0)
        brightness = float(ambient.max())
        tint = np.maximum(ambient / brightness, 0.02) if brightness > 0 else np.ones(3)
        return towards, emission, brightness, tint

    # ------------------------------------------------------------------ shapes

    def _load_textures(self, p: Any) -> list[int]:
        """Bullet's numbers of the World's textures, which it takes from files."""
        numbers: list[int] = []
        with tempfile.TemporaryDirectory(prefix="anysim-pybullet-") as folder:
            for i, texture in enumerate(self._world.textures):
                file = Path(folder) / f"texture{i}.tga"
                file.write_bytes(tga(texture.tiled()))
                numbers.append(p.loadTexture(str(file), physicsClientId=self._client))
        return numbers

    def _add(self, p: Any, geom: Geom) -> list[int]:
        client, color = self._client, geom.color
        match geom.shape:
            case Box(half) if not self._painted:
                shapes = [p.createVisualShape(p.GEOM_BOX, halfExtents=half, rgbaColor=color, physicsClientId=client)]
            case _:
                vertices, faces = self._triangles(geom)
                flat = isinstance(geom.shape, Plane | HeightFieldShape)
                pieces = np.split(faces, range(MOST_TRIANGLES, len(faces), MOST_TRIANGLES))
                shapes = [self._add_mesh(p, vertices, piece, color, flat) for piece in pieces]
        if min(shapes) < 0:
            raise p.error(f"createVisualShape failed for geom '{geom.name}'")
        return [p.createMultiBody(0, -1, shape, physicsClientId=client) for shape in shapes]

    def _triangles(self, geom: Geom) -> tuple[Array, Array]:
        match geom.shape:
            case MeshShape(name):
                mesh: Mesh = self._meshes[name]
                return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces)
            case HeightFieldShape(name):
                field: HeightField = self._fields[name]
                return grid(np.asarray(field.heights, dtype=float), field.size)
            case Plane(half):
                return grid(np.zeros((GROUND_TILES + 1, GROUND_TILES + 1)), (2 * half, 2 * half))
            case shape:
                # Bullet's own round shapes are drawn so coarsely that they lose up to a tenth of their outline
                made = triangles(shape)
                if made is not None:
                    return made
                raise EngineError(f"pybullet cannot draw a {type(geom.shape).__name__} (geom '{geom.name}')")

    def _add_mesh(self, p: Any, vertices: Array, faces: Array, color: Any, flat: bool) -> int:
        """A mesh of flat triangles, each with its own normal and places in a texture."""
        corners = vertices[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        points = corners.reshape(-1, 3)
        more: dict[str, Any] = {}
        if self._painted:
            # at 1 the renderer begins the image anew
            places = lying(corners) if flat else 0.9999 * wrapped(corners)
            more["uvs"] = places.reshape(-1, 2).tolist()
        return p.createVisualShape(
            p.GEOM_MESH,
            vertices=points.tolist(),
            indices=list(range(len(points))),
            normals=np.repeat(normal, 3, axis=0).tolist(),
            rgbaColor=color,
            physicsClientId=self._client,
            **more,
        )


def tga(pixels: Array) -> bytes:
    """An image (H, W, 3) as the bytes of a TGA file, the simplest format that Bullet reads."""
    height, width, _ = pixels.shape
    head = struct.pack("<3B5x4H2B", 0, 0, 2, 0, 0, width, height, 24, 0x20)  # uncompressed, top row first
    return head + np.ascontiguousarray(pixels[..., ::-1]).tobytes()


def grid(heights: Array, size: tuple[float, float]) -> tuple[Array, Array]:
    """Vertices and triangles of a field of heights (rows, cols) over `size` [m]."""
    rows, cols = heights.shape
    x, y = np.meshgrid(np.linspace(-size[0] / 2, size[0] / 2, cols), np.linspace(-size[1] / 2, size[1] / 2, rows))
    vertices = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + cols + 1], axis=1)
    upper = np.stack([corner, corner + cols + 1, corner + cols], axis=1)
    return vertices, np.concatenate([lower, upper])
