"""The pair rule and the exclusions, as a library's filter sees the bits: every pair of geoms once, with its value."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import EngineError
from anysim.model.world import Body, BodyKind, JointType, Sphere, Surface, World
from anysim.testing.sketch import Sketch, inertial
from anysim_mechanics.collision_groups import copies_of
from anysim_mechanics.exclusion_groups import Group, apart_of
from anysim_mechanics.layout import Layout
from anysim_mechanics.meeting import Meeting


def rule(a, b):
    """The pair rule of the conventions, by itself."""
    if a.priority != b.priority:
        friction = a.friction if a.priority > b.priority else b.friction
    else:
        friction = max(a.friction, b.friction)
    return friction, max(a.restitution, b.restitution)


def meetings(first, second):
    """The values at which shapes of two geoms collide, by the filter's rule."""
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


def _world(count, pairs, chained=False):
    bodies = [
        Body(f"b{i}", BodyKind.LINK if chained and i else BodyKind.FREE, i - 1 if chained else -1) for i in range(count)
    ]
    return World(bodies=tuple(bodies), excluded_pairs=frozenset(pairs))


@pytest.mark.parametrize("seed", range(20))
def test_exclusions_are_what_they_say(seed):
    """Random exclusions: the filter keeps exactly those pairs apart, and may keep parents and children apart."""
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
