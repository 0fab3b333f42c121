"""Rolling: friction that turns a body instead of slowing it."""

from math import cos, radians, sin, sqrt

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.model.world import Cylinder, Quat, Sphere, Surface, World
from anysim.testing.sketch import Sketch
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import CURVE_POINTS, G, Probe, Quantity, Reading, lane, record, series, slope_of
from anysim_parity.probes.slide import on_slab, slab
from anysim_parity.result import Plot

SLOPE, RADIUS, FRICTION, SPEED = radians(15.0), 0.05, 0.3, 2.0
LYING: Quat = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))
"""A cylinder whose axis is y instead of z."""

BODIES = {"sphere": 0.4, "cylinder": 0.5}
"""I / (m r^2) of a solid body about its axis."""

GAIN, SPIN = "roll: acceleration of a {} down 15 degrees", "roll: slip of a {} that rolls, per distance"
FINAL, WHEN = "roll: final speed of a sphere launched at 2 m/s without spin", "roll: time until it rolls"
PLOT = "A sphere that begins to roll"


def roll(dt: float) -> Probe:
    """A sphere and a cylinder roll down an incline; a sphere is launched without spin on the flat."""
    gain = {name: G * sin(SLOPE) / (1 + k) for name, k in BODIES.items()}
    until = 2 * SPEED / (7 * FRICTION * G)
    t = np.linspace(0.0, 0.5, CURVE_POINTS)
    speed = np.maximum(SPEED - FRICTION * G * t, 5 / 7 * SPEED)
    plot = Plot(PLOT, "time [s]", "speed [m/s]", (), series("analytic", t, speed))
    quantities = (
        *(Quantity(GAIN.format(n), "m/s^2", a, T.ROLLING * a) for n, a in gain.items()),
        *(Quantity(SPIN.format(n), "", 0.0, T.ROLLING) for n in gain),
        Quantity(FINAL, "m/s", 5 / 7 * SPEED, T.ROLLING * SPEED),
        Quantity(WHEN, "s", until, max(T.ROLLING * until, dt)),
    )
    return Probe("roll", _world(dt), quantities, _roll, (plot,))


def _world(dt: float) -> World:
    s = Sketch("roll", dt)
    surface = Surface(friction=FRICTION, rolling_friction=0.0)
    for i, name in enumerate(BODIES):
        y = lane(i, 3, 1.0)
        slab(s, f"slab{i}", SLOPE, y, FRICTION)
        shape = Sphere(RADIUS) if name == "sphere" else Cylinder(RADIUS, 0.1)
        s.free(name, shape, on_slab(RADIUS, SLOPE, y), quaternion=LYING, surface=surface)
    y = lane(2, 3, 1.0)
    slab(s, "floor", 0.0, y, FRICTION)
    s.free("launched", Sphere(RADIUS), (0.0, y, RADIUS), surface=surface)
    return s.world()


def _roll(engine: SimEngine) -> Reading:
    launched = engine.index.body("launched")
    engine.set_body_state(twist=[SPEED, 0.0, 0.0, 0.0, 0.0, 0.0], bodies=[launched])
    motion = record(engine, 0.5)
    downhill = np.array([cos(SLOPE), 0.0, -sin(SLOPE)])
    late, values = motion.time > 0.15, dict[str, float]()
    for name in BODIES:
        body = engine.index.body(name)
        speed, turning = motion.twist[:, body, :3] @ downhill, RADIUS * motion.twist[:, body, 4]
        values[GAIN.format(name)] = slope_of(motion.time[late], speed[late])
        values[SPIN.format(name)] = float((speed[-1] - turning[-1]) / max(abs(speed[-1]), 1e-6))
    speed, turning = motion.twist[:, launched, 0], RADIUS * motion.twist[:, launched, 4]
    values[FINAL] = float(speed[-1])
    values[WHEN] = _until(motion.time, speed - turning)
    return Reading(values, {PLOT: (motion.time, speed)})


def _until(time: Array, slip: Array) -> float:
    """When the slip would end if it went on as in its middle part: regularised friction fades at the very end."""
    middle = (slip > 0.2 * SPEED) & (slip < 0.8 * SPEED)
    if middle.sum() < 2:
        return float("nan")
    rate, start = np.polyfit(time[middle], slip[middle], 1)
    return float(-start / rate)
