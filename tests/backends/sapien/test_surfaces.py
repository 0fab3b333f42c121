"""The pair rule and the exclusions in PhysX: slides, bounces, overlaps, worlds that its filters cannot tell apart."""

import numpy as np
import pytest

from anysim.errors import CapabilityError, EngineError
from anysim.model.world import Box, JointType, Sphere, Surface
from anysim.testing.sketch import Sketch, inertial
from anysim.testing.varying import having, with_slots
from anysim_sapien.engine import SapienEngine
from anysim_sharded.engine import sharded


@pytest.mark.parametrize("frictions", [(0.2, 0.6, 0.4), (0.7, 0.0, 0.0)])
def test_a_slide_has_the_larger_friction(make, frictions):
    """Three boxes with their own frictions slide on ground with another one: each pair has its own value."""
    s = Sketch("slide")
    s.ground(Surface(friction=0.3))
    for i, friction in enumerate(frictions):
        s.free(f"box{i}", Box((0.2, 0.2, 0.05)), (0.0, float(i), 0.05), surface=Surface(friction=friction))
    engine = make(s.world())
    engine.step(50)
    engine.set_body_state(twist=np.tile([2.0, 0.0, 0.0, 0.0, 0.0, 0.0], (1, 3, 1)))
    engine.step(100)
    lost = 2.0 - engine.get_state().body_twist[0, :, 0]
    assert lost == pytest.approx([max(f, 0.3) * 9.81 * 0.2 for f in frictions], rel=0.02)


def test_parents_and_children_never_collide(make):
    """Overlapping neighbours of a chain stay where they are; a link two further on is pushed out."""
    s = Sketch("overlap", gravity=(0.0, 0.0, 0.0))
    base, part = s.robot("overlap"), inertial(Sphere(0.1), 1.0)
    link = base
    for i in range(2):
        link = s.link(f"link{i}", link, JointType.PRISMATIC, (1.0, 0.0, 0.0), part, position=(0.05, 0.0, 0.0))
        s.shape(link, Sphere(0.1))
    s.shape(base, Sphere(0.02))
    engine = make(s.world())
    engine.step(100)
    position = engine.get_state().joint_pos[0]
    assert position[1] + position[0] + 0.1 >= 0.118, "the second link overlaps the base, which is not its parent"


def test_friction_of_bouncing_pairs(make):
    """Restitution of one and friction of the other geom: a pair whose value is neither's own."""
    s = Sketch("mixed")
    s.ground(Surface(friction=0.9))
    s.free("ball", Sphere(0.1), (0.0, 0.0, 0.6), surface=Surface(friction=0.1, restitution=0.8))
    engine = make(s.world())
    touches = {copy.touch for copies in engine._envs.scenes[0].copies.values() for copy in copies}
    assert touches == {(0.9, 0.8)}


@pytest.mark.parametrize("dt", [0.0005, 0.002])
@pytest.mark.parametrize("height", [0.3, 0.4, 0.5, 0.51, 0.52])
def test_a_bounce_does_not_depend_on_where_the_steps_fall(make, dt, height):
    """Wherever between two steps the impact falls, a ball leaves with e times its speed (PhysX can lose a fifth)."""
    s = Sketch("bounce", dt)
    s.ground()
    s.free("ball", Sphere(0.05), (0.0, 0.0, 0.05 + height), surface=Surface(restitution=0.9))
    engine = make(s.world())
    speeds = []
    for _ in range(round(0.6 / dt)):
        engine.step()
        speeds.append(float(engine.get_state().body_twist[0, 0, 2]))
    assert max(speeds) / -min(speeds) == pytest.approx(0.9, abs=0.01)


def test_bouncy_things_come_to_rest(make):
    """Contacts that are prepared late still carry: boxes that bounce stack and lie still."""
    s = Sketch("bouncy_stack")
    s.ground()
    for i in range(3):
        s.free(f"box{i}", Box((0.05, 0.05, 0.05)), (0.0, 0.0, 0.05 + 0.1 * i), surface=Surface(restitution=0.5))
    engine = make(s.world())
    engine.step(1000)
    state = engine.get_state()
    assert np.abs(state.body_twist).max() < 0.01
    assert state.body_pose[0, 2, 2] == pytest.approx(0.25, abs=2e-3)
    assert np.abs(state.body_pose[0, :, :2]).max() < 2e-3


def test_worlds_that_filters_cannot_tell_apart_are_refused_before_the_build():
    """Too many surfaces: a CapabilityError by name, in `check` as well, and nothing was built."""
    s = Sketch("colourful")
    for i in range(40):
        s.free(f"b{i}", Sphere(0.1), (float(i), 0.0, 0.1), surface=Surface(friction=0.01 * i))
    world = s.world()
    (reason,) = SapienEngine.refusals(world, None)
    assert "the 40 different surfaces" in reason
    engine = SapienEngine()
    with pytest.raises(CapabilityError, match="sapien cannot run 'colourful': the 40 different surfaces"):
        engine.create_world(world)
    assert not hasattr(engine, "_scenes")
    engine.destroy()


def test_what_is_never_there_at_once_may_have_any_surfaces():
    """Forty surfaces do not fit at once, one of forty does; nor do too many ways to choose, which are not tried."""
    s = Sketch("colourful")
    for i in range(40):
        s.free(f"b{i}", Sphere(0.1), (float(i), 0.0, 0.1), surface=Surface(friction=0.01 * i))
    names = tuple(f"b{i}" for i in range(40))
    one = with_slots(s.world(), {"one": names})
    assert not SapienEngine.refusals(one, None)
    with SapienEngine().create_world(one) as engine:
        engine.reset(present=having(one, "b39"))
        engine.step()
        assert engine.get_parameters("geom.friction")[0, 39] == pytest.approx(0.39)
    (reason,) = SapienEngine.refusals(with_slots(s.world(), {"first": names[:20], "second": names[20:]}), None)
    assert "its 400 combinations of entities are too many to try one by one" in reason
    (reason,) = SapienEngine.refusals(with_slots(s.world(), {name: (name,) for name in names}), None)
    assert "the 40 different surfaces" in reason


@pytest.mark.parametrize("shards", [0, 2])
def test_a_reset_that_cannot_be_built_leaves_all_as_it_was(shards):
    """Coefficients of what is absent may ask for too much when it comes: the reset says so, and nothing changes."""
    s = Sketch("colourful")
    for i in range(40):
        s.free(f"b{i}", Sphere(0.1), (float(i), 0.0, 0.1))
    world = with_slots(s.world(), {f"b{i}": (f"b{i}",) for i in range(1, 40)})
    engine_class = sharded(SapienEngine, shards) if shards else SapienEngine
    with engine_class().create_world(world, 2) as engine:
        engine.reset(present=having(world).repeat(2, axis=0))
        engine.set_parameters("geom.friction", 0.01 * np.arange(1, 41), [1])
        engine.step(3)
        before = engine.get_state().body_pose
        with pytest.raises(EngineError, match="the 40 different surfaces"):
            engine.reset(present=np.ones((2, 40), dtype=bool))
        assert (engine.presence == having(world)).all()
        assert (engine.get_state().body_pose == before).all()
        engine.step()
        assert not engine.get_state().fault.any()
