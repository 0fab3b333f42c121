"""The rule for friction and restitution, over grids of pairs of surfaces."""

from itertools import product

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.model.world import Box, Sphere, Surface
from anysim.testing import tolerances
from anysim.testing.compare import assert_close, sliding_friction
from anysim.testing.fixtures import needs
from anysim.testing.sketch import Sketch

pytestmark = needs(C.DYNAMICS, C.CONTACTS_STATIC)
G = 9.81

SURFACES = (
    Surface(friction=0.2), Surface(friction=0.5), Surface(friction=0.9), Surface(friction=0.3, priority=1),
    Surface(friction=0.7, priority=1), Surface(friction=0.0, priority=2),
)  # fmt: skip


def rule(a, b):
    """Friction of a pair: of the higher priority alone, else the larger of the two."""
    if a.priority != b.priority:
        return max(a, b, key=lambda s: s.priority).friction
    return max(a.friction, b.friction)


@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
def test_friction_of_every_pair(build, free):
    """Boxes slide on slabs, fixed or free ones that are heavy: each is slowed by its pair's friction times the load."""
    s = Sketch("grid")
    s.ground(Surface(friction=0.8))
    boxes, wanted = [], []
    for i, slab in enumerate(SURFACES):
        size, place = Box((1.0, 0.9, 0.1)), (0.0, 2.0 * i, 0.1)
        if free:
            s.free(f"slab{i}", size, place, 2000.0, surface=slab)
        else:
            s.fixed(f"slab{i}", size, place, surface=slab)
        for k, box in enumerate(SURFACES):
            y = 2.0 * i + 0.28 * (k - 2.5)
            boxes.append(s.free(f"box{i}_{k}", Box((0.1, 0.1, 0.02)), (-0.8, y, 0.22), surface=box))
            wanted.append(rule(slab, box))
    engine = build(s.world())
    ratio = sliding_friction(engine, boxes)
    assert_close(ratio, np.array(wanted), tolerances.FRICTION, "friction of boxes on slabs")


@needs(C.RESTITUTION)
def test_restitution_of_every_pair(build, engine_class):
    """Balls fall on slabs: each comes back with the larger of the two coefficients."""
    values = (0.0, 0.4, 0.8)
    s = Sketch("bounces", 0.001)
    balls, wanted = [], []
    for i, (slab, ball) in enumerate(product(values, values)):
        s.fixed(f"slab{i}", Box((0.2, 0.2, 0.1)), (float(i), 0.0, -0.1), surface=Surface(restitution=slab))
        balls.append(s.free(f"ball{i}", Sphere(0.1), (float(i), 0.0, 0.4), surface=Surface(restitution=ball)))
        wanted.append(max(slab, ball))
    engine = build(s.world())
    engine.step(240)
    down = engine.get_state().body_twist[0, balls, 2]
    engine.step(5)
    up = np.array(engine.get_state().body_twist[0, balls, 2])
    for _ in range(20):
        engine.step(2)
        up = np.maximum(up, engine.get_state().body_twist[0, balls, 2])
    assert (down < -2.0).all()
    exact = engine_class.capabilities.supported[C.RESTITUTION].exact
    allowed = tolerances.RESTITUTION["exact" if exact else "approximate"]
    assert_close(up / np.sqrt(2 * G * 0.3), np.array(wanted), allowed, "speeds after over before")
