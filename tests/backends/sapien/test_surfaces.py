"""The pair rule and the exclusions, as PhysX' filter sees the bits: every pair of geoms once, with the rule's value."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import CapabilityError, EngineError
from anysim.model.world import Body, BodyKind, Box, JointType, Sphere, Surface, World
from anysim.testing.sketch import Sketch, inertial
from anysim.testing.varying import having, with_slots
from anysim_mechanics.collision_groups import copies_of
from anysim_mechanics.exclusion_groups import Group, apart_of
from anysim_mechanics.layout import Layout
from anysim_mechanics.meeting import Meeting
from anysim_sapien.engine import SapienEngine
from anysim_sharded.engine import sharded


def rule(a, b):
    """The pair rule of the conventions, by itself."""
    if a.priority != b.priority:
        friction = a.friction if a.priority > b.priority else b.friction
    else:
        friction = max(a.friction, b.friction)
    return friction, max(a.restitution, b.restitution)


def meetings(first, second):
    """The values at which shapes of two geoms collide, by PhysX' rule."""
    return [a.touch for a in first for b in second if (a.kind & b.meets or b.kind & a.meets) and a.touch == b.touch] + [
        "different" for a in first for b in second if (a.kind & b.meets or b.kind & a.meets) and a.touch != b.touch
    ]


@pytest.mark.parametrize("seed", range(30))
def test_every_pair_meets_once_and_by_the_rule(seed):
    """Random surfaces, fixed and movable: pairs of fixed geoms and pairs that may not meet do not collide at all."""
    rng = np.random.default_rng(seed)
    count, kinds = 9, 1 + seed % 5
    kinds_of = [
        Surface(friction=float(f), restitution=float(e), priority=int(p))
        for f, e, p in zip(
            rng.choice([0.0, 0.3, 0.8, 1.0], kinds),
            rng.choice([0.0, 0.0, 0.5], kinds),
            rng.choice([0, 0, 1], kinds),
            strict=True,
        )
    ]
    surfaces = [kinds_of[i] for i in rng.integers(0, kinds, count)]
    fixed = rng.random(count) < 0.4
    may = rng.random((count, count)) < 0.9
    may = may & may.T & ~(fixed[:, None] & fixed[None, :])
    copies = copies_of(surfaces, np.array([s.friction for s in surfaces]), fixed, may)
    assert all(copies), "a geom without any shape is not hit by rays"
    for i in range(count):
        for k in range(i):
            met = meetings(copies[i], copies[k])
            if fixed[i] and fixed[k]:
                assert met == []
            elif may[i, k]:
                assert met == [rule(surfaces[i], surfaces[k])]
            else:
                assert len(met) <= 1


def test_equal_surfaces_need_one_shape_each():
    """The everyday world costs nothing: shapes multiply only with different surfaces."""
    copies = copies_of([Surface()] * 5, np.full(5, 0.8), np.array([True] + [False] * 4), ~np.eye(5, dtype=bool))
    assert [len(shapes) for shapes in copies] == [1] * 5


def test_too_many_surfaces_are_refused():
    """The error says how many and what to do."""
    surfaces = [Surface(friction=0.01 * i) for i in range(40)]
    with pytest.raises(EngineError, match="the 40 different surfaces"):
        copies_of(surfaces, np.array([s.friction for s in surfaces]), np.zeros(40, bool), ~np.eye(40, dtype=bool))


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


def _world(count, pairs, chained=False):
    bodies = [
        Body(f"b{i}", BodyKind.LINK if chained and i else BodyKind.FREE, i - 1 if chained else -1) for i in range(count)
    ]
    return World(bodies=tuple(bodies), excluded_pairs=frozenset(pairs))


@pytest.mark.parametrize("seed", range(20))
def test_exclusions_are_what_they_say(seed):
    """Random exclusions: PhysX' filter keeps exactly those pairs apart, and may keep parents and children apart."""
    rng = np.random.default_rng(seed)
    count, chained = 7, bool(seed % 2)
    pairs = {(i, k) for k in range(count) for i in range(k) if rng.random() < 0.35}
    groups = apart_of(_world(count, pairs, chained)).groups
    for k in range(count):
        for i in range(k):
            a, b = groups.get(i, Group()), groups.get(k, Group())
            apart = bool(a.bits & b.bits) and a.number == b.number
            if not (chained and k == i + 1):
                assert apart == ((i, k) in pairs), (i, k)


def test_a_robot_without_self_collision_needs_one_set():
    """All pairs but neighbours are excluded: with the neighbours, which never collide, that is one set."""
    pairs = {(i, k) for k in range(12) for i in range(k) if k > i + 1}
    assert {group.bits for group in apart_of(_world(12, pairs, chained=True)).groups.values()} == {1}


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


@pytest.mark.parametrize(("tools", "parts"), [(6, 6), (20, 3)])
def test_groups_with_more_pairs_than_bits(tools, parts):
    """Each tool passes each part: filter words have 32 bits, so the surfaces' groups keep these apart."""
    s = Sketch("groups")
    s.ground()
    hand = s.robot("hand")
    for i in range(tools):
        s.shape(s.link(f"tool{i}", hand, JointType.PRISMATIC, (1.0, 0.0, 0.0), inertial(Sphere(0.1), 1.0)), Sphere(0.1))
    for i in range(parts):
        s.free(f"part{i}", Sphere(0.1), (float(i), 0.0, 0.1), surface=Surface(friction=0.5 + 0.1 * (i % 2)))
    world = s.world()
    apart = {(a, b) for a in range(1, tools + 1) for b in range(tools + 1, tools + parts + 1)}
    meeting = Meeting(replace(world, excluded_pairs=frozenset(apart)), Layout.of(world))
    assert meeting.apart.between
    copies = meeting.copies(np.array([geom.surface.friction for geom in world.geoms]))
    groups = meeting.apart.groups
    for k, second in enumerate(world.geoms):
        for i, first in enumerate(world.geoms[:k]):
            a, b = groups.get(first.body, Group()), groups.get(second.body, Group())
            filtered = bool(a.bits & b.bits) and a.number == b.number
            met = [] if filtered else meetings(copies[i], copies[k])
            pair = (min(first.body, second.body), max(first.body, second.body))
            assert met == ([] if pair in apart else [rule(first.surface, second.surface)])
