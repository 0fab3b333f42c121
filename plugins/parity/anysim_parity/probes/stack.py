"""Stacks: whether contacts that carry contacts stand still and pass the weight on."""

from itertools import pairwise

import numpy as np

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.model.world import ContactSensor, World
from anysim.testing.sketch import Sketch
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import G, Probe, Quantity, Reading, cube, record
from anysim_parity.result import Plot, Series

COUNT, HALF, MASS = 5, 0.05, 1.0
"""Boxes, half their edge [m] and mass [kg]."""

HEAVY = 50.0
"""[kg] of a box on one of 1 kg: what iterative solvers find hard."""

TOP, DRIFT = f"stack: height of the top one of {COUNT} boxes after 2.5 s", "stack: drift of the top one over 2 s"
FORCE = "stack: force on box {} from the one above"
LOADED, BORNE = f"stack: height of {HEAVY:g} kg on 1 kg", f"stack: force of {HEAVY:g} kg on 1 kg"
PLOT = "Where the top of a stack goes"


def stack(dt: float) -> Probe:
    """Five equal boxes on each other; a heavy box on a light one."""
    top = (2 * COUNT - 1) * HALF
    sensors = (Capability.CONTACT_SENSORS, Capability.CONTACTS_MOVING)
    quantities = [Quantity(TOP, "m", top, T.STACK_HEIGHT), Quantity(DRIFT, "m", 0.0, T.STACK_DRIFT)]
    for i in range(COUNT - 1):
        load = (COUNT - 1 - i) * MASS * G
        quantities.append(Quantity(FORCE.format(i + 1), "N", load, T.WEIGHT * load, sensors))
    quantities.append(Quantity(LOADED, "m", 3 * HALF, T.STACK_HEIGHT))
    quantities.append(Quantity(BORNE, "N", HEAVY * G, T.WEIGHT * HEAVY * G, sensors))
    still = Series("analytic", (0.0, 2.5), (0.0, 0.0))
    plot = Plot(PLOT, "time [s]", "horizontal displacement [m]", (), still)
    return Probe("stack", _world(dt), tuple(quantities), _stack, (plot,))


def _world(dt: float) -> World:
    s = Sketch("stack", dt)
    s.ground()
    boxes = [s.free(f"box{i}", cube(HALF), (0.0, 0.0, (2 * i + 1) * HALF), MASS) for i in range(COUNT)]
    boxes += [s.free(f"pair{i}", cube(HALF), (1.0, 0.0, (2 * i + 1) * HALF), (1.0, HEAVY)[i]) for i in range(2)]
    s.sensors += [ContactSensor(f"layer{a}", (a,), (b,)) for a, b in pairwise(boxes) if b != COUNT]
    return s.world()


def _stack(engine: SimEngine) -> Reading:
    motion = record(engine, 2.5, every=5, forces=bool(engine.world.contact_sensors))
    top, late = COUNT - 1, motion.time >= 0.5
    aside = np.hypot(*(motion.pose[:, top, :2] - motion.pose[0, top, :2]).T)
    began = int(np.argmax(late))
    values = {
        TOP: float(motion.pose[-1, top, 2]),
        DRIFT: float(np.hypot(*(motion.pose[-1, top, :2] - motion.pose[began, top, :2]))),
        LOADED: float(motion.pose[-1, COUNT + 1, 2]),
    }
    if len(motion.force):
        down = -motion.force[motion.time >= 1.5, :, 2].mean(axis=0)
        values |= {FORCE.format(i + 1): float(down[i]) for i in range(COUNT - 1)}
        values[BORNE] = float(down[COUNT - 1])
    return Reading(values, {PLOT: (motion.time, aside)})
