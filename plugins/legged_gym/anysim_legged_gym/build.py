"""Worlds of legged robots: the neutral World of a spec, its gains, its sensors of contact and its cameras."""

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np

from anysim.api import compile_world
from anysim.conventions import GROUND, WORLD, Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim.model.world import (
    Actuator,
    Camera,
    ContactSensor,
    ControlMode,
    HeightField,
    HeightFieldShape,
    Joint,
    Mesh,
    MeshShape,
    Quat,
    World,
)
from anysim_legged_gym.layout import NAME, Layout
from anysim_legged_gym.spec import ByName, ControlSpec, DepthSpec, LeggedSpec, ViewerSpec
from anysim_schemas.engine import EngineSpec
from anysim_schemas.run import RunSpec

DEPTH, VIEWER = "depth", "viewer"
"""Names of cameras."""
MODES = {"P": ControlMode.POSITION, "V": ControlMode.VELOCITY, "T": ControlMode.EFFORT}


class LeggedWorld(NamedTuple):
    """`world` is what engines build; `measured` the same with its ground as heights, if it has them."""

    run: RunSpec
    world: World
    measured: World
    layout: Layout


def legged_world(spec: LeggedSpec, engine: EngineSpec) -> LeggedWorld:
    """The World of a spec, and where its robot is in it.

    Raises:
        SpecError, AssetError: values that do not fit; with the keys of a run's file.
        TaskError: the robot has no legs, or a name is none of its own.
    """
    run = RunSpec.model_validate(_run(spec, engine))
    world = compile_world(run)
    layout = Layout.of(world, spec.asset)
    world = _driven(world, spec.control)
    links = world.bodies[layout.bodies]
    felt = tuple(ContactSensor(b.name, (i,)) for i, b in enumerate(links, layout.bodies.start))
    cameras = [] if spec.depth is None else [_depth_camera(world, layout, spec.depth)]
    if not spec.viewer.headless:
        cameras.append(_viewer_camera(spec.viewer))
    measured = replace(world, contact_sensors=felt, cameras=tuple(cameras))
    as_mesh = spec.terrain.mesh_type == "trimesh" and measured.heightfields
    return LeggedWorld(run, _with_triangles(measured) if as_mesh else measured, measured, layout)


def _run(spec: LeggedSpec, engine: EngineSpec) -> dict[str, Any]:
    robot: dict[str, Any] = {"robot": spec.asset.robot, "home": spec.init_state.default_joint_angles}
    if spec.asset.self_collision is not None:
        robot["self_collision"] = spec.asset.self_collision
    return {
        "engine": engine.to_dict(),
        "num_envs": spec.num_envs,
        "seed": spec.seed,
        "physics": {
            "dt": spec.sim.dt,
            "control_dt": spec.sim.dt * spec.control.decimation,
            "gravity": spec.sim.gravity,
            "actuation": "explicit_pd",
        },
        "world": {
            "name": f"legged_{spec.asset.robot}" if spec.asset.robot.isidentifier() else "legged",
            "terrain": spec.terrain.surface.to_dict(),
            "robots": {NAME: robot},
        },
    }


# --------------------------------------------------------------------- drives


def _driven(world: World, spec: ControlSpec) -> World:
    joints, drives = list(world.joints), list(world.actuators)
    kp, kd = (_by_name(key, value, joints, drives) for key, value in _gains(spec))
    for i, drive in enumerate(drives):
        own_kp, own_kd = (drive.kp if kp is None else kp[i]), (drive.kd if kd is None else kd[i])
        if spec.control_type == "V":  # the drive law's kd is the gain of a velocity's error
            own_kd = own_kp
        drives[i] = replace(drive, mode=MODES[spec.control_type], kp=own_kp, kd=own_kd)
        if spec.armature is not None:
            joints[drive.joint] = replace(joints[drive.joint], armature=spec.armature)
    return replace(world, joints=tuple(joints), actuators=tuple(drives))


def _gains(spec: ControlSpec) -> tuple[tuple[str, ByName | None], tuple[str, ByName | None]]:
    return ("stiffness", spec.stiffness), ("damping", spec.damping)


def _by_name(key: str, value: ByName | None, joints: Sequence[Joint], drives: Sequence[Actuator]) -> list[float] | None:
    """The gain of each drive: that of the longest text that its joint's name holds."""
    if value is None:
        return None
    names = [joints[drive.joint].name.removeprefix(f"{NAME}.") for drive in drives]
    if not isinstance(value, dict):
        return [float(value) for _ in names]
    for part in value:
        if not any(part in name for name in names):
            raise TaskError(f"control.{key}: no joint's name holds '{part}' (joints: {listing(names, 40)})")
    found: list[float] = []
    for name in names:
        fits = sorted((part for part in value if part in name), key=len)
        if not fits:
            raise TaskError(f"control.{key} says nothing of the joint '{name}'; add a text that its name holds")
        found.append(value[fits[-1]])
    return found


# --------------------------------------------------------------------- cameras and ground


def _depth_camera(world: World, layout: Layout, spec: DepthSpec) -> Camera:
    if spec.near_plane >= spec.far_plane:
        raise TaskError(f"depth: near_plane ({spec.near_plane:g} m) must be below far_plane ({spec.far_plane:g} m)")
    links = layout.body_names
    if spec.link and spec.link not in links:
        raise TaskError(f"depth.link: the robot has no link '{spec.link}' (links: {listing(links, 40)})")
    body = layout.bodies.start + links.index(spec.link) if spec.link else layout.root
    ahead = np.array([np.cos(spec.pitch), 0.0, -np.sin(spec.pitch)])
    width, height = spec.resolution
    return Camera(
        DEPTH,
        body,
        spec.position,
        _towards(np.zeros(3), ahead),
        spec.vertical_fov,
        width,
        height,
        ("depth",) if spec.source == "native" else (),
        near=min(0.01, spec.near_plane),
        far=spec.far_plane * 4,
    )


def _viewer_camera(spec: ViewerSpec) -> Camera:
    turn = _towards(np.array(spec.eye), np.array(spec.target))
    return Camera(VIEWER, WORLD, spec.eye, turn, 45.0, *spec.size, ("rgb",), far=100.0)


def _towards(eye: Array, target: Array) -> Quat:
    x, y, z, w = P.look_at(eye, target).tolist()
    return x, y, z, w


def _with_triangles(world: World) -> World:
    """The same ground as triangles, cut as height fields are: from the lowest corner of a cell to its highest."""
    mesh = triangle_mesh(next(field for field in world.heightfields if field.name == GROUND))
    geoms = tuple(
        replace(g, shape=MeshShape(mesh.name, concave=True))
        if isinstance(g.shape, HeightFieldShape) and g.shape.heightfield == GROUND
        else g
        for g in world.geoms
    )
    return replace(world, geoms=geoms, meshes=(*world.meshes, mesh), heightfields=())


def triangle_mesh(field: HeightField) -> Mesh:
    """The surface of a height field, about its middle."""
    rows, columns = field.heights.shape
    x, y = (np.linspace(-extent / 2, extent / 2, n) for extent, n in zip(field.size, (columns, rows), strict=True))
    vertices = np.stack([*np.meshgrid(x, y), field.heights], axis=-1).reshape(-1, 3)
    low = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up, high = low + 1, low + columns, low + columns + 1
    faces = np.concatenate([np.stack([low, right, high], axis=1), np.stack([low, high, up], axis=1)]).astype(np.int32)
    return Mesh(f"{GROUND}_triangles", vertices, faces, sha256(vertices.tobytes()).hexdigest())
