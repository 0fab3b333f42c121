"""Capabilities that are easily declared and seldom looked at: each does something that can be measured."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability as C
from anysim.engine.presence import Lifecycle
from anysim.math import pose as P
from anysim.model.world import Box, Camera, Light, Scenery, Solver, Sphere, World
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio
from anysim.testing.fixtures import needs
from anysim.testing.sketch import Sketch
from anysim.testing.varying import BARE, FULL, having, varied

G = 9.81


@needs(C.DYNAMICS, C.GRAVITY_COMPENSATION)
def test_a_compensated_free_body_hovers(build):
    """A free body without weight stays where it is put and coasts straight, beside one that falls."""
    world = worlds.drifting(com=(0.05, -0.02, 0.1), count=2, gravity=(0.0, 0.0, -G))
    first, second = world.bodies
    engine = build(replace(world, bodies=(replace(first, gravity_compensation=True), second)), 2)
    engine.set_body_state(twist=[[0.5, 0.0, 0.1, 0.0, 0.0, 0.0]], env_ids=[1], bodies=[0])
    start = engine.get_state().body_pose[:, 0, :3]
    engine.step(250)
    state = engine.get_state()
    moved = state.body_pose[:, 0, :3] - start
    assert_close(moved, np.array([[0.0, 0.0, 0.0], [0.25, 0.0, 0.05]]), tolerances.MOTION, "the compensated body")
    assert_ratio(state.body_twist[0, 1, 2], -G * 0.5, tolerances.MOTION, "the other one")


@pytest.mark.anysim_overlaps
@needs(C.DYNAMICS, C.SOLVER_SETTINGS)
def test_depenetration_speed_is_per_body(build):
    """A body that begins 5 cm deep in the ground comes out no faster than its own setting says, and gets out."""
    s = Sketch("deep")
    s.ground()
    speeds = (0.2, 1.0)
    for i in range(2):
        s.free(f"box{i}", Box((0.1, 0.1, 0.1)), (float(i), 0.0, 0.05))
    world = s.world()
    bodies = tuple(
        replace(body, solver=Solver(depenetration_speed=v)) for body, v in zip(world.bodies, speeds, strict=True)
    )
    engine = build(replace(world, bodies=bodies))
    fastest, height = np.zeros(2), engine.get_state().body_pose[0, :, 2]
    for _ in range(400):  # by places: some solvers take such a motion off the velocity again
        engine.step()
        before, height = height, engine.get_state().body_pose[0, :, 2]
        fastest = np.maximum(fastest, (height - before) / world.physics.dt)
    for i, speed in enumerate(speeds):
        assert_ratio(fastest[i], speed, 0.25, f"the fastest that a body left the ground whose setting is {speed}")
    assert_close(engine.get_state().body_pose[0, :, 2], 0.1, 2 * tolerances.REST_HEIGHT, "heights at last")


@needs(C.VARYING_ENTITIES)
def test_what_the_lifecycle_says_of_leaving_is_so(build, engine_class):
    """P1 deletes what leaves: `handles` counts less of it. P2 keeps it: they count the same."""
    engine = build(varied(engine_class.capabilities))
    counts: list[int] = []
    for names in (FULL, BARE, FULL):
        engine.reset(present=having(engine.world, *names))
        counts.append(sum(engine.handles().values()))
    full, bare, again = counts
    assert full == again, "what left and came back is counted twice"
    if engine_class.lifecycle is Lifecycle.P1:
        assert bare < full, f"{engine_class.name} is P1, but {bare} handles are left of {full} when entities leave"
    else:
        assert bare == full, f"{engine_class.name} is {engine_class.lifecycle}, but of {full} handles {bare} are left"


# ---------------------------------------------------------------------- light

SUN = Light("sun", (0.6, 0.0, -0.8), None, (1.0, 1.0, 1.0), 0.6)
CHANNELS = ("rgb", "segmentation")


def _studio(*lights: Light, shadows: bool = False) -> World:
    """A cube half a metre above a large slab, seen from straight above; each is an entity of its own."""
    s = Sketch("studio", gravity=worlds.WEIGHTLESS)
    s.fixed("slab", Box((2.0, 2.0, 0.05)), (0.0, 0.0, -0.05), collides=False)
    s.fixed("cube", Box((0.2, 0.2, 0.2)), (0.0, 0.0, 0.5), collides=False)
    down = tuple(float(v) for v in P.look_at(np.array([0.0, 0.0, 4.0]), np.zeros(3)))
    s.cameras.append(Camera("above", -1, (0.0, 0.0, 4.0), down, 45.0, 96, 96, ("rgb",)))  # pyright: ignore[reportArgumentType]
    world = s.world()
    grey = tuple(replace(geom, color=(0.6, 0.6, 0.6, 1.0)) for geom in world.geoms)
    return replace(world, geoms=grey, lights=lights, scenery=Scenery((0.0, 0.0, 0.0), (0.2, 0.2, 0.2), shadows))


def _seen(engine: SimEngine) -> Array:
    """(H, W) brightness from 0 to 255."""
    return engine.render("above")["rgb"][0].astype(float).mean(axis=-1)


def _brightness(build, *lights: Light, shadows: bool = False) -> Array:
    return _seen(build(_studio(*lights, shadows=shadows)))


@needs(C.RENDER_RGB, C.RENDER_SHADOWS)
def test_things_cast_shadows_away_from_the_light(build):
    """Where the sun shines along +x and down, a floating cube darkens the slab on its +x side and nowhere else."""
    lit, shaded = _brightness(build, SUN), _brightness(build, SUN, shadows=True)
    darker = lit - shaded
    # the image's columns are 3.3 m over 96 pixels, up to the direction of the camera's own axes
    shadow = _region(darker, 0.45)
    for name, side in (("opposite", _region(darker, -0.45)), ("corner", float(darker[4:10, 4:10].mean()))):
        assert shadow > side + 4.0, f"the shadow takes {shadow:.1f} of 255, the {name} side {side:.1f}"


def _region(image: Array, x: float) -> float:
    """The mean of the pixels about a point of the slab on the x axis [m]."""
    focal = 48 / np.tan(np.radians(45.0) / 2)
    forward = P.look_at(np.array([0.0, 0.0, 4.0]), np.zeros(3))
    place = P.rotate_inverse(forward, np.array([x, 0.0, -4.0]))
    column, row = 48 + focal * place[0] / place[2], 48 + focal * place[1] / place[2]
    return float(image[int(row) - 2 : int(row) + 3, int(column) - 2 : int(column) + 3].mean())


@needs(C.RENDER_RGB, C.RENDER_LIGHTS)
def test_every_light_adds(build):
    """A second and a third light make the slab brighter, each."""
    down = replace(SUN, name="down", direction=(0.0, 0.0, -1.0), intensity=0.3)
    other = replace(down, name="other", direction=(0.0, 0.6, -0.8))
    one, two, three = (
        _region(_brightness(build, *lights), 1.0) for lights in ((SUN,), (SUN, down), (SUN, down, other))
    )
    assert two > one + 4.0, f"with a second light {two:.1f} of 255, without {one:.1f}"
    assert three > two + 4.0, f"with a third light {three:.1f} of 255, without {two:.1f}"


@needs(C.RENDER_RGB, C.RENDER_LIGHTS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_lamp_shines_from_its_place(build, side):
    """A cube beside a lamp is brighter on the faces that look at the lamp, wherever that stands."""
    lamp = Light("lamp", (-side, 0.0, 0.0), (1.5 * side, 0.0, 0.0), (1.0, 1.0, 1.0), 0.8)
    s = Sketch("lamp", gravity=worlds.WEIGHTLESS)
    s.fixed("ball", Sphere(0.4), (0.0, 0.0, 0.0), collides=False)
    away = P.look_at(np.array([0.0, -3.0, 0.0]), np.zeros(3))
    turn = tuple(float(v) for v in away)
    s.cameras.append(Camera("above", -1, (0.0, -3.0, 0.0), turn, 30.0, 96, 96, ("rgb",)))  # pyright: ignore[reportArgumentType]
    world = replace(s.world(), lights=(lamp,), scenery=Scenery((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), False))
    image = _seen(build(world))
    focal = 48 / np.tan(np.radians(30.0) / 2)
    places = [P.rotate_inverse(away, np.array([0.3 * x * side, 2.75, 0.0])) for x in (1.0, -1.0)]
    near, far = (image[48, int(48 + focal * place[0] / place[2])] for place in places)
    assert near > far + 10.0, f"towards the lamp {near:.0f} of 255, away from it {far:.0f}"
