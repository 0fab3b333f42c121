"""Falling, landing, lying and bouncing: what a contact does along its normal."""

from math import sqrt

import numpy as np

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.model.world import ContactSensor, Sphere, Surface, World
from anysim.testing.sketch import Sketch
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import CURVE_POINTS, G, Probe, Quantity, Reading, crossing, cube, lane, record, series
from anysim_parity.result import Plot

GAP, DISTANCE = 0.5, 0.4
"""[m]: clearance of the falling ball, and the distance that it is timed over."""

RADIUS, HALF = 0.05, 0.05
MASSES = (0.1, 1.0, 20.0)
"""[kg] of the boxes that lie on the ground."""

FALL = "drop: time of a fall over 0.4 m"
HEIGHT, WEIGHT = "drop: height of a box of {:g} kg at rest", "drop: force under a box of {:g} kg at rest"
STILL = "drop: speed at rest"

SINKS = "A soft contact carries a weight by sinking; a rigid one may keep a gap as wide as its margin."


def drop(dt: float) -> Probe:
    """A ball falls; boxes of several masses are put down gently and lie."""
    quantities = [Quantity(FALL, "s", sqrt(2 * DISTANCE / G), dt, (Capability.RIGID_BODIES,))]
    for mass in MASSES:
        quantities.append(Quantity(HEIGHT.format(mass), "m", HALF, T.REST_HEIGHT, remark=SINKS))
    for mass in MASSES:
        about = (Capability.CONTACT_SENSORS, Capability.CONTACTS_STATIC)
        quantities.append(Quantity(WEIGHT.format(mass), "N", mass * G, T.WEIGHT * mass * G, about))
    quantities.append(Quantity(STILL, "m/s", 0.0, T.CREEP))
    t = np.linspace(0.0, sqrt(2 * GAP / G), CURVE_POINTS)
    plot = Plot(PLOT, "time [s]", "height [m]", (), series("analytic", t, RADIUS + GAP - G / 2 * t**2))
    return Probe("drop", _drop_world(dt), tuple(quantities), _drop, (plot,))


PLOT = "A ball that falls from 0.5 m"


def _drop_world(dt: float) -> World:
    s = Sketch("drop", dt)
    s.ground()
    for i, mass in enumerate(MASSES):
        body = s.free(f"box{i}", cube(HALF), (1.0, lane(i, len(MASSES), 0.5), HALF + 0.001), mass)
        s.sensors.append(ContactSensor(f"box{i}", (body,)))
    s.free("ball", Sphere(RADIUS), (0.0, 0.0, RADIUS + GAP))
    return s.world()


def _drop(engine: SimEngine) -> Reading:
    ball = engine.index.body("ball")
    motion = record(engine, 0.6)
    fallen = RADIUS + GAP - motion.pose[:, ball, 2]
    values = {FALL: crossing(motion.time, fallen, DISTANCE)}
    engine.step(round(0.6 / engine.world.physics.dt))
    rest = record(engine, 0.2, forces=bool(engine.world.contact_sensors))
    for i, mass in enumerate(MASSES):
        values[HEIGHT.format(mass)] = float(rest.pose[:, i, 2].mean())
        if len(rest.force):
            values[WEIGHT.format(mass)] = float(rest.force[:, i, 2].mean())
    values[STILL] = float(np.abs(rest.twist[:, : len(MASSES), :3]).max())
    return Reading(values, {PLOT: (motion.time, motion.pose[:, ball, 2])})


# ---------------------------------------------------------------------- bounce

BOUNCES = (0.0, 0.3, 0.6, 0.9)
"""Coefficients of restitution."""

AROUND = 0.08
"""[s] before and after the impact in which the ball is lowest; also the smallest bounce is in the air for 0.19 s."""

APEX, SUNK = "bounce: apex after the impact, e = {:g}", "bounce: depth of the impact, e = {:g}"


def bounce(dt: float) -> Probe:
    """Balls of several restitutions fall from 0.5 m."""
    about = (Capability.RESTITUTION, Capability.CONTACTS_STATIC)
    apex = [
        Quantity(APEX.format(e), "m", e * e * GAP, ((e + T.RESTITUTION) ** 2 - e * e) * GAP, about) for e in BOUNCES
    ]
    sunk = [Quantity(SUNK.format(e), "m", 0.0, sqrt(2 * G * GAP) * dt, about) for e in BOUNCES]
    t = np.linspace(0.0, 1.4, 4 * CURVE_POINTS)
    plots = tuple(
        Plot(_bounce_plot(e), "time [s]", "height of the underside [m]", (), series("analytic", t, _hop(e, t)))
        for e in BOUNCES[2:]
    )
    return Probe("bounce", _bounce_world(dt), (*apex, *sunk), _bounce, plots)


def _bounce_plot(e: float) -> str:
    return f"A ball that bounces, e = {e:g}"


def _hop(e: float, t: np.ndarray) -> np.ndarray:
    """Height over the ground of the underside, through all bounces."""
    first, speed = sqrt(2 * GAP / G), sqrt(2 * G * GAP)
    height = GAP - G / 2 * t**2
    start = first
    while start < t[-1] and speed > 1e-3:
        speed *= e
        since = t - start
        height = np.where(since >= 0, speed * since - G / 2 * since**2, height)
        start += 2 * speed / G
    return np.maximum(height, 0.0)


def _bounce_world(dt: float) -> World:
    s = Sketch("bounce", dt)
    s.ground()
    for i, e in enumerate(BOUNCES):
        place = (0.0, lane(i, len(BOUNCES), 0.5), RADIUS + GAP)
        s.free(f"ball{i}", Sphere(RADIUS), place, surface=Surface(restitution=e))
    return s.world()


def _bounce(engine: SimEngine) -> Reading:
    motion = record(engine, 1.4)
    height = motion.pose[:, :, 2] - RADIUS
    first = int(np.searchsorted(motion.time, sqrt(2 * GAP / G) - AROUND))
    last = int(np.searchsorted(motion.time, sqrt(2 * GAP / G) + AROUND))
    lowest = first + np.argmin(height[first:last], axis=0)
    values: dict[str, float] = {}
    curves: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for i, e in enumerate(BOUNCES):
        values[APEX.format(e)] = float(height[lowest[i] :, i].max())
        values[SUNK.format(e)] = float(max(0.0, -height[:, i].min()))
        if e in BOUNCES[2:]:
            curves[_bounce_plot(e)] = (motion.time, height[:, i])
    return Reading(values, curves)
