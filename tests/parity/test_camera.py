"""The same scene through the same cameras on the three engines: depth within 5 mm at the median, IoU at least 0.95."""

import numpy as np
import pytest

from anysim import api
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.model.world import Box, Camera, Capsule, Cylinder, Sphere, World
from anysim.testing.engines import require_drawing
from anysim.testing.sketch import Sketch
from anysim_parity.camera import DEPTH, OVERLAP, camera_layer
from anysim_parity.judge import agreement

ENGINES = ("mujoco", "pybullet", "sapien")
pytestmark = pytest.mark.slow


def pick_cube() -> World:
    return api.compile_world(api.load("pick_cube"))


def clutter() -> World:
    """Twenty-four things of every primitive on a table, seen from two sides."""
    s = Sketch("clutter")
    s.ground()
    s.fixed("table", Box((0.5, 0.6, 0.02)), (0.0, 0.0, 0.38))
    shapes = (Box((0.05, 0.03, 0.04)), Sphere(0.04), Cylinder(0.03, 0.05), Capsule(0.03, 0.03))
    for i in range(24):
        shape, row, column = shapes[i % 4], i // 6, i % 6
        place = (0.22 * row - 0.33, 0.18 * column - 0.45, 0.46 + 0.02 * (i % 3))
        turn = P.from_roll_pitch_yaw(np.array([0.3 * i, 0.2 * i, 0.5 * i]))
        s.free(f"thing{i}", shape, place, quaternion=tuple(turn.tolist()))
    for name, eye in (("front", (1.3, 0.2, 1.1)), ("side", (-0.2, -1.4, 0.8))):
        look = P.look_at(np.array(eye), np.array([0.0, 0.0, 0.42]))
        s.cameras.append(Camera(name, -1, eye, tuple(look.tolist()), 50.0, 320, 240, ("rgb", "depth", "segmentation")))
    return s.world()


@pytest.mark.parametrize("make", [pick_cube, clutter])
def test_three_engines_see_the_same(make) -> None:
    for name in ENGINES:
        require_drawing(name)
    layer = camera_layer(make(), {name: lambda name=name: create_simulation(name) for name in ENGINES}, size=(320, 240))
    assert not layer.refused
    assert DEPTH <= 5e-3
    assert OVERLAP <= 0.05
    depths = [g for g in layer.gaps if g.subject.endswith("depth, median")]
    # an outline of a few pixels is off by 5 % with one of them: those have no tolerance, and most are not such
    seen = [g for g in layer.gaps if "outline of" in g.subject]
    outlines = [g for g in seen if g.tolerance is not None]
    assert len(outlines) > 0.7 * len(seen)
    assert len(depths) == 2 * 2 * 3  # states, cameras, pairs
    assert len(outlines) > len(depths)
    for gap in (*depths, *outlines):
        assert gap.value <= (DEPTH if gap in depths else OVERLAP), gap
    for measure in layer.measures:
        assert agreement(measure) is not False, measure
