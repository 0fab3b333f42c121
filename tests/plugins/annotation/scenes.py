"""Worlds before a camera whose images are known, and captures of them."""

import numpy as np

from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.model.world import Box, Camera, World
from anysim.testing.sketch import Sketch
from anysim_annotation.api import Labels
from anysim_annotation.capture import Capture, Moment

W, H, FOV = 64, 48, 60.0
FOCAL = H / (2 * np.tan(np.radians(FOV) / 2))
EYE = np.array([0.0, 0.0, 1.0])
AHEAD = np.array([1.0, 0.0, 1.0])
"""Looks along x: columns grow against y, rows against z."""


def boxes(*things: tuple[str, tuple[float, float, float], tuple[float, float, float]]) -> World:
    """Boxes by name, half sizes and place, before the camera `eye`."""
    s = Sketch("boxes", gravity=(0.0, 0.0, 0.0))
    for name, half, place in things:
        s.free(name, Box(half), place)
    turn = P.look_at(EYE, AHEAD)
    s.cameras.append(Camera("eye", -1, tuple(EYE), tuple(turn), FOV, W, H, channels=()))
    return s.world()


def looking_at(world: World, num_envs: int = 1, engine: str = "null") -> SimEngine:
    made = create_simulation(engine)
    made.create_world(world, num_envs)
    return made


def label(engine: SimEngine, *names: str, source: str = "geometry") -> dict[str, Labels]:
    return Capture(engine, {"eye": list(names)}, source).take()["eye"]


def moment(poses: np.ndarray, step: int = 0) -> Moment:
    """One env with its bodies at poses (B, 7)."""
    return Moment(np.array([0]), np.array([step]), poses[None])
