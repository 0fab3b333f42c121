"""Shapes, meshes, height fields, materials and lights of a World as elements of an MjSpec."""

from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.model.appearance import NONE
from anysim.model.world import (
    Box,
    Capsule,
    Cylinder,
    Geom,
    HeightField,
    HeightFieldShape,
    Light,
    MeshShape,
    Plane,
    Scenery,
    Sphere,
    World,
)
from anysim_mujoco.mjcf.surfaces import contact_parameters
from anysim_mujoco.options import MujocoOptions
from anysim_mujoco.skins import GROUND, NEUTRAL_RGBA, PLAIN, add_looks, look_name

VISIBLE, VISUAL_ONLY, COLLISION_ONLY, UNSEEN = range(4)
"""Geom groups: drawn and colliding, drawn, colliding, neither."""

DRAWN_GROUPS = (VISIBLE, VISUAL_ONLY)
COLLIDING_GROUPS = (VISIBLE, COLLISION_ONLY)


SKY = ((0.62, 0.74, 0.87), (0.93, 0.95, 0.97))
"""Above and below, where the world has no background of its own."""

AMBIENT, SHINE = 0.28, 0.2
"""Of what there is without any light, and the share of a light that surfaces mirror."""


def own_scenery(options: MujocoOptions) -> Scenery:
    """What is drawn where the World says nothing; the background is the middle of the sky."""
    red, green, blue = (0.5 * (a + b) for a, b in zip(*SKY, strict=True))
    return Scenery((red, green, blue), (AMBIENT, AMBIENT, AMBIENT), options.shadows)


def shadow_place(middle: Array, direction: Array, away: float = 4.0) -> Array:
    """Where the shadow map of a light that shines from far away is drawn from: off the middle of the bodies."""
    return middle - away * direction / np.linalg.norm(direction)


def add_look(spec: Any, world: World, options: MujocoOptions) -> None:
    """Sky, ground material, light: what a picture needs beside the geoms."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=SKY[0],
        rgb2=SKY[1],
        width=256,
        height=1536,
    )
    spec.add_texture(
        name=GROUND,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=(1.0, 1.0, 1.0),
        rgb2=(0.92, 0.93, 0.94),
        width=128,
        height=128,
    )
    spec.add_material(name=PLAIN, rgba=NEUTRAL_RGBA, specular=0.25, shininess=0.4)
    ground = spec.add_material(name=GROUND, rgba=NEUTRAL_RGBA, specular=0.05, texuniform=True, texrepeat=(1.0, 1.0))
    textures = ground.textures
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = GROUND
    ground.textures = textures
    add_looks(spec, world)
    head = spec.visual.headlight
    # the viewer's own lamp only fills in where the world brings its lights
    head.ambient, head.diffuse, head.specular = [AMBIENT] * 3, [0.08 if world.lights else 0.25] * 3, [0.1] * 3
    spec.visual.quality.shadowsize = 1024
    for light in world.lights or (Light("default", (-0.35, 0.25, -1.0), intensity=0.45),):
        _add_light(spec, light, world)


def _add_light(spec: Any, light: Light, world: World) -> None:
    """A light without a position is directional. Its shadow map still has a place: off the middle of the bodies."""
    direction = np.asarray(light.direction, dtype=float)
    away = shadow_place(world.initial_body_pose[:, :3].mean(axis=0) if world.bodies else np.zeros(3), direction)
    element = spec.worldbody.add_light(
        dir=direction,
        pos=away if light.position is None else light.position,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        diffuse=[light.intensity * c for c in light.color],
        specular=[SHINE * light.intensity] * 3,
        castshadow=True,  # the painter says in which envs
    )
    if light.position is not None:
        element.type = mujoco.mjtLightType.mjLIGHT_SPOT
        element.cutoff, element.exponent = 80.0, 1.0


def add_assets(spec: Any, world: World) -> None:
    """The meshes and height fields that geoms refer to."""
    wanted = {g.shape.mesh for g in world.geoms if isinstance(g.shape, MeshShape)}
    for mesh in world.meshes:
        if mesh.name in wanted:
            element = spec.add_mesh(name=mesh.name)
            element.uservert = np.asarray(mesh.vertices, dtype=float).ravel()
            element.userface = np.asarray(mesh.faces, dtype=np.int32).ravel()
            # bodies carry their inertia; as a shell, open meshes and thin ones are accepted too
            element.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    fields = {g.shape.heightfield for g in world.geoms if isinstance(g.shape, HeightFieldShape)}
    for field in world.heightfields:
        if field.name in fields:
            rows, cols = np.shape(field.heights)
            low, span = _relief(field)
            scaled = (np.asarray(field.heights, dtype=float) - low) / span
            size = [field.size[0] / 2, field.size[1] / 2, span, max(0.1, 0.1 * span)]
            element = spec.add_hfield(name=field.name, nrow=rows, ncol=cols, size=size)
            element.userdata = scaled.ravel()


def _relief(field: HeightField) -> tuple[float, float]:
    """The lowest height and the range of heights [m], which MuJoCo wants positive."""
    heights = np.asarray(field.heights, dtype=float)
    return float(heights.min()), max(float(np.ptp(heights)), 1e-6)


def add_geom(spec: Any, owner: Any, geom: Geom, world: World) -> Any:
    """Add a geom to the MjSpec body `owner`."""
    surface = contact_parameters(geom.surface, world.physics.dt)
    kind, size, position = _shape(geom, world)
    number = {t.name: i for i, t in enumerate(world.textures)}.get(geom.texture, NONE)
    finish = {m.name: i for i, m in enumerate(world.materials)}.get(geom.material, NONE)
    groups = {(True, True): VISIBLE, (True, False): VISUAL_ONLY, (False, True): COLLISION_ONLY}
    element = owner.add_geom(
        name=geom.name,
        type=kind,
        size=size,
        pos=position,
        quat=wxyz_from_xyzw(np.asarray(geom.quaternion)),
        rgba=geom.color,
        material=look_name(geom, number, finish),
        contype=int(geom.collides),
        conaffinity=int(geom.collides),
        condim=surface.condim,
        priority=surface.priority,
        friction=surface.friction,
        solref=surface.solref,
        solimp=surface.solimp,
        solmix=surface.solmix,
        group=groups.get((geom.visible, geom.collides), UNSEEN),
        mass=0.0,
        margin=surface.margin,
        gap=surface.gap,
    )
    if isinstance(geom.shape, MeshShape):
        element.meshname = geom.shape.mesh
    elif isinstance(geom.shape, HeightFieldShape):
        element.hfieldname = geom.shape.heightfield
    return element


def _shape(geom: Geom, world: World) -> tuple[Any, tuple[float, float, float], Array]:
    """MuJoCo's type, size and position of a geom."""
    kinds = mujoco.mjtGeom
    position = np.asarray(geom.position, dtype=float)
    match geom.shape:
        case Plane(visual_size):
            return kinds.mjGEOM_PLANE, (visual_size, visual_size, 1.0), position
        case Box(half_size):
            return kinds.mjGEOM_BOX, half_size, position
        case Sphere(radius):
            return kinds.mjGEOM_SPHERE, (radius, 0.0, 0.0), position
        case Capsule(radius, half_length):
            return kinds.mjGEOM_CAPSULE, (radius, half_length, 0.0), position
        case Cylinder(radius, half_length):
            return kinds.mjGEOM_CYLINDER, (radius, half_length, 0.0), position
        case HeightFieldShape(name):
            # MuJoCo's heights start at 0: the geom goes down to the lowest one, along its own z
            low, _ = _relief(next(f for f in world.heightfields if f.name == name))
            return kinds.mjGEOM_HFIELD, (0.0, 0.0, 0.0), position + low * _z_axis(geom)
        case MeshShape():
            return kinds.mjGEOM_MESH, (0.0, 0.0, 0.0), position


def _z_axis(geom: Geom) -> Array:
    from anysim.math import pose as P

    return P.rotate(np.asarray(geom.quaternion), np.array([0.0, 0.0, 1.0]))
