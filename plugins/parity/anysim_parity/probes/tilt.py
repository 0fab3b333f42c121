"""The angle at which a box gives way on an incline: it slips where friction ends, or topples where its width ends."""

from math import atan, atan2, degrees

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.math import pose as P
from anysim.model.world import Box, Surface, Vec3, World
from anysim.testing.sketch import Sketch
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import Probe, Quantity, Reading, about_y, lane, record, threshold
from anysim_parity.probes.slide import HALF, on_slab, slab

FRICTION = 0.5
STICKY = 1.0
"""Coefficients of the box that slips, and of the one that topples before it slips."""

TALL: Vec3 = (0.05, 0.05, 0.1)
"""[m]: half sizes of the box that topples."""

SPACING = 0.25
"""[degrees] between the slopes tried, which is the resolution of the threshold."""

STEPS = 5
"""Slopes tried below and above the analytic angle."""

SECONDS = 1.0
SLIPPED, LEANT = 0.01, 0.15
"""[m] and [rad] after a second. The least slope above the threshold slides by 21 mm and topples wholly."""

SLIP = f"tilt: angle at which a box slips, mu = {FRICTION:g}"
TOPPLE = f"tilt: angle at which a box of {2 * TALL[0]:g} by {2 * TALL[2]:g} m topples"


def slip(dt: float) -> Probe:
    """A flat box on slopes around the friction angle."""
    angle = degrees(atan(FRICTION))
    world = _slopes("slip", dt, angle, HALF, FRICTION)
    return Probe("slip", world, (Quantity(SLIP, "deg", angle, T.ANGLE),), lambda e: Reading({SLIP: _slip(e, angle)}))


def topple(dt: float) -> Probe:
    """A tall box on slopes around the angle at which its centre is above its lower edge."""
    angle = degrees(atan2(TALL[0], TALL[2]))
    world = _slopes("topple", dt, angle, TALL, STICKY)
    return Probe(
        "topple", world, (Quantity(TOPPLE, "deg", angle, T.ANGLE),), lambda e: Reading({TOPPLE: _topple(e, angle)})
    )


def _angles(middle: float) -> Array:
    """[degrees]; the answer itself is between two of them."""
    return middle + SPACING * (np.arange(2 * STEPS) - STEPS + 0.5)


def _slopes(name: str, dt: float, middle: float, half: Vec3, friction: float) -> World:
    s = Sketch(name, dt)
    angles = _angles(middle)
    for i, angle in enumerate(np.radians(angles).tolist()):
        y = lane(i, len(angles), 0.6)
        slab(s, f"slab{i}", angle, y, friction)
        place = on_slab(half[2], angle, y)
        s.free(f"box{i}", Box(half), place, quaternion=about_y(angle), surface=Surface(friction=friction))
    return s.world()


def _boxes(engine: SimEngine) -> list[int]:
    return [engine.index.body(f"box{i}") for i in range(2 * STEPS)]


def _slip(engine: SimEngine, middle: float) -> float:
    boxes, angles = _boxes(engine), _angles(middle)
    motion = record(engine, SECONDS, every=25)
    moved = np.linalg.norm(motion.pose[-1, boxes, :3] - motion.pose[0, boxes, :3], axis=-1)
    return threshold(angles, moved > SLIPPED)


def _topple(engine: SimEngine, middle: float) -> float:
    boxes, angles = _boxes(engine), _angles(middle)
    motion = record(engine, SECONDS, every=25)
    leant = P.angle_between(motion.pose[0, boxes, 3:], motion.pose[-1, boxes, 3:])
    return threshold(angles, leant > LEANT)
