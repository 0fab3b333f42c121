"""Grasping: two fingers press a cube; friction carries it or lets it slip."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.model.world import Box, ContactSensor, ControlMode, JointType, Surface, World
from anysim.testing.sketch import Sketch, inertial
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import G, Probe, Quantity, Reading, Z, cube, lane, record, threshold
from anysim_parity.result import Plot, Series

HALF, MASS, FRICTION = 0.02, 0.1, 0.5
"""Of the cube: half its edge [m], mass [kg]; and the coefficient of cube and fingers."""

FINGER = Box((0.02, 0.005, 0.015))
FINGER_MASS = 0.05

LEAST = MASS * G / (2 * FRICTION)
"""[N]: the force of each finger below which the cube slips; both sides carry mu F."""

SPACING = 0.025
"""Of the grip, in units of the least one; the resolution of the threshold."""

STEPS = 4
"""Grips tried below and above the least one."""

DROPPED = 0.005
"""[m] in half a second. A grip that is short by the smallest step lets a cube fall by 15 mm."""

HOLDS = "grasp: least grip that holds, in m g / (2 mu)"
ABOUT = (Capability.CONTACTS_MOVING, Capability.CONTROL_EFFORT, Capability.ARTICULATIONS)


def grasp(dt: float) -> Probe:
    """Grippers press cubes with forces around the least that holds; then the table goes away."""
    return Probe("grasp", _world(dt), (Quantity(HOLDS, "", 1.0, T.HOLD, ABOUT),), _grasp)


def _ratios() -> Array:
    """Grips in units of the least one; 1 itself is between two of them."""
    return 1.0 + SPACING * (np.arange(2 * STEPS) - STEPS + 0.5)


def _world(dt: float) -> World:
    s = Sketch("grasp", dt)
    surface, count = Surface(friction=FRICTION), len(_ratios())
    for i in range(count):
        x = lane(i, count, 0.2)
        base = s.robot(f"gripper{i}", (x, 0.0, 0.5))
        for name, side in (("left", 1.0), ("right", -1.0)):
            _finger(s, base, name, side, surface, ControlMode.EFFORT, 0.0, 0.0, damping=1.0)
        s.free(f"cube{i}", cube(HALF), (x, 0.0, 0.5), MASS, surface=surface)
    s.fixed("table", Box((1.0, 0.01, 0.05)), (0.0, 0.0, 0.5 - HALF - 0.05), surface=Surface(friction=0.0, priority=1))
    return s.world()


def _finger(
    s: Sketch,
    parent: int,
    name: str,
    side: float,
    surface: Surface,
    mode: ControlMode,
    kp: float,
    kd: float,
    damping: float = 0.0,
) -> None:
    """A finger that slides along y, 1 mm from the cube's side; positive is towards the cube."""
    gap = HALF + FINGER.half_size[1] + 0.001
    axis = (0.0, -side, 0.0)
    link = s.link(
        name,
        parent,
        JointType.PRISMATIC,
        axis,
        inertial(FINGER, FINGER_MASS),
        position=(0.0, side * gap, 0.0),
        damping=damping,
    )
    s.shape(link, FINGER, surface=surface)
    s.drive(link, mode, kp, kd)


def _grasp(engine: SimEngine) -> Reading:
    ratios, dt = _ratios(), engine.world.physics.dt
    engine.set_control(effort=np.repeat(ratios * LEAST, 2)[None])
    engine.step(round(0.5 / dt))
    table = engine.index.body("table")
    cubes = [engine.index.body(f"cube{i}") for i in range(len(ratios))]
    engine.set_body_state(pose=[0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0], bodies=[table])
    held = engine.get_state().body_pose[0, cubes, 2].copy()
    engine.step(round(0.5 / dt))
    fallen = held - engine.get_state().body_pose[0, cubes, 2]
    return Reading({HOLDS: threshold(ratios[::-1], fallen[::-1] > DROPPED)})


# ---------------------------------------------------------------------- lift

GRIP_KP, GRIP_KD, GRIP = 2000.0, 40.0, 4.0
"""Gains of the fingers, and the force [N] that their target in the cube stands for: four times the least."""

PALM_MASS = 5.0
"""[kg]: heavy against dt kd of its drive, so that the drive's damping does not show in the grip."""

UP, RISE, HOLD_TIME = 0.1, 1.0, 2.0
"""[m] and [s] of the lift, which has the least jerk and 0.58 m/s^2 at most, and how long it is held."""

SQUEEZE = "lift: force of a finger on the cube"
LIFTED, HELD = "lift: slip in a lift of 0.1 m", "lift: slip in 2 s of holding"
PLOT = "A cube that slips in the grip"


def lift(dt: float) -> Probe:
    """One gripper closes on a cube, lifts it and holds it."""
    position = (Capability.CONTACTS_MOVING, Capability.CONTROL_POSITION)
    quantities = (
        Quantity(SQUEEZE, "N", GRIP, T.GRIP * GRIP, (Capability.CONTACT_SENSORS, *position)),
        Quantity(LIFTED, "m", 0.0, T.SLIP, position, "Regularised friction creeps under any load."),
        Quantity(HELD, "m", 0.0, T.SLIP, position, "Regularised friction creeps under any load."),
    )
    still = Series("analytic", (0.0, RISE + HOLD_TIME), (0.0, 0.0))
    plot = Plot(PLOT, "time [s]", "displacement in the grip [m]", (), still)
    return Probe("lift", _lift_world(dt), quantities, _lift, (plot,))


def _lift_world(dt: float) -> World:
    s = Sketch("lift", dt)
    s.ground()
    surface = Surface(friction=FRICTION)
    base = s.robot("gripper", (0.0, 0.0, HALF + 0.005))
    palm = s.link("palm", base, JointType.PRISMATIC, Z, inertial(Box((0.03, 0.03, 0.03)), PALM_MASS))
    s.drive(palm, ControlMode.POSITION, 20000.0, 600.0)
    for name, side in (("left", 1.0), ("right", -1.0)):
        _finger(s, palm, name, side, surface, ControlMode.POSITION, GRIP_KP, GRIP_KD)
    thing = s.free("cube", cube(HALF), (0.0, 0.0, HALF), MASS, surface=surface)
    left = next(i for i, b in enumerate(s.bodies) if b.name == "gripper.left")
    s.sensors.append(ContactSensor("left", (left,), (thing,)))
    return s.world()


def _lift(engine: SimEngine) -> Reading:
    dt, state = engine.world.physics.dt, engine.get_state()
    palm, thing = engine.index.body("gripper.palm"), engine.index.body("cube")
    # a finger that is stopped by the cube 1 mm ahead exerts kp times what is left
    closed = 0.001 + GRIP / GRIP_KP
    target = np.array([[state.joint_pos[0, 0], closed, closed]])
    engine.set_control(position=target)
    engine.step(round(0.5 / dt))
    values: dict[str, float] = {}
    squeeze = abs(record(engine, 0.2, 5, forces=True).force[:, 0, 1]).mean() if engine.world.contact_sensors else None
    began = float(engine.get_state().time[0])
    height, speed = target[0, 0], np.zeros_like(target)

    def command() -> None:
        share = min(1.0, (float(engine.get_state().time[0]) + dt - began) / RISE)
        target[0, 0] = height + UP * share**3 * (10 - 15 * share + 6 * share**2)
        speed[0, 0] = UP / RISE * 30 * (share * (1 - share)) ** 2
        engine.set_control(position=target, velocity=speed)

    motion = record(engine, RISE + HOLD_TIME, push=command)
    inside = motion.pose[:, thing, 2] - motion.pose[:, palm, 2]
    inside = inside - inside[0]
    top = int(np.searchsorted(motion.time - began, RISE))
    values |= {LIFTED: float(-inside[top]), HELD: float(inside[top] - inside[-1])}
    if squeeze is not None:
        values[SQUEEZE] = float(squeeze)
    return Reading(values, {PLOT: (motion.time - began, inside)})
