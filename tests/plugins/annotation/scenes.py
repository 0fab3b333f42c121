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


def decoded(text: str, size: list[int]) -> np.ndarray:
    """The mask (H, W) of COCO's text, as its C reader takes it apart: another program than that which wrote it."""
    counts: list[int] = []
    at = 0
    while at < len(text):
        x, shift, more = 0, 0, True
        while more:
            c = ord(text[at]) - 48
            x |= (c & 0x1F) << (5 * shift)
            more = bool(c & 0x20)
            at, shift = at + 1, shift + 1
            if not more and c & 0x10:
                x |= -1 << (5 * shift)
        counts.append(x + counts[-2] if len(counts) > 2 else x)
    flat = np.repeat(np.arange(len(counts)) % 2, counts)
    return flat.reshape(size, order="F").astype(bool)
