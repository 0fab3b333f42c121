"""Images: one scene of visual shapes, put where the bodies of an env are, and drawn from any camera pose.

It has nothing to do with the scenes that physics runs in, so drawing changes no run, and one serves all envs.
"""

from math import radians
from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.cameras import CameraView
from anysim.math import pose as P
from anysim.world.model import (
    Box,
    Capsule,
    Cylinder,
    Geom,
    HeightFieldShape,
    MeshShape,
    Plane,
    Sphere,
    World,
)  # fmt: skip
from anysim_sapien.layout import Layout
from anysim_sapien.library import sapien
from anysim_sapien.options import SapienOptions
from anysim_sapien.shapes import X_TO_Z, relief, to_pose
from anysim_sapien.vulkan import drawing, open_device

FROM_OPTICAL = np.array([0.5, -0.5, 0.5, 0.5])
"""A camera of SAPIEN looks along x, with y to the left and z up; the optical frame has x right, y down, z forward."""

THIN = 1e-3
"""[m]: half the thickness of a drawn plane."""

SUN = (0.3, -0.5, -1.0)

BACKGROUND = (0.80, 0.87, 0.94)
"""Colour of what is beyond everything."""


class Painter:
    """Draws the envs of one engine. Its methods may be called from any thread."""

    def __init__(self, world: World, layout: Layout, options: SapienOptions) -> None:
        with drawing:
            device = open_device(options.vulkan_icd)
            self._shader = options.shader
            if self._shader == "auto":
                self._shader = "lit" if device.is_cpu else "default"
            self._scene: Any = sapien.Scene([sapien.render.RenderSystem()])
            self._cameras: dict[tuple[int, int], Any] = {}
            self._bodies: dict[int, Any] = {}
            self._materials: dict[int, Any] = {}
            self._names = {0: 0}
            self._light(world)
            for index, geom in enumerate(world.geoms):
                if geom.visible:
                    self._add(world, index, geom, int(layout.geom_entity[index]))

    def close(self) -> None:
        """Free the device's copies of the world."""
        with drawing:
            self._cameras.clear()
            self._bodies.clear()
            self._materials.clear()
            self._scene = None

    def _light(self, world: World) -> None:
        render = sapien.render
        self._scene.render_system.set_ambient_light([0.4, 0.4, 0.4])
        directions = [light.direction for light in world.lights if light.position is None] or [SUN]
        for direction in directions:
            entity, light = sapien.Entity(), render.RenderDirectionalLightComponent()
            light.set_color([0.8, 0.8, 0.8])
            along = np.asarray(direction, dtype=float)
            turn = P.multiply(P.look_at(np.zeros(3), along), FROM_OPTICAL)
            entity.add_component(light)
            entity.set_pose(to_pose(np.concatenate([np.zeros(3), turn])))
            self._scene.add_entity(entity)

    def _add(self, world: World, index: int, geom: Geom, entity_id: int) -> None:
        material = sapien.render.RenderMaterial(base_color=list(geom.color))
        component = sapien.render.RenderBodyComponent()
        shape = _visual(world, geom, material)
        shape.set_local_pose(to_pose(_local(geom)))
        component.attach(shape)
        entity = sapien.Entity()
        entity.add_component(component)
        self._scene.add_entity(entity)
        self._materials[index] = material
        self._bodies[index] = (geom.body, entity)
        self._names[int(entity.per_scene_id)] = entity_id

    def draw(self, view: CameraView, poses: Array, colors: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        """See `SimEngine.render`. Poses (E, B, 7) of the bodies and colours (E, G, 4) of the geoms."""
        size = (len(poses), view.height, view.width)
        images: dict[str, Array] = {}
        for name in channels:
            shape, kind = {"rgb": ((*size, 3), np.uint8), "depth": (size, np.float32)}.get(name, (size, np.int32))
            images[name] = np.empty(shape, dtype=kind)
        with drawing:
            camera, mount = self._camera(view)
            for row in range(len(poses)):
                self._compose(poses[row], colors[row])
                eye = np.concatenate([view.pose[row, :3], P.multiply(view.pose[row, 3:], FROM_OPTICAL)])
                mount.set_pose(to_pose(eye))
                self._scene.update_render()
                camera.take_picture()
                self._read(camera, images, row)
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
        camera.set_fovy(radians(view.fov), compute_x=True)
        camera.set_near(view.near)
        camera.set_far(view.far)
        return camera, mount

    def _compose(self, poses: Array, colors: Array) -> None:
        for index, (body, entity) in self._bodies.items():
            if body != WORLD:
                entity.set_pose(to_pose(poses[body]))
            self._materials[index].set_base_color(colors[index].tolist())

    def _read(self, camera: Any, images: dict[str, Array], row: int) -> None:
        seen = camera.get_picture("Segmentation")[..., 1]
        if "rgb" in images:
            color = np.clip(camera.get_picture("Color")[..., :3], 0.0, 1.0)
            if self._shader != "default":  # which has a background of its own
                color[seen == 0] = BACKGROUND
            images["rgb"][row] = np.rint(color * 255)
        if "depth" in images:
            depth = -camera.get_picture("Position")[..., 2]
            images["depth"][row] = np.where(seen > 0, depth, np.inf)
        if "segmentation" in images:
            table = np.zeros(max(self._names) + 1, dtype=np.int32)
            table[list(self._names)] = list(self._names.values())
            images["segmentation"][row] = table[seen]


def _shader_folder(name: str) -> Any:
    from importlib.resources import files

    return files("anysim_sapien") / "shader" / name if name == "lit" else files("sapien") / "vulkan_shader" / name


def _local(geom: Geom) -> Array:
    """The pose of the visual shape in its body's frame."""
    position, turn = np.asarray(geom.position, dtype=float), np.asarray(geom.quaternion, dtype=float)
    if isinstance(geom.shape, Plane):
        position = position - P.rotate(turn, np.array([0.0, 0.0, THIN]))
    if isinstance(geom.shape, Capsule | Cylinder):
        turn = P.multiply(turn, X_TO_Z)
    return np.concatenate([position, turn])


def _visual(world: World, geom: Geom, material: Any) -> Any:
    render = sapien.render
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
            vertices, triangles = relief(next(field for field in world.heightfields if field.name == name))
            return _triangles(vertices.astype(float), triangles, material)


def _triangles(vertices: Array, faces: Array, material: Any) -> Any:
    """A mesh with flat faces: each triangle has its own corners and normal."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.repeat(normals / np.where(length > 0, length, 1.0), 3, axis=0)
    return sapien.render.RenderShapeTriangleMesh(
        corners.reshape(-1, 3).astype(np.float32), np.arange(len(normals), dtype=np.uint32).reshape(-1, 3),
        normals.astype(np.float32), np.zeros((len(normals), 2), dtype=np.float32), material,
    )  # fmt: skip
