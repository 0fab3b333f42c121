"""Worlds with tendons and constraints whose motion is known, and the errors that engines may declare of them."""

from dataclasses import replace
from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.state import State
from anysim.math import pose as P
from anysim.model.world import Box, Constraint, ConstraintKind, ControlMode, SpatialTendon, Tendon, Waypoint, World
from anysim.testing import worlds
from anysim.testing.drive_errors import Build
from anysim.testing.sketch import Sketch, inertial

G = 9.81
MASSES = 2.0, 1.0
SHARES = 1.0, -0.5
"""Of two sliders on a tendon: their masses [kg], and the tendon's coefficients."""

ROD, HUNG = Box((0.02, 0.03, 0.25)), 0.25
"""A rod of 1 kg, and how far above its middle [m] it hangs."""


def pair(drive: ControlMode | None = None, start: float = 0.1, dt: float = 0.001, **tendon: Any) -> World:
    """Two sliders of `MASSES` along x on a tendon with `SHARES`, without gravity; a drive pulls at it, if any."""
    s = Sketch("pair", dt, worlds.WEIGHTLESS)
    base = s.robot("pair")
    for name, mass, initial in zip("ab", MASSES, (start, 0.0), strict=True):
        body = inertial(Box((0.1, 0.1, 0.1)), mass)
        link = s.link(name, base, worlds.PRISMATIC, worlds.X, body, initial=initial)
        if drive is not None and name == "a":
            s.drive(link, drive, 40.0, 12.0)
            s.actuators[-1] = replace(s.actuators[-1], shares=((1, SHARES[1] / SHARES[0]),))
    if tendon:
        s.more["tendons"] = (Tendon("pair.tendon", (0, 1), SHARES, **tendon),)
    return s.world()


def pair_solution(stiffness: float, damping: float, start: Array, time: float) -> Array:
    """Positions and velocities (4,) of the sliders after a time, from positions and velocities, with the rest at 0."""
    pull = np.outer(SHARES, SHARES) / np.array(MASSES)[:, None]
    motion = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness * pull, -damping * pull]])
    steps = 4096  # of a classical Runge-Kutta: exact to rounding for what swings slowly
    row, h = np.array(start, dtype=float), time / steps
    step = np.eye(4)
    for order in (4, 3, 2, 1):
        step = np.eye(4) + (h / order) * motion @ step
    return np.linalg.matrix_power(step, steps) @ row


def strung(**tendon: Any) -> World:
    """A slider of 2 kg along x on a string from (0, 0, 0.3) to it, and by a pulley of 2 on to (1, 0, 0)."""
    s = Sketch("strung", 0.001, worlds.WEIGHTLESS)
    base = s.robot("strung")
    s.link("slider", base, worlds.PRISMATIC, worlds.X, inertial(Box((0.1, 0.1, 0.1)), MASSES[0]), initial=0.4)
    path = (
        Waypoint(base, (0.0, 0.0, 0.3)),
        Waypoint(base + 1),
        Waypoint(pulley=2.0),
        Waypoint(base + 1),
        Waypoint(base, (1.0, 0.0, 0.0)),
    )
    s.more["spatial_tendons"] = (SpatialTendon("strung.string", path, **tendon),)
    return s.world()


def strung_length(position: Array) -> Array:
    """[m] of the string of `strung` with its slider at positions of up to 1 m."""
    return np.hypot(position, 0.3) + (1.0 - position) / 2


def hung(kind: ConstraintKind, angle: float = 0.1, dt: float = 0.001) -> World:
    """A rod that a constraint holds to the world by its upper end; it leans by an angle [rad] about y."""
    s = Sketch("hung", dt)
    lean = worlds.turn(worlds.Y, angle)
    body = s.free("rod", ROD, (0.0, 0.0, 1.0), 1.0, com=(0.0, 0.0, 0.02), quaternion=lean, collides=False)
    x, y, z = (float(v) for v in P.rotate(np.array(lean), np.array([0.0, 0.0, HUNG])))
    end = Constraint("nail", kind, body, WORLD, (0.0, 0.0, HUNG), other_position=(x, y, z + 1.0), other_quaternion=lean)
    s.more["constraints"] = (end,)
    return s.world()


def four_bar(dt: float = 0.001) -> World:
    """Two rods of 0.4 m that hang beside each other, and a bar from the end of one to that of the other: a loop."""
    s = Sketch("four bar", dt)
    base, rod = s.robot("bars", (0.0, 0.0, 1.0)), inertial(Box((0.02, 0.02, 0.2)), 0.5, (0.0, 0.0, -0.2))
    hinge: dict[str, Any] = {"initial": 0.3}
    left = s.link("left", base, worlds.REVOLUTE, worlds.Y, rod, position=(-0.2, 0.0, 0.0), **hinge)
    beam = inertial(Box((0.2, 0.02, 0.02)), 0.4, (0.2, 0.0, 0.0))
    bar = s.link("bar", left, worlds.REVOLUTE, worlds.Y, beam, position=(0.0, 0.0, -0.4), initial=-0.3)
    right = s.link("right", base, worlds.REVOLUTE, worlds.Y, rod, position=(0.2, 0.0, 0.0), **hinge)
    loop = Constraint("loop", ConstraintKind.CONNECT, bar, right, (0.4, 0.0, 0.0), other_position=(0.0, 0.0, -0.4))
    s.more["constraints"] = (loop,)
    return s.world()


def welded(dt: float = 0.001) -> World:
    """Two boxes that float and are welded side by side, the centre of mass of one beside its frame."""
    s = Sketch("welded", dt, worlds.WEIGHTLESS)
    one = s.free("one", Box((0.1, 0.1, 0.1)), (0.0, 0.0, 1.0), 2.0, collides=False)
    other = s.free("other", Box((0.05, 0.05, 0.2)), (0.15, 0.0, 1.1), 1.0, com=(0.01, 0.0, 0.0), collides=False)
    weld = Constraint("weld", ConstraintKind.WELD, one, other, (0.1, 0.0, 0.1), other_position=(-0.05, 0.0, 0.0))
    s.more["constraints"] = (weld,)
    return s.world()


def gaps(world: World, state: State) -> tuple[float, float]:
    """The largest distance [m] between the origins of two frames that are held together, and angle [rad], in env 0."""
    away = turned = 0.0
    for one in world.constraints:
        ends = (one.body, one.position, one.quaternion), (one.other, one.other_position, one.other_quaternion)
        first, second = (
            P.pose(place, turn) if body == WORLD else P.compose(state.body_pose[0, body], P.pose(place, turn))
            for body, place, turn in ends
        )
        between = P.compose(P.inverse(first), second)
        away = max(away, float(np.linalg.norm(between[:3])))
        if one.kind is ConstraintKind.WELD:
            turned = max(turned, 2 * float(np.linalg.norm(between[3:6])))
    return away, turned


# ---------------------------------------------------------------------- errors that engines may declare


def apart(build: Build) -> float:
    """[m] between two points that hold a rod of 1 kg, pulled down with 100 N: at 110 N."""
    engine = build(hung(ConstraintKind.CONNECT, 0.0))
    engine.apply_wrench([0.0, 0.0, -100.0, 0.0, 0.0, 0.0], [0])
    engine.step(300)
    return gaps(engine.world, engine.get_state())[0]


def askew(build: Build) -> float:
    """[rad] between two frames that are welded, at 5 N m on a rod of 1 kg."""
    engine = build(hung(ConstraintKind.WELD, 0.0))
    engine.apply_wrench([0.0, 0.0, 0.0, 0.0, 5.0, 0.0], [0])
    engine.step(300)
    return gaps(engine.world, engine.get_state())[1]


def dragged(build: Build) -> float:
    """[m] of two sliders on a damped tendon from the solution, over 0.8 s from 0.1 m at 1 ms."""
    engine, worst = build(pair(stiffness=50.0, damping=3.0)), 0.0
    row = np.array([0.1, 0.0, 0.0, 0.0])
    for _ in range(8):
        engine.step(100)
        row = pair_solution(50.0, 3.0, row, 0.1)
        worst = max(worst, float(np.abs(engine.get_state().joint_pos[0] - row[:2]).max()))
    return worst
