"""Costs of touch: from gaps to forces, and with the rays that find the gaps; not the engine's own contacts."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import Box
from anysim_sensors.bench import SensorCost, best_of, crowd
from anysim_sensors.scene import SceneGeometry
from anysim_tactile.skin import Skin
from anysim_tactile.surfaces import flat

ENVS, GOAL, THICK = 16, 20.0, 0.004


def touch_costs(rounds: int = 200) -> list[SensorCost]:
    """An env's part of 16, with 400 taxels that are pressed into the first of 50 shapes."""
    scene = SceneGeometry(crowd(50))
    geom = next(geom for geom in scene.world.geoms if isinstance(geom.shape, Box))
    assert isinstance(geom.shape, Box)
    place = scene.world.initial_body_pose[geom.body]
    frame = P.compose(place, P.pose((0.0, 0.0, geom.shape.half_size[2] - 0.0005), (1.0, 0.0, 0.0, 0.0)))
    frames = np.repeat(frame[None], ENVS, axis=0)
    posed = scene.posed(np.repeat(scene.world.initial_body_pose[None], ENVS, axis=0))
    pad = flat((0.016, 0.016), (20, 20))
    skin, back = Skin(pad, 5e7), pad.points - THICK * pad.normals
    at = np.random.default_rng(0).uniform(-0.003, 0.003, (ENVS, 2))
    load = _wrench(at)

    def gaps() -> Array:
        return scene.rays(posed, frames, back, pad.normals, reach=2 * THICK).distance - THICK

    gap = gaps()
    carried = best_of(rounds, lambda: skin.carry(gap, load, load)) / ENVS
    whole = best_of(rounds, lambda: skin.carry(gaps(), load, load)) / ENVS
    return [
        SensorCost(f"forces of 400 taxels, in one of {ENVS} envs", carried * 1e6, "us", GOAL, True),
        SensorCost(f"rays and forces of 400 taxels, in one of {ENVS} envs", whole * 1e6, "us", GOAL, True),
    ]


def _wrench(at: Array) -> Array:
    force = np.broadcast_to([0.5, 0.0, -3.0], (len(at), 3))
    return np.concatenate([force, P.cross(np.column_stack([at, np.zeros(len(at))]), force)], axis=1)
