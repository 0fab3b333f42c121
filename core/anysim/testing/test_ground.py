"""Ground that is no plane: height fields and triangle meshes are where the neutral geometry says, and carry things."""

from math import cos, degrees, radians, sin

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.testing import ground, tolerances
from anysim.testing.compare import assert_close
from anysim.testing.fixtures import needs

FIELD = pytest.param(False, marks=needs(C.TERRAIN_HEIGHTFIELD), id="field")
MESH = pytest.param(True, marks=needs(C.TERRAIN_TRIMESH), id="mesh")
both = pytest.mark.parametrize("as_mesh", [FIELD, MESH])


@both
@needs(C.RAYCAST)
def test_rays_meet_the_ground_where_the_world_has_it(build, as_mesh):
    """Rays from above hit the triangles that the conventions say, within a millimetre: also which way they are cut."""
    world = ground.hills(as_mesh)
    engine = build(world)
    rng = np.random.default_rng(1)
    points = rng.uniform((-1.95, -1.45), (1.95, 1.45), size=(400, 2))
    start = np.concatenate([points, np.full((400, 1), 2.0)], axis=1)
    hit = engine.raycast(start[None], np.tile([0.0, 0.0, -1.0], (1, 400, 1)))
    found = 2.0 - np.asarray(hit.distance)[0]
    assert_close(found, world.ground.heights_at(points), tolerances.GROUND, "height of the ground")


@both
@needs(C.DYNAMICS)
def test_a_ball_rolls_down_a_ramp(build, as_mesh):
    """A solid ball that does not slip goes with 5/7 g sin a; a box with enough friction stays where it lies."""
    angle = radians(15.0)
    engine = build(ground.ramp(angle, as_mesh))
    ball, box = engine.index.body("ball"), engine.index.body("box")
    start = engine.get_state().body_pose[0, ball, :3].copy()
    engine.step(800)
    pose = engine.get_state().body_pose[0]
    went = float(np.linalg.norm(pose[ball, :3] - start))
    assert_close(went, 0.5 * 5 / 7 * 9.81 * sin(angle) * 0.8**2, tolerances.ROLLING * went, "distance of the ball")
    normal = np.array([sin(angle), 0.0, cos(angle)])
    assert_close(float(pose[ball, :3] @ normal), ground.RADIUS, tolerances.GROUND, "ball above the ramp")
    assert_close(float(pose[box, :3] @ normal), 0.05, tolerances.GROUND, "box above the ramp")
    assert abs(pose[box, 0] + 1.0 - 0.05 * sin(angle)) < 0.01, f"the box slid on {degrees(angle):.0f} degrees"


@both
@needs(C.DYNAMICS)
def test_balls_rest_on_their_steps(build, as_mesh):
    """Each tread of stairs carries a ball at its height."""
    engine = build(ground.stairs(as_mesh))
    engine.step(700)
    heights = engine.get_state().body_pose[0, :, 2]
    expected = ground.STEP * np.arange(4) + ground.RADIUS
    assert_close(heights, expected, tolerances.GROUND, "height of the balls")
