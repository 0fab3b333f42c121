"""Do bases go where their wheels say? A square of 2 m, driven blindly by every drive model on every engine.

    python benchmarks/bases.py [--robot NAME ...] [--engine NAME ...] [--turns left|right]

Each robot gets velocities alone, from the analytic profile of the path, and nobody looks where it is. What is printed
compares the path of its frame with the analytic one: `off path` is the largest distance from it, `end` how far and how
much turned it is from where it began, `behind` the largest distance from where it ought to be at that time, which is
the drives' lag. The car rounds the corners, the others turn on the spot (differential) or go sideways without turning
(holonomic, planar). Exit code 1 if a base is off by more than its bound.
"""

import argparse
import sys
from typing import NamedTuple

import numpy as np

from anysim import registry
from anysim.api import compile_world, load
from anysim.assets.catalogue import load_robot
from anysim.controllers.robot import ControlledRobot
from anysim.engine.factory import create_simulation
from anysim.managers.action import ActionManager
from anysim.managers.standard import standard_managers

SIDE, SPEED, GATHER = 2.0, 0.6, 0.5  # [m], [m/s], [m/s^2]: less than controllers allow
TURN, TURN_GATHER = 1.2, 1.5  # [rad/s], [rad/s^2]
PAUSE = 0.3  # [s] after each piece, in which drives come to rest and wheels steer
CREEP = 1e-3  # [m/s] that tells steered wheels where they are to go
BOUNDS = {"differential": (0.02, 0.02), "ackermann": (0.03, 0.02), "swerve": (0.03, 0.02), "planar": (0.01, 0.01)}
"""Largest distance from the path [m] and angle at the end [rad] after 8 m and four corners."""


class Piece(NamedTuple):
    """What is commanded for a while: components (T, C), and the twist (T, 3) of the base that they stand for."""

    action: np.ndarray
    twist: np.ndarray


class Result(NamedTuple):
    """How far a base is from its analytic path; lengths in metres, angles in radians."""

    off_path: float
    end: float
    end_yaw: float
    behind: float
    height: float


def profile(way: float, speed: float, gather: float, dt: float) -> np.ndarray:
    """(T,) speeds of a trapezoid whose sum over the control steps is the way."""
    top = min(speed, np.sqrt(abs(way) * gather))
    rise = top / gather
    total = rise + abs(way) / top
    t = (np.arange(int(np.ceil(total / dt))) + 0.5) * dt
    v = np.clip(np.minimum(gather * t, gather * (total - t)), 0.0, top)
    return v * (way / (v.sum() * dt))


def square(kind: str, dt: float, side: float, sign: float) -> list[Piece]:
    """The pieces of a square to the left (sign 1) or to the right (-1)."""
    rest = round(PAUSE / dt)

    def straight(way: float) -> np.ndarray:
        return profile(way, SPEED, GATHER, dt)

    def piece(columns: list[np.ndarray], twist: list[np.ndarray]) -> Piece:
        return Piece(*(np.concatenate([np.stack(np.broadcast_arrays(*c), axis=1)]) for c in (columns, twist)))

    def still(action: list[float]) -> Piece:
        return Piece(np.tile(action, (rest, 1)), np.zeros((rest, 3)))

    pieces: list[Piece] = []
    zero = np.zeros(1)
    for corner in range(4):
        if kind == "differential":
            v, w = straight(side), sign * profile(np.pi / 2, TURN, TURN_GATHER, dt)
            pieces += [piece([v, zero], [v, zero, zero]), still([0.0, 0.0]), piece([zero, w], [zero, zero, w])]
            pieces.append(still([0.0, 0.0]))
        elif kind == "ackermann":
            radius, wheelbase = 0.8, 0.5
            steering = sign * np.arctan(wheelbase / radius)
            v, arc = straight(side - 2 * radius), straight(radius * np.pi / 2)
            pieces += [piece([v, zero], [v, zero, zero]), still([0.0, steering]), still([0.0, steering])]
            pieces.append(piece([arc, np.array([steering])], [arc, zero, sign * arc / radius]))
            pieces += [still([0.0, 0.0]), still([0.0, 0.0])]
        else:
            v, angle = straight(side), sign * corner * np.pi / 2
            c, s = np.array([np.cos(angle)]), np.array([np.sin(angle)])
            creep = np.full(rest, CREEP)
            pieces += [piece([creep * c, creep * s, zero], [creep * c, creep * s, zero])]
            pieces += [piece([v * c, v * s, zero], [v * c, v * s, zero]), still([0.0, 0.0, 0.0])]
    return pieces


def path_of(twist: np.ndarray, dt: float) -> np.ndarray:
    """(T + 1, 3) x, y, yaw of a base that has each twist for one control step, exactly."""
    pose = np.zeros((len(twist) + 1, 3))
    for k, (vx, vy, w) in enumerate(twist):
        x, y, yaw = pose[k]
        a = w * dt
        # chord of the arc: sin(a/2)/(a/2) of its length, half of the turn ahead
        part = dt * np.sinc(a / (2 * np.pi))
        c, s = np.cos(yaw + a / 2), np.sin(yaw + a / 2)
        pose[k + 1] = x + part * (c * vx - s * vy), y + part * (s * vx + c * vy), yaw + a
    return pose


def drive(robot: str, engine: str, *, side: float = SIDE, sign: float = 1.0, dt: float = 0.002) -> Result:
    """Drive the square and compare."""
    entry = load_robot(robot).spec
    assert entry.vehicle is not None, f"{robot} has no vehicle"
    channel = next(n for n, c in entry.channels.items() if any(k.endswith("_drive") for k in c.controllers))
    source = {
        "engine": engine, "physics": {"dt": dt, "control_dt": 0.02},
        "world": {
            "name": "square", "terrain": "plane", "robots": {"robot": {"robot": robot, "actions": {channel: "default"}}}
        },
    }  # fmt: skip
    loaded = load(source)
    world = compile_world(loaded)
    managers = standard_managers(loaded.spec, world, 1)
    with create_simulation(engine) as simulation:
        simulation.create_world(world, 1)
        for manager in managers:
            manager.bind(simulation)
        streams, envs = managers[0].streams, np.arange(1)
        streams.seed(0, envs)
        streams.begin(envs)
        simulation.reset()
        for manager in managers:
            manager.reset(envs)
        actions = next(manager for manager in managers if isinstance(manager, ActionManager))
        base = ControlledRobot(world, "robot")
        pieces = square(entry.vehicle.kind, 0.02, side, sign)
        action = np.concatenate([piece.action for piece in pieces])
        path = path_of(np.concatenate([piece.twist for piece in pieces]), 0.02)
        settle = np.zeros((1, actions.dim))
        measured = []
        for k in range(-25, len(action)):
            actions.act(settle if k < 0 else action[None, k], None)
            for part, steps in enumerate(actions.schedule):
                if part:
                    actions.update(part)
                simulation.step(steps)
            if k >= -1:
                pose = simulation.get_state().body_pose[0, base.root]
                x, y, z, w = pose[3:]
                measured.append([*pose[:3], np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))])
    found = np.array(measured)
    return compare(found, path)


def compare(found: np.ndarray, path: np.ndarray) -> Result:
    """Measured x, y, z, yaw (T, 4), from its first pose on, against the path (T, 3)."""
    start = found[0]
    c, s = np.cos(start[3]), np.sin(start[3])
    dx, dy = found[:, 0] - start[0], found[:, 1] - start[1]
    xy = np.stack([c * dx + s * dy, -s * dx + c * dy], axis=1)
    distance = np.array([np.hypot(*(path[:, :2] - point).T).min() for point in xy])
    yaw = found[-1, 3] - start[3] - path[-1, 2]
    turned = np.remainder(yaw + np.pi, 2 * np.pi) - np.pi
    return Result(
        float(distance.max()),
        float(np.hypot(*(xy[-1] - path[-1, :2]))),
        float(abs(turned)),
        float(np.hypot(*(xy - path[:, :2]).T).max()),
        float(found[-1, 2]),
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", action="append")
    parser.add_argument("--engine", action="append")
    parser.add_argument("--turns", choices=("left", "right"), default="left")
    options = parser.parse_args()
    robots = options.robot or ["differential_base", "ackermann_base", "holonomic_base"]
    engines = options.engine or [name for name in registry.names("engines") if name != "null"]
    print(f"{'robot':<20}{'engine':<10}{'off path':>10}{'end':>10}{'end yaw':>10}{'behind':>10}{'height':>9}")
    good = True
    for robot in robots:
        vehicle = load_robot(robot).spec.vehicle
        kind = vehicle.kind if vehicle is not None else parser.error(f"'{robot}' has no vehicle")
        for engine in engines:
            r = drive(robot, engine, sign=1.0 if options.turns == "left" else -1.0)
            fine = max(r.off_path, r.end) <= BOUNDS[kind][0] and r.end_yaw <= BOUNDS[kind][1]
            good &= fine
            print(
                f"{robot:<20}{engine:<10}{1e3 * r.off_path:>7.1f} mm{1e3 * r.end:>7.1f} mm{1e3 * r.end_yaw:>5.1f} mrad"
                f"{1e3 * r.behind:>7.1f} mm{r.height:>7.4f} m{'' if fine else '  OUT OF BOUNDS'}",
                flush=True,
            )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
