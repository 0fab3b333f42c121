"""Affordances: every builder of things to handle declares them, and a World gives them back with indices."""

from dataclasses import replace
from importlib.metadata import entry_points

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.assets.procedural import build
from anysim.compile.edit import without_entity
from anysim.errors import NameLookupError, SpecError
from anysim.math import pose as P
from anysim.model.affordance_lookup import affordances_of, find_affordance
from anysim.model.affordances import AffordanceKind
from anysim.model.frames import find_frame
from anysim.model.hash import world_hash
from anysim.model.world import Box, Capsule, World

OBJECTS = {
    "first": {"source": {"box": [0.04, 0.06, 0.1]}},
    "cabinet": {"source": "procedural:cabinet", "fixed": True},
    "chest": {"source": {"procedural": "hinge_box", "scale": 2.0}, "fixed": True},
    "valve": {"source": "procedural:valve", "fixed": True},
    "tap": {"source": {"procedural": "valve", "params": {"style": "lever"}}, "fixed": True},
    "door": {"source": {"procedural": "door", "params": {"lever": 0.8}}, "fixed": True},
    "ball": {"source": {"sphere": 0.03}},
    "post": {"source": {"cylinder": [0.03, 0.2]}, "fixed": True},
}


@pytest.fixture(scope="module")
def world() -> World:
    return compile_world({"world": {"objects": OBJECTS}})


@pytest.mark.parametrize(
    ("name", "kind", "joint"),
    [
        ("cabinet.drawer_1.handle", AffordanceKind.HANDLE, "cabinet.drawer_1"),
        ("cabinet.door_1.handle", AffordanceKind.HANDLE, "cabinet.door_1"),
        ("chest", AffordanceKind.HANDLE, "chest.lid"),
        ("valve.wheel.handle", AffordanceKind.RIM, "valve.wheel"),
        ("tap.wheel.handle", AffordanceKind.LEVER, "tap.wheel"),
        ("door.lever.handle", AffordanceKind.LEVER, "door.lever"),
    ],
)
def test_builders_declare_what_is_taken_hold_of(world: World, name: str, kind: AffordanceKind, joint: str) -> None:
    found = find_affordance(world, name)
    assert found.spec.kind is kind
    assert world.joints[found.joint].name == joint
    assert found.geoms
    assert {world.geoms[g].body for g in found.geoms} == {world.joints[found.joint].body} == {found.frame.body}


EMITTED = {
    "bowl": {"rim": "rim", "body": "body"},
    "button": {"cap": "button"},
    "cabinet": {"drawer_1.handle": "handle", "door_1.handle": "handle"},
    "cart": {"body.handle": "handle"},
    "device": {"door.handle": "handle", "start": "button"},
    "door": {"leaf.handle": "handle"},
    "faucet": {"lever.handle": "lever"},
    "gear": {"hole": "hole", "body": "body"},
    "gear_stand": {"shaft": "tip", "left": "rim", "right": "rim"},
    "hinge_box": {"lid.handle": "handle"},
    "hole_block": {"mouth": "hole", "body": "body"},
    "hook": {"grip": "handle", "inner": "hook", "body": "body"},
    "jar": {"cap": "body"},
    "mug": {"handle": "handle", "rim": "rim", "body": "body"},
    "peg": {"tip": "tip", "body": "body"},
    "plug": {"tip": "tip", "body": "body"},
    "rack": {},
    "rocker_switch": {"rocker.on": "button", "rocker.off": "button"},
    "rope": {"first": "handle", "last": "handle"},
    "side_hole": {"mouth": "hole", "body": "body"},
    "socket": {"mouth": "hole", "body": "body"},
    "spoon": {"body": "body"},
    "tee": {"body": "body"},
    "tray": {"rim": "rim", "body": "body"},
    "valve": {"wheel.handle": "rim"},
    "vial": {"cap": "body"},
}
ROBOTS = {"ackermann_base", "camera_body", "differential_base", "holonomic_base", "parallel_gripper"}
"""Builders of what moves and holds others."""


def test_every_builder_of_ours_is_in_the_table() -> None:
    ours = {entry.name for entry in entry_points(group="anysim.assets") if entry.value.startswith("anysim_assets.")}
    assert ours == EMITTED.keys() | ROBOTS
    assert {kind for kinds in EMITTED.values() for kind in kinds.values()} == {*AffordanceKind}


@pytest.mark.parametrize("builder", EMITTED)
def test_every_builder_emits_affordances_that_are_found_in_a_world(builder: str) -> None:
    world = compile_world({"world": {"objects": {"thing": {"source": f"procedural:{builder}"}}}})
    declared = {one.name: one for one in affordances_of(world, 0)}
    assert EMITTED[builder].items() <= {name: str(one.kind) for name, one in declared.items()}.items()
    for name, one in declared.items():
        found = find_affordance(world, f"thing.{name}")
        assert len(found.geoms) == len(one.pieces)
        assert all(world.geoms[g].body == found.frame.body or one.frame == "" for g in found.geoms)
        assert (found.joint >= 0) == bool(one.joint)


def test_a_world_has_the_same_hash_whatever_its_things_afford(world: World) -> None:
    assert any(entity.affordances for entity in world.entities)
    bare = replace(world, entities=tuple(replace(entity, affordances=()) for entity in world.entities))
    assert world_hash(bare) == world_hash(world)


def test_a_peg_goes_into_the_hole_that_its_block_declares() -> None:
    for builder, depth in (("hole_block", 0.05), ("side_hole", 0.08)):
        world = compile_world({"world": {"objects": {"block": {"source": f"procedural:{builder}"}}}})
        hole, end = find_affordance(world, "block.mouth"), find_frame(world, "block.hole")
        mouth = P.pose(hole.frame.position, hole.frame.quaternion)
        inside = P.compose(mouth, np.array([0.0, 0.0, -hole.spec.depth, 0.0, 0.0, 0.0, 1.0]))
        assert hole.spec.depth == depth
        np.testing.assert_allclose(inside[:3], end.position, atol=1e-12)


def test_the_frame_of_a_bar_has_its_z_along_it(world: World) -> None:
    found = find_affordance(world, "cabinet.drawer_2.handle")
    (bar,) = found.geoms
    assert isinstance(world.geoms[bar].shape, Capsule)
    np.testing.assert_allclose(world.geoms[bar].position, found.frame.position)
    np.testing.assert_allclose(np.abs(np.dot(world.geoms[bar].quaternion, found.frame.quaternion)), 1.0)


def test_a_lever_is_pressed_down_and_held_where_the_handle_of_the_leaf_is(world: World) -> None:
    held, leaf = find_affordance(world, "door.lever.handle"), find_frame(world, "door.leaf.handle")
    lever = world.joints[held.joint]
    assert (lever.lower, lever.upper) == (0.0, 0.8)
    place = np.array(world.bodies[lever.body].position) + held.frame.position
    np.testing.assert_allclose(place, leaf.position)
    np.testing.assert_allclose(held.frame.quaternion, leaf.quaternion)
    by = P.from_axis_angle(np.array(lever.axis), np.array(lever.upper))
    assert P.rotate(by, np.array(held.frame.position))[2] == pytest.approx(-0.08 * np.sin(0.8))
    out = P.rotate(np.array(held.frame.quaternion), np.array(held.spec.approach[0]))
    np.testing.assert_allclose(out, [-1.0, 0.0, 0.0], atol=1e-12)  # from the front, as the leaf's x is out of it


def test_plain_free_shapes_are_taken_hold_of_as_a_whole(world: World) -> None:
    found = find_affordance(world, "ball")
    assert found.spec.name == "body"
    assert [world.geoms[g].name for g in found.geoms] == ["ball.shape"]
    assert affordances_of(world, world.entity_numbers["post"]) == ()


def test_names_that_do_not_exist_are_told_with_those_that_do(world: World) -> None:
    with pytest.raises(NameLookupError, match=r"cabinet.*drawer_9.*drawer_1\.handle, drawer_2\.handle"):
        find_affordance(world, "cabinet.drawer_9.handle")
    with pytest.raises(NameLookupError, match="'cabinet' has 4 affordances; name one"):
        find_affordance(world, "cabinet")
    with pytest.raises(NameLookupError, match=r"'post' has no affordance 'body' .*its asset declares them"):
        find_affordance(world, "post.body")
    with pytest.raises(NameLookupError, match=r"'cabin' is no entity.*cabinet"):
        find_affordance(world, "cabin.handle")


def test_they_survive_the_removal_of_what_stands_before_them(world: World) -> None:
    less = without_entity(world, "first")
    for name in ("cabinet.door_1.handle", "ball.body"):
        before, after = find_affordance(world, name), find_affordance(less, name)
        assert [world.geoms[g].name for g in before.geoms] == [less.geoms[g].name for g in after.geoms]
        assert world.bodies[before.frame.body].name == less.bodies[after.frame.body].name


def test_a_mug_is_held_by_its_handle_its_rim_or_as_a_whole() -> None:
    world = compile_world({"world": {"objects": {"mug": {"source": "procedural:mug"}}}})
    assert [one.name for one in affordances_of(world, 0)] == ["handle", "rim", "body"]
    rim, handle = find_affordance(world, "mug.rim"), find_affordance(world, "mug.handle")
    assert len(rim.geoms) == 16
    assert {g for g in range(len(world.geoms)) if world.geoms[g].name == "mug.base.bar"} == set(handle.geoms)
    assert handle.frame.position[0] > 0.038
    # a ring: every direction from the axis meets a board
    for angle in np.linspace(0, 2 * np.pi, 100):
        assert any(
            np.cos(angle) * world.geoms[g].position[0] + np.sin(angle) * world.geoms[g].position[1] > 0.035
            for g in rim.geoms
        )
    # 16 boards of a ring 4 mm thick, a bottom of 6 mm and a handle, of ceramics
    ring = np.pi * (0.038**2 - 0.034**2) * 0.084
    bottom = np.pi * 0.038**2 * 0.006
    assert world.bodies[0].inertial.mass == pytest.approx(2400 * (ring + bottom), rel=0.15)


@pytest.mark.parametrize(
    ("params", "path"),
    [({"wall": 0.03}, "wall"), ({"bottom": 0.06}, "bottom"), ({"handle_radius": 0.02}, "handle_radius")],
)
def test_a_mug_that_does_not_fit_is_refused(params: dict[str, float], path: str) -> None:
    with pytest.raises(SpecError, match=rf"params\.{path}: a "):
        build("mug", params)


def test_a_bowl_is_a_hollow_that_opens_upwards_and_is_held_by_its_rim() -> None:
    world = compile_world({"world": {"objects": {"bowl": {"source": "procedural:bowl"}}}})
    assert [one.name for one in affordances_of(world, 0)] == ["rim", "body"]
    rim = find_affordance(world, "bowl.rim")
    assert len(rim.geoms) == 16
    assert rim.frame.position == pytest.approx((0.0, 0.0, 0.06))
    inner = []
    for number in rim.geoms:
        board = world.geoms[number]
        assert isinstance(board.shape, Box)
        half = board.shape.half_size
        # the ends of the middle of its inner side: at the edge of the floor, and at the rim
        ends = [P.rotate(np.array(board.quaternion), np.array([-half[0], 0.0, z * half[2]])) for z in (-1.0, 1.0)]
        inner.append([np.array(board.position) + end for end in ends])
        lean = P.rotate(np.array(board.quaternion), np.array([0.0, 0.0, 1.0]))
        assert np.dot(lean[:2], board.position[:2]) > 0.0, "it leans outwards"
    low, high = np.moveaxis(np.array(inner), 1, 0)
    assert np.hypot(low[:, 0], low[:, 1]) == pytest.approx(0.04)
    assert np.hypot(high[:, 0], high[:, 1]) == pytest.approx(0.08)
    assert low[:, 2] == pytest.approx(0.005)
    assert high[:, 2] == pytest.approx(0.06)
    heading = np.sort(np.arctan2(high[:, 1], high[:, 0]))
    assert np.diff(heading) == pytest.approx(np.pi / 8), "all around"
    widths = [world.geoms[g].shape for g in rim.geoms]
    assert all(isinstance(one, Box) and one.half_size[1] >= 0.08 * np.tan(np.pi / 16) - 1e-12 for one in widths)


@pytest.mark.parametrize(("params", "path"), [({"foot": 0.08}, "foot"), ({"wall": 0.03}, "wall")])
def test_a_bowl_that_does_not_fit_is_refused(params: dict[str, float], path: str) -> None:
    with pytest.raises(SpecError, match=rf"params\.{path}: "):
        build("bowl", params)
