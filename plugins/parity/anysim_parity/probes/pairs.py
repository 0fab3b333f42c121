"""The pair rule: which friction two different surfaces have in common."""

import numpy as np

from anysim.engine.base import SimEngine
from anysim.model.world import Box, Surface, World
from anysim.testing.sketch import Sketch
from anysim_parity.probes import tolerances as T
from anysim_parity.probes.probe import G, Probe, Quantity, Reading, lane, record, slope_of
from anysim_parity.probes.slide import HALF

SMOOTH, ROUGH, GROUND = 0.2, 0.6, 0.4
SPEED = 2.0

PAIRS = ((SMOOTH, SMOOTH), (SMOOTH, ROUGH), (ROUGH, SMOOTH), (ROUGH, ROUGH))
"""Coefficients of block and plate."""

FIXED, LOOSE = "pairs: friction of {:g} on a fixed {:g}", "pairs: friction of {:g} on a free {:g}"
RULE = "The pair rule is the larger coefficient; engines that multiply or average have to work around their own rule."


def pairs(dt: float) -> Probe:
    """Blocks slide on plates of equal and of other friction; one of them on a plate that is free itself."""
    found = [Quantity(FIXED.format(*pair), "", max(pair), T.PAIR, remark=RULE) for pair in PAIRS]
    loose = Quantity(LOOSE.format(SMOOTH, SMOOTH), "", SMOOTH, T.PAIR, remark=RULE)
    return Probe("pairs", _world(dt), (*found, loose), _pairs)


def _world(dt: float) -> World:
    s = Sketch("pairs", dt)
    s.ground(Surface(friction=GROUND))
    for i, (block, plate) in enumerate((*PAIRS, (SMOOTH, SMOOTH))):
        y, slab = lane(i, len(PAIRS) + 1, 0.6), Box((2.0, 0.2, 0.05))
        if i < len(PAIRS):
            s.fixed(f"plate{i}", slab, (0.0, y, 0.05), surface=Surface(friction=plate))
        else:
            s.free(f"plate{i}", slab, (0.0, y, 0.05), 20.0, surface=Surface(friction=plate))
        s.free(f"block{i}", Box(HALF), (-1.0, y, 0.1 + HALF[2]), surface=Surface(friction=block))
    return s.world()


def _pairs(engine: SimEngine) -> Reading:
    blocks = [engine.index.body(f"block{i}") for i in range(len(PAIRS) + 1)]
    engine.step(round(0.2 / engine.world.physics.dt))
    engine.set_body_state(twist=np.tile([SPEED, 0.0, 0.0, 0.0, 0.0, 0.0], (1, len(blocks), 1)), bodies=blocks)
    motion = record(engine, 0.2)
    late = motion.time - motion.time[0] > 0.05
    slowed = [-slope_of(motion.time[late], motion.twist[late, body, 0]) / G for body in blocks]
    names = [*(FIXED.format(*pair) for pair in PAIRS), LOOSE.format(SMOOTH, SMOOTH)]
    return Reading(dict(zip(names, slowed, strict=True)))
