"""Images: one scene of visual shapes, put where the bodies of an env are, and drawn from any camera pose.

It has nothing to do with the scenes that physics runs in, so drawing changes no run, and one serves all envs.
"""

from math import radians
from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.cameras import CameraView
from anysim.engine.lighting import Look, Looks
from anysim.geometry.triangles import triangles
from anysim.math import pose as P
from anysim.model.appearance import lying, wrapped
from anysim.model.world import Box, Capsule, Cylinder, Geom, HeightFieldShape, MeshShape, Plane, Shape, Sphere, World
from anysim_sapien.library import sapien
from anysim_sapien.options import SapienOptions
from anysim_sapien.shapes import X_TO_Z, relief, to_pose
from anysim_sapien.skins import Skins
from anysim_sapien.vulkan import drawing, open_device

FROM_OPTICAL = np.array([0.5, -0.5, 0.5, 0.5])
"""A camera of SAPIEN looks along x, with y to the left and z up; the optical frame has x right, y down, z forward."""

THIN = 1e-3
"""[m]: half the thickness of a drawn plane."""

SUN = (0.3, -0.5, -1.0)
"""Where the light of a world without lights shines to."""


class Painter:
    """Draws the envs of one engine. Its methods may be called from any thread."""

    def __init__(self, world: World, looks: Looks, options: SapienOptions) -> None:
        with drawing:
            device = open_device(options.vulkan_icd)
            self._shader = options.shader
            if self._shader == "auto":
                self._shader = "lit" if device.is_cpu else "default"
            self._scene: Any = sapien.Scene([sapien.render.RenderSystem()])
            self._cameras: dict[tuple[int, int], Any] = {}
            self._bodies: dict[int, Any] = {}
            self._materials: dict[int, Any] = {}
            self._shapes: dict[int, Any] = {}
            self._names = {0: 0}
            self._looks, self._skins, self._world = looks, Skins(world), world
            self._lights = [self._add_light(local) for local in looks.local.tolist()]
            if not self._lights:
                self._shine(self._add_light(False), np.array(SUN), np.zeros(3), np.full(3, 0.6), False)
            entity = [number + 1 for number in (*world.body_entity, -1)]  # the last one is the world's, by its index
            for index, geom in enumerate(world.geoms):
                if geom.visible:
                    self._add(world, index, geom, entity[geom.body])

    def close(self) -> None:
        """Free the device's copies of the world."""
        with drawing:
            self._cameras.clear()
            self._bodies.clear()
            self._lights.clear()
            self._materials.clear()
            self._shapes.clear()
            self._skins.clear()
            self._scene = None

    def _add_light(self, local: bool) -> tuple[Any, Any]:
        """A light of the scene: its entity and its component."""
        entity = sapien.Entity()
        light = sapien.render.RenderPointLightComponent() if local else sapien.render.RenderDirectionalLightComponent()
        light.disable_shadow()  # SAPIEN's own shader has room for few lights with shadows
        entity.add_component(light)
        self._scene.add_entity(entity)
        return entity, light

    def _shine(self, made: tuple[Any, Any], direction: Array, position: Array, emission: Array, local: bool) -> None:
        entity, light = made
        light.set_color(emission.tolist())
        turn = np.array([0.0, 0.0, 0.0, 1.0])
        if not local:
            turn = P.multiply(P.look_at(np.zeros(3), direction), FROM_OPTICAL)
        entity.set_pose(to_pose(np.concatenate([position if local else np.zeros(3), turn])))

    def _add(self, world: World, index: int, geom: Geom, entity_id: int) -> None:
        material = sapien.render.RenderMaterial(base_color=list(geom.color))
        component = sapien.render.RenderBodyComponent()
        shape = _visual(world, geom, material)
        shape.set_local_pose(to_pose(_local(geom, own_axis=not world.textures)))
        component.attach(shape)
        entity = sapien.Entity()
        entity.add_component(component)
        self._scene.add_entity(entity)
        self._materials[index] = material
        self._bodies[index], self._shapes[index] = (geom.body, entity), component
        self._names[int(entity.per_scene_id)] = entity_id

    def draw(
        self, view: CameraView, ids: Array, skins: tuple[Array, ...], there: Array, channels: tuple[str, ...]
    ) -> dict[str, Array]:
        """See `SimEngine.render`. Colour, texture and material (E, G) of geoms, and which bodies are there (E, B)."""
        images = view.blank(channels)
        with drawing:
            camera, mount = self._camera(view)
            for row, index in enumerate(ids.tolist()):
                look = self._looks.of(index)
                self._compose(view.body_pose[row], tuple(part[row] for part in skins), there[row], look)
                camera.set_fovy(radians(view.fov[row]), compute_x=True)
                eye = np.concatenate([view.pose[row, :3], P.multiply(view.pose[row, 3:], FROM_OPTICAL)])
                mount.set_pose(to_pose(eye))
                self._scene.update_render()
                camera.take_picture()
                self._read(camera, images, row, look)
        return images

    def _camera(self, view: CameraView) -> tuple[Any, Any]:
        """A camera of this size; its pictures are named by the shader it was made with."""
        size = (view.width, view.height)
        if size not in self._cameras:
            mount = sapien.Entity()
            camera = sapien.render.RenderCameraComponent(*size, str(_shader_folder(self._shader)))
            mount.add_component(camera)
            self._scene.add_entity(mount)
            self._cameras[size] = (camera, mount)
        camera, mount = self._cameras[size]
        camera.set_near(view.near)
        camera.set_far(view.far)
        return camera, mount

    def _compose(self, poses: Array, skins: tuple[Array, ...], there: Array, look: Look) -> None:
        colors, textures, materials = skins
        self._scene.render_system.set_ambient_light(look.ambient.tolist())
        for k, (light, local) in enumerate(zip(self._lights, self._looks.local.tolist(), strict=True)):
            self._shine(light, look.direction[k], look.position[k], look.emission[k], local)
        for index, (body, entity) in self._bodies.items():
            if body != WORLD:
                entity.set_pose(to_pose(poses[body]))
            opacity = self._skins.give(
                self._materials[index], colors[index], int(textures[index]), int(materials[index])
            )
            shown = colors[index, 3] > 0.0 and (body == WORLD or there[body])
            self._shapes[index].visibility = opacity if shown else 0.0

    def _read(self, camera: Any, images: dict[str, Array], row: int, look: Look) -> None:
        seen = camera.get_picture("Segmentation")[..., 1]
        if "rgb" in images:
            drawn = camera.get_picture("Color")
            blended = self._shader == "default"  # the other shaders have black behind glass
            behind = 0.0 if blended else (1.0 - drawn[..., 3:]) * look.background
            color = np.where(seen[..., None] > 0, drawn[..., :3] + behind, look.background)
            images["rgb"][row] = np.rint(np.clip(color, 0.0, 1.0) * 255)
        if "depth" in images:
            depth = -camera.get_picture("Position")[..., 2]
            images["depth"][row] = np.where(seen > 0, depth, np.inf)
        if "segmentation" in images:
            table = np.zeros(max(self._names) + 1, dtype=np.int32)
            table[list(self._names)] = list(self._names.values())
            images["segmentation"][row] = table[seen]


def _shader_folder(name: str) -> Any:
    from importlib.resources import files

    return files("anysim_sapien") / "shaders" / name if name == "lit" else files("sapien") / "vulkan_shader" / name


def _local(geom: Geom, own_axis: bool) -> Array:
    """The pose of the visual shape in its body's frame; `own_axis` where SAPIEN's shape lies along its x axis."""
    position, turn = np.asarray(geom.position, dtype=float), np.asarray(geom.quaternion, dtype=float)
    if isinstance(geom.shape, Plane):
        position = position - P.rotate(turn, np.array([0.0, 0.0, THIN]))
    if own_axis and isinstance(geom.shape, Capsule | Cylinder):
        turn = P.multiply(turn, X_TO_Z)
    return np.concatenate([position, turn])


def _visual(world: World, geom: Geom, material: Any) -> Any:
    render = sapien.render
    made = triangles(geom.shape) if world.textures else None
    if made is not None:
        # where a texture may come, it lies on its shape as on every engine
        return _triangles(*made, material, round_shape=geom.shape)
    match geom.shape:
        case Plane(size):
            return render.RenderShapeBox([size, size, THIN], material)
        case Box(half_size):
            return render.RenderShapeBox(list(half_size), material)
        case Sphere(radius):
            return render.RenderShapeSphere(radius, material)
        case Capsule(radius, half_length):
            return render.RenderShapeCapsule(radius, half_length, material)
        case Cylinder(radius, half_length):
            return render.RenderShapeCylinder(radius, half_length, material)
        case MeshShape(name):
            mesh = next(mesh for mesh in world.meshes if mesh.name == name)
            return _triangles(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces), material)
        case HeightFieldShape(name):
            vertices, faces = relief(next(field for field in world.heightfields if field.name == name))
            return _triangles(vertices.astype(float), faces, material, flat=True)


def _triangles(
    vertices: Array, faces: Array, material: Any, flat: bool = False, round_shape: Shape | None = None
) -> Any:
    """A mesh with flat faces, but for those of a ball or capsule.

    Each triangle has its own corners, normals, and places in a texture, which is wrapped around the mesh or lies flat.
    """
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    places = (lying(corners) if flat else wrapped(corners)) * [1.0, -1.0]  # SAPIEN's images begin below, and repeat
    normals = np.repeat(normals / np.where(length > 0, length, 1.0), 3, axis=0)
    if isinstance(round_shape, Sphere | Capsule):
        middle = np.zeros_like(corners)
        if isinstance(round_shape, Capsule):
            middle[..., 2] = np.clip(corners[..., 2], -round_shape.half_length, round_shape.half_length)
        normals = ((corners - middle) / round_shape.radius).reshape(-1, 3)
    return sapien.render.RenderShapeTriangleMesh(
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(len(normals), dtype=np.uint32).reshape(-1, 3),
        normals.astype(np.float32),
        places.reshape(-1, 2).astype(np.float32),
        material,
    )
