"""The contract of a probe, and the run of its world: every step recorded, only what the probe asks for written."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.model.world import Box, Quat, Vec3, World
from anysim_parity.result import Plot, Series

G = 9.81
"""[m/s^2]"""

Z: Vec3 = (0.0, 0.0, 1.0)

CURVE_POINTS = 150
"""Points of a curve in a plot, at most: enough for a picture of 600 pixels."""


class Quantity(NamedTuple):
    """One thing that a probe measures.

    Attributes:
        subject, unit, reference, tolerance: see `anysim_parity.result.Measure`.
        about: the capabilities whose declared errors explain a difference.
        remark: what makes engines differ here, whichever they are.
    """

    subject: str
    unit: str
    reference: float | None
    tolerance: float | None
    about: tuple[Capability, ...] = (Capability.CONTACTS_STATIC,)
    remark: str = ""


class Reading(NamedTuple):
    """What a probe found on one engine: numbers by subject of the quantity, curves by title of the plot."""

    values: Mapping[str, float]
    curves: Mapping[str, tuple[Array, Array]] = {}


class Probe(NamedTuple):
    """A world, what is measured in it, and how.

    Attributes:
        name: of the family, such as `bounce`.
        world: what every engine is given.
        quantities: what it measures; one whose value an engine cannot give is left out for that engine.
        run: measures on an engine that holds the world, right after a reset.
        plots: the curves it gives, without series yet.
        needs: capabilities beyond those of the world.
    """

    name: str
    world: World
    quantities: tuple[Quantity, ...]
    run: Callable[[SimEngine], Reading]
    plots: tuple[Plot, ...] = ()
    needs: tuple[Capability, ...] = (Capability.DYNAMICS,)


class Recording(NamedTuple):
    """T instants of env 0, from before the first step on.

    time (T,) [s]; pose (T, B, 7) and twist (T, B, 6) as in `State`; force (T, S, 3) [N] of the contact sensors, T = 0
    where they were not asked for.
    """

    time: Array
    pose: Array
    twist: Array
    force: Array


def record(
    engine: SimEngine, seconds: float, every: int = 1, push: Callable[[], None] | None = None, forces: bool = False
) -> Recording:
    """Run on for a time and read the state every few steps. `push` is called before each: a wrench lasts for one."""
    steps = max(1, round(seconds / engine.world.physics.dt / every))
    times: list[float] = []
    poses: list[Array] = []
    twists: list[Array] = []
    sensed: list[Array] = []
    for number in range(steps + 1):
        if number:
            if push is not None:
                push()
            engine.step(every)
        state = engine.get_state()
        times.append(float(state.time[0]))
        poses.append(state.body_pose[0].copy())
        twists.append(state.body_twist[0].copy())
        if forces:
            sensed.append(state.contact_force[0].copy())
    return Recording(np.array(times), np.array(poses), np.array(twists), np.array(sensed))


def crossing(time: Array, value: Array, level: float) -> float:
    """The first time [s] at which a rising value reaches a level, between two samples by a straight line; else nan."""
    above = np.flatnonzero(value >= level)
    if not len(above):
        return float("nan")
    k = int(above[0])
    if k == 0:
        return float(time[0])
    share = (level - value[k - 1]) / (value[k] - value[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def slope_of(time: Array, value: Array) -> float:
    """The slope of the straight line that fits best."""
    return float(np.polyfit(time - time[0], value, 1)[0])


def series(name: str, x: Array, y: Array) -> Series:
    """A curve thinned out for drawing, its last point included."""
    which = np.unique(np.linspace(0, len(x) - 1, min(CURVE_POINTS, len(x))).round().astype(int))
    return Series(name, tuple(float(v) for v in x[which]), tuple(float(v) for v in y[which]))


def cube(half: float) -> Box:
    """A box of equal edges, `half` [m] half an edge."""
    return Box((half, half, half))


def about_y(angle: float) -> Quat:
    """The quaternion of a rotation about the y axis: downhill is +x for a positive angle."""
    return (0.0, float(np.sin(angle / 2)), 0.0, float(np.cos(angle / 2)))


def lane(number: int, count: int, apart: float) -> float:
    """y [m] of one of several experiments side by side, the middle one at 0."""
    return (number - (count - 1) / 2) * apart


def threshold(level: Array, gave_way: Array) -> float:
    """Where things begin to give way: between the highest level at which all held and the next one.

    Levels (K,) in rising order. Half a spacing beyond the ends where all or none gave way.
    """
    spacing = level[1] - level[0]
    which = np.flatnonzero(gave_way)
    return float(level[which[0]] - spacing / 2) if len(which) else float(level[-1] + spacing / 2)
