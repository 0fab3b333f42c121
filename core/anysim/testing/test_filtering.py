"""Collision filters: excluded pairs of every kind, self-collision, and that everything else collides."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from anysim.conventions import WORLD
from anysim.engine.capability import Capability as C
from anysim.model.world import Box, Capsule, Geom, JointType, Sphere
from anysim.testing import tolerances
from anysim.testing.compare import assert_close
from anysim.testing.fixtures import needs
from anysim.testing.sketch import Sketch, inertial

pytestmark = needs(C.DYNAMICS, C.CONTACTS_STATIC, C.CONTACTS_MOVING)
RADIUS = 0.05


def _landings():
    """Balls in pairs above a table, a link of a robot, and the ground; the second of each pair is to pass."""
    s = Sketch("landings")
    s.ground()
    table = s.fixed("table", Box((0.3, 0.3, 0.05)), (0.0, 0.0, 0.45))
    arm = s.robot("arm", (2.0, 0.0, 0.45))
    paddle = s.link(
        "paddle",
        arm,
        JointType.PRISMATIC,
        (0.0, 0.0, 1.0),
        inertial(Box((0.3, 0.3, 0.05)), 5.0),
        gravity_compensation=True,
    )
    s.shape(paddle, Box((0.3, 0.3, 0.05)))
    s.drive(paddle, kp=50000.0, kd=2000.0)
    balls = {}
    for name, x, height in (("table", 0.0, 0.56), ("paddle", 2.0, 0.56), ("ground", 4.0, 0.06)):
        for kind, y in (("stays", -0.15), ("passes", 0.15)):
            balls[name, kind] = s.free(f"{name}_{kind}", Sphere(RADIUS), (x, y, height), 0.2)
    passes = {
        (table, balls["table", "passes"]),
        (paddle, balls["paddle", "passes"]),
        (WORLD, balls["ground", "passes"]),
    }
    return replace(s.world(), excluded_pairs=frozenset(passes)), balls


def test_excluded_things_pass_and_the_others_land(build):
    """A ball goes through the table, the link or the ground it is excluded with; its twin lands there."""
    world, balls = _landings()
    engine = build(world, 2)
    engine.step(600)
    height = engine.get_state().body_pose[1, :, 2]
    for name, wanted in (("table", 0.55), ("paddle", 0.55), ("ground", 0.05)):
        assert_close(height[balls[name, "stays"]], wanted, 2 * tolerances.REST_HEIGHT, f"ball on the {name}")
    for name in ("table", "paddle"):
        assert_close(height[balls[name, "passes"]], RADIUS, 2 * tolerances.REST_HEIGHT, f"ball that passed the {name}")
    assert height[balls["ground", "passes"]] < -1.0, "the ball excluded from the ground lies on it"


@pytest.mark.parametrize("count", [2, 7], ids=["two", "seven"])
def test_groups_pass_through_each_other(build, count):
    """Every tool passes every part; tools meet tools, parts meet parts, and both meet the ground."""
    s = Sketch("groups", gravity=(0.0, 0.0, -2.0))
    s.ground()
    groups = []
    for name, x in (("tool", 0.0), ("part", 4.0)):
        groups.append([s.free(f"{name}{i}", Sphere(RADIUS), (x + 0.4 * i, 0.0, RADIUS)) for i in range(count)])
    tools, parts = groups
    engine = build(replace(s.world(), excluded_pairs=frozenset(product(tools, parts))))
    pose = np.array(engine.get_state().body_pose)
    # each part lies in its tool
    pose[0, parts, :3] = pose[0, tools, :3] + [0.0, 0.02, 0.0]
    engine.set_body_state(pose=pose)
    engine.step(200)
    place = engine.get_state().body_pose[0, :, :3]
    assert_close(place[parts] - place[tools], np.array([0.0, 0.02, 0.0]), 2e-3, "parts in their tools")
    assert_close(place[:, 2], RADIUS, 2 * tolerances.REST_HEIGHT, "heights")
    for group in groups:
        first, second = group[:2]
        here = np.array(engine.get_state().body_pose)
        here[0, second, :3] = here[0, first, :3] + [2 * RADIUS + 0.01, 0.0, 0.0]
        engine.set_body_state(pose=here)
        twist = np.zeros((1, 2 * count, 6))
        twist[0, first, 0] = 1.0
        engine.set_body_state(twist=twist)
        engine.step(100)
        got = engine.get_state().body_pose[0, [first, second], 0]
        assert got[1] > got[0] + 1.9 * RADIUS, "two of one group pass through each other"


def _arm():
    """Three links in a row that fold into a triangle about y, and further if the last may pass the first."""
    s = Sketch("fold", gravity=(0.0, 0.0, 0.0))
    link, links = s.robot("arm"), []
    bar = inertial(Capsule(0.03, 0.12), 0.5, (0.15, 0.0, 0.0))
    for i in range(3):
        link = s.link(
            f"link{i}",
            link,
            JointType.REVOLUTE,
            (0.0, -1.0, 0.0),
            bar,
            position=(0.3 if i else 0.0, 0.0, 0.0),
            armature=0.01,
        )
        turn = (0.0, float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)))  # the capsule's z along the link's x
        s.geoms.append(Geom(f"bar{i}", link, Capsule(0.03, 0.12), (0.15, 0.0, 0.0), turn))
        links.append(link)
    for link, stiffness in zip(links, (400.0, 20.0, 20.0), strict=True):
        s.drive(link, kp=stiffness, kd=0.1 * stiffness)
    return s.world(), links


@pytest.mark.parametrize("on", [True, False], ids=["on", "off"])
def test_self_collision(build, on):
    """An arm that folds onto itself is stopped by its own first link, unless its links do not collide."""
    world, links = _arm()
    engine = build(world if on else replace(world, excluded_pairs=frozenset({(links[0], links[2])})))
    fold = 2.5
    engine.set_control(position=[[0.0, fold, fold]])
    engine.step(1000)
    position = engine.get_state().joint_pos[0]
    if on:
        assert position[1:].max() < fold - 0.1, "the arm passed through itself"
    else:
        assert_close(position, np.array([0.0, fold, fold]), 0.02, "folded")


def test_parents_and_children_never_collide(build):
    """Links that overlap at their joint do not push each other away."""
    world, _ = _arm()
    engine = build(world)
    engine.set_control(position=[[0.0, 1.0, -1.0]])
    engine.step(1000)
    assert_close(engine.get_state().joint_pos[0], np.array([0.0, 1.0, -1.0]), tolerances.AT_REST, "joints")
