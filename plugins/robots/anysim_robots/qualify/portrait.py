"""A picture of a robot at home, as an engine draws it, with a camera that stands as far away as the robot is large."""

from typing import Any

import numpy as np

from anysim.api import compile_world, load, make
from anysim.assets.catalogue import CatalogueEntry
from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.engine.factory import engine_class
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.world import World
from anysim_robots.qualify.stage import NAME, stage

DIRECTION = np.array([0.80, -0.52, 0.32])
"""From the robot to the camera: from the front right, a little from above."""
FOV = 35.0
MARGIN = 1.06
UNDERGROUND = -0.005
"""[m] A robot that reaches below this is drawn without a floor."""


def portrait(entry: CatalogueEntry, engine: str, size: tuple[int, int] = (320, 320), seconds: float = 0.0) -> Array:
    """An image (H, W, 3) uint8, after so much simulated time in which nothing is asked of it.

    Raises:
        CapabilityError: the engine cannot run it or draws no images.
    """
    world = compile_world(load(stage(entry, ground=False)))
    low, high = bounds(world)
    # bolted down or floating, a robot that does not reach below the ground is shown on it
    data: dict[str, Any] = stage(entry, ground=bool(low[2] > UNDERGROUND) or None)
    data["world"]["cameras"] = {"portrait": _camera(low, high, size)}
    if Capability.RENDER_SHADOWS in engine_class(engine).capabilities:
        data["world"]["scenery"] = {"shadows": True} | data["world"].get("scenery", {})
    with make(data, engine=engine, num_envs=1) as env:
        env.reset(seed=0)
        if seconds > 0:
            env.engine.step(max(1, round(seconds / env.engine.world.physics.dt)))
        return env.engine.render("portrait")["rgb"][0]


def _camera(low: Array, high: Array, size: tuple[int, int]) -> dict[str, Any]:
    """A view in which the box between two corners just fits."""
    middle, away = (low + high) / 2, DIRECTION / np.linalg.norm(DIRECTION)
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    corners = corners - middle
    tall = np.tan(np.radians(FOV) / 2)
    reach = np.maximum(
        np.abs(corners @ right) / (tall * size[0] / size[1]), np.abs(corners @ np.cross(away, right)) / tall
    )
    distance = MARGIN * float((reach + corners @ away).max())
    eye = middle + distance * away
    eye[2] = max(eye[2], 0.05)
    return {
        "from": [float(v) for v in eye],
        "look_at": [float(v) for v in middle],
        "fov": FOV,
        "size": list(size),
        "near": min(0.01, distance / 10),
        "far": float(max(20.0, 4 * distance)),
    }


def bounds(world: World) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) [m] of the box around what is seen of the robot at home."""
    meshes = {mesh.name: mesh for mesh in world.meshes}
    entity = next(e for e in world.entities if e.name == NAME)
    poses = world.initial_body_pose
    own = [g for g in world.geoms if entity.body_start <= g.body < entity.body_stop]
    seen = [g for g in own if g.visible] or own
    if not seen:
        places = poses[entity.body_start : entity.body_stop, :3]
        return places.min(axis=0) - 0.1, places.max(axis=0) + 0.1
    corners = [shape_bounds(g.shape, P.compose(poses[g.body], P.pose(g.position, g.quaternion)), meshes) for g in seen]
    return np.min([low for low, _ in corners], axis=0), np.max([high for _, high in corners], axis=0)
