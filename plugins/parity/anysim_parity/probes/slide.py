"""Sliding: what a contact does along the surface, on the flat, pushed, and on an incline."""

from math import cos, radians, sin

import numpy as np

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.model.world import Box, Surface, Vec3, World
from anysim.testing.sketch import Sketch
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import (
    CURVE_POINTS,
    G,
    Probe,
    Quantity,
    Reading,
    about_y,
    lane,
    record,
    series,
    slope_of,
)
from anysim_parity.result import Plot

HALF: Vec3 = (0.1, 0.1, 0.05)
FRICTION, SPEED = 0.3, 2.0
"""Coefficient, and initial speed [m/s] of the block that slides to a stop."""

PUSHES = (2.0, 5.0)
"""[N] on 1 kg, below and above the friction of 2.94 N."""

STOP = "slide: stopping distance from 2 m/s, mu = 0.3"
STUCK, DRIVEN = "slide: speed of a block pushed with 2 N, mu m g = 2.94 N", "slide: acceleration pushed with 5 N"
PLOT = "A block that slides to a stop"


def slide(dt: float) -> Probe:
    """One block is given a speed, two are pushed, on the flat ground."""
    distance, gained = SPEED**2 / (2 * FRICTION * G), PUSHES[1] - FRICTION * G
    t = np.linspace(0.0, SPEED / (FRICTION * G), CURVE_POINTS)
    plot = Plot(PLOT, "time [s]", "distance [m]", (), series("analytic", t, SPEED * t - FRICTION * G / 2 * t**2))
    quantities = (
        Quantity(STOP, "m", distance, T.SLIDING * distance),
        Quantity(STUCK, "m/s", 0.0, T.CREEP, remark="Regularised friction creeps under any load."),
        Quantity(DRIVEN, "m/s^2", gained, T.SLIDING * gained),
    )
    return Probe("slide", _flat(dt), quantities, _slide, (plot,), (Capability.DYNAMICS, Capability.WRENCHES))


def _flat(dt: float) -> World:
    s = Sketch("slide", dt)
    s.ground(Surface(friction=FRICTION))
    for i in range(3):
        s.free(f"block{i}", Box(HALF), (0.0, lane(i, 3, 0.6), HALF[2]), surface=Surface(friction=FRICTION))
    return s.world()


def _slide(engine: SimEngine) -> Reading:
    engine.step(round(0.2 / engine.world.physics.dt))
    engine.set_body_state(twist=[SPEED, 0.0, 0.0, 0.0, 0.0, 0.0], bodies=[0])
    wrench = [[[force, 0.0, 0.0, 0.0, 0.0, 0.0] for force in PUSHES]]
    motion = record(engine, 1.0, push=lambda: engine.apply_wrench(wrench, [1, 2]))
    time, x = motion.time - motion.time[0], motion.pose[:, :, 0]
    late = time > 0.4
    values = {
        STOP: float(x[-1, 0] - x[0, 0]),
        STUCK: slope_of(time[late], x[late, 1]),
        DRIVEN: slope_of(time[late], motion.twist[late, 2, 0]),
    }
    return Reading(values, {PLOT: (time, x[:, 0] - x[0, 0])})


# ---------------------------------------------------------------------- incline

ROUGH = 0.4
ANGLES = (15.0, 30.0)
"""[degrees]: of one slope that friction holds on (21.8 degrees) and one that it does not."""

STEEP = radians(ANGLES[1])

CREEP = "incline: speed of a block at rest, 15 degrees, mu = 0.4"
GAIN = "incline: acceleration at 30 degrees, mu = 0.4"
INCLINE = "A block that slides down 30 degrees, mu = 0.4"


def incline(dt: float) -> Probe:
    """Two blocks on slabs: one that friction holds, one that slides."""
    gain = G * (sin(STEEP) - ROUGH * cos(STEEP))
    t = np.linspace(0.0, 0.8, CURVE_POINTS)
    plot = Plot(INCLINE, "time [s]", "distance [m]", (), series("analytic", t, gain / 2 * t**2))
    quantities = (
        Quantity(CREEP, "m/s", 0.0, T.CREEP, remark="Regularised friction creeps under any load."),
        Quantity(GAIN, "m/s^2", gain, T.SLIDING * gain),
    )
    return Probe("incline", _inclines(dt), quantities, _incline, (plot,))


def slab(s: Sketch, name: str, angle: float, y: float, friction: float) -> None:
    """A fixed plate whose top goes through the origin's height at x = 0, downhill towards +x."""
    place = (-0.1 * sin(angle), y, -0.1 * cos(angle))
    s.fixed(name, Box((2.5, 0.2, 0.1)), place, quaternion=about_y(angle), surface=Surface(friction=friction))


def on_slab(half_height: float, angle: float, y: float) -> Vec3:
    """Where the middle of a body is that lies on such a plate."""
    return (half_height * sin(angle), y, half_height * cos(angle))


def _inclines(dt: float) -> World:
    s = Sketch("incline", dt)
    for i, angle in enumerate(np.radians(ANGLES).tolist()):
        y, surface = lane(i, 2, 1.0), Surface(friction=ROUGH)
        slab(s, f"slab{i}", angle, y, ROUGH)
        s.free(f"block{i}", Box(HALF), on_slab(HALF[2], angle, y), quaternion=about_y(angle), surface=surface)
    return s.world()


def _incline(engine: SimEngine) -> Reading:
    motion = record(engine, 0.8)
    held, slid = (engine.index.body(f"block{i}") for i in range(2))
    downhill = np.array([[cos(a), 0.0, -sin(a)] for a in np.radians(ANGLES)])
    along = ((motion.pose[:, [held, slid], :3] - motion.pose[0, [held, slid], :3]) * downhill).sum(axis=-1)
    speed = motion.twist[:, slid, :3] @ downhill[1]
    late = motion.time > 0.3
    values = {CREEP: slope_of(motion.time[late], along[late, 0]), GAIN: slope_of(motion.time[late], speed[late])}
    return Reading(values, {INCLINE: (motion.time, along[:, 1])})
