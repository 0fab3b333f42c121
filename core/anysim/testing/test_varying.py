"""Entities that come and go at resets: what is absent is as if it were not there, and leaves nothing behind."""

import numpy as np
import pytest

from anysim.conventions import WORLD
from anysim.engine.capability import Capability as C
from anysim.engine.presence import Lifecycle
from anysim.errors import EngineError
from anysim.testing import tolerances
from anysim.testing.compare import assert_close, assert_same, play, read, tape
from anysim.testing.fixtures import needs
from anysim.testing.varying import BARE, EYE, FULL, having, random_presence, reduced, shared_bodies, varied

varies = needs(C.VARYING_ENTITIES)
IDENTITY = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def _engine(build, engine_class, num_envs=2, cameras=False):
    return build(varied(engine_class.capabilities, cameras), num_envs)


def _other(engine):
    """Rows of another presence than `FULL` and none."""
    return having(engine.world, "mug~2", "chest~1", "lid")


def test_the_lifecycle_is_declared(engine_class):
    """An engine that lets entities vary says how they come and go; one that does not is P3."""
    assert isinstance(engine_class.lifecycle, Lifecycle)
    assert (engine_class.lifecycle is not Lifecycle.P3) == (C.VARYING_ENTITIES in engine_class.capabilities)


@varies
def test_a_world_begins_with_the_first_of_each_slot(build, engine_class):
    """After the build every env has the first entity of each slot, and reads like a reset engine."""
    engine = _engine(build, engine_class)
    assert np.array_equal(engine.presence, np.repeat(engine.world.initial_presence[None], 2, axis=0))
    before = read(engine)
    engine.reset()
    assert_same(read(engine), before, "after a reset")


@varies
def test_what_is_absent_reads_as_the_world_frame(build, engine_class):
    """An absent body has the world's pose and no velocity, whatever is written to it; an absent joint its initial."""
    engine = _engine(build, engine_class)
    world = engine.world
    engine.reset([1], present=having(world))
    absent = ~np.array([having(world)[0, e] for e in world.body_entity])
    free = [i for i, b in enumerate(world.bodies) if b.kind == "free"]
    away = np.tile([3.0, 3.0, 3.0, 0.0, 0.0, 0.0, 1.0], (2, len(free), 1))
    away[:, :, 0] += np.arange(len(free))
    engine.set_body_state(away, np.ones((2, len(free), 6)), bodies=free)
    if world.joints:
        engine.set_joint_state([j.initial + 0.01 for j in world.joints], [0.1] * len(world.joints))
    if C.WRENCHES in engine.capabilities:
        engine.apply_wrench(np.ones((2, len(free), 6)), free)
    for moment in ("after writes", "after steps"):
        state = engine.get_state()
        assert (state.body_pose[1, absent] == IDENTITY).all(), moment
        assert not state.body_twist[1, absent].any(), moment
        gone = [i for i, j in enumerate(world.joints) if absent[j.body]]
        assert state.joint_pos[1, gone].tolist() == [world.joints[i].initial for i in gone], moment
        assert not state.joint_vel[1, gone].any()
        assert not state.fault.any()
        engine.step(20)
    there = [i for i, b in enumerate(world.bodies) if b.kind == "free" and not absent[i]]
    assert_close(engine.get_state().body_pose[1, there, 1], 3.0, 2.0, "what is there went where it was put")


@varies
def test_what_comes_back_is_in_its_initial_state(build, engine_class):
    """What is taken in again stands where the World puts it, as after the build, whatever happened before."""
    engine, fresh = _engine(build, engine_class), _engine(build, engine_class)
    wanted = read(fresh)
    play(engine, tape(engine.world, [0, 1], 10))
    engine.reset([0], present=having(engine.world))
    engine.step(5)
    read(engine)  # contact forces too: the box lies on the table
    engine.reset(present=np.repeat(engine.world.initial_presence[None], 2, axis=0))
    assert_same(read(engine), wanted, "after all came back")


@varies
@pytest.mark.parametrize(
    ("row", "message"),
    [
        (("mug~0", "mug~2"), "env 1: 'mug' can be one of mug~0 and mug~2, not several"),
        ("no table", "'table' is in no slot"),
        ("short", "present must be a bool array of shape"),
        ("numbers", "present must be a bool array of shape"),
    ],
    ids=["two-of-a-slot", "without-the-table", "short", "numbers"],
)
def test_rows_that_no_env_can_have_are_refused(build, engine_class, row, message):
    """Two of one slot, or without what is always there, or of another shape: an error, and nothing changes."""
    engine = _engine(build, engine_class)
    play(engine, tape(engine.world, [0, 1], 3))
    before, present = read(engine), engine.presence
    rows = having(engine.world) if isinstance(row, str) else having(engine.world, *row)
    if row == "no table":
        rows[0, [e.name for e in engine.world.entities].index("table")] = False
    rows = rows[:, :-1] if row == "short" else rows.astype(int) if row == "numbers" else rows
    with pytest.raises(EngineError, match=message):
        engine.reset([1], present=rows)
    assert_same(read(engine), before, "after the refusal")
    assert np.array_equal(engine.presence, present)


# ---------------------------------------------------------------------- nothing meets it


@needs(C.VARYING_ENTITIES, C.DYNAMICS, C.CONTACTS_STATIC, C.CONTACTS_MOVING)
def test_what_is_there_moves_as_if_the_rest_were_not_in_the_world(build, engine_class):
    """With the rest absent, and in a world without the rest: the same motion, contacts included."""
    whole = varied(engine_class.capabilities)
    for names in (BARE, FULL, ("mug~2", "chest~1"), ("mug~0",)):
        less = reduced(whole, *names)
        engine, alone = build(whole), build(less)
        engine.reset(present=having(whole, *names))
        ours, theirs = shared_bodies(whole, less)
        if whole.actuators:
            play(engine, tape(whole, [0], 60), 5)
            play(alone, tape(less, [0], 60), 5)
        got, wanted = engine.get_state().body_pose[:, ours], alone.get_state().body_pose[:, theirs]
        assert_close(got, wanted, tolerances.ABSENT, f"poses with {names or 'nothing of the slots'} there")
        assert_close(
            engine.get_state().contact_force[:, 0],
            alone.get_state().contact_force[:, 0],
            tolerances.ABSENT_FORCE,
            "the force on the box",
        )


@needs(C.VARYING_ENTITIES, C.DYNAMICS, C.CONTACTS_STATIC, C.CONTACTS_MOVING, C.CONTACT_POINTS)
def test_nothing_touches_what_is_absent(build, engine_class):
    """What lay on an entity that is absent now falls, and no contact names what is not there."""
    engine = _engine(build, engine_class)
    world = engine.world
    engine.reset([1], present=having(world, "lid"))
    on_table = engine.index.body("box")
    under = [*(i for i, b in enumerate(world.bodies) if b.name.startswith(("mug", "chest", "post")))]
    engine.step(200)
    contacts = engine.contacts()
    named = {0: set(), 1: set()}
    for env, a, b in zip(contacts.env.tolist(), contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True):
        named[env] |= {a, b}
    assert not named[1] & set(under)
    assert {on_table, engine.index.body("lid"), engine.index.body("table")} <= named[1]
    assert engine.index.body("mug~0") in named[0]
    sensors = [s.name for s in world.contact_sensors]
    force = engine.get_state().contact_force
    assert force[0, sensors.index("mug"), 2] > 1.0
    assert not force[1, sensors.index("mug")].any()
    # where the lid's box was nothing is: a body dropped into the place of what is absent falls through it
    mug = engine.index.body("mug~0")
    engine.reset([1], present=having(world, "mug~0"))
    inside = [0.0, 0.6, 0.35, 0.0, 0.0, 0.0, 1.0]
    engine.set_body_state(pose=[[inside]], env_ids=[1], bodies=[mug])
    engine.step(250)
    assert_close(engine.get_state().body_pose[1, mug, 2], 0.05, 0.01, "a ball where a cabinet could be")


@needs(C.VARYING_ENTITIES, C.DYNAMICS, C.CONTACTS_STATIC, C.CONTACTS_MOVING, C.ARTICULATIONS)
def test_what_is_there_carries_and_blocks(build, engine_class):
    """Brought in at a reset, a fixed crate carries and a cabinet's frame blocks, as if they had always been there."""
    engine = _engine(build, engine_class, 3)
    world = engine.world
    mug = engine.index.body("mug~0")
    rows = np.concatenate([having(world, "mug~0", *more) for more in (("chest~1",), ("chest~0",), ())])
    engine.reset(present=rows)
    above = [0.0, 0.6, 0.36, 0.0, 0.0, 0.0, 1.0]
    engine.set_body_state(pose=np.tile(above, (3, 1, 1)), bodies=[mug])
    engine.step(300)
    height = engine.get_state().body_pose[:, mug, 2]
    assert_close(height[0], 0.35, 0.01, "a ball on the crate")
    assert_close(height[1], 0.29, 0.02, "a ball on the drawer of the cabinet")
    assert_close(height[2], 0.05, 0.01, "a ball on the ground")


@needs(C.VARYING_ENTITIES, C.RAYCAST)
def test_no_ray_hits_what_is_absent(build, engine_class):
    """A ray goes through where an absent entity would be, also where all absent ones were built."""
    engine = _engine(build, engine_class)
    world = engine.world
    engine.reset([0], present=having(world, *FULL))
    engine.reset([1], present=having(world))
    down, start = [0.0, 0.0, -1.0], np.array([[-0.1, 0.0, 3.0], [-0.25, 0.15, 3.0], [0.0, 0.75, 3.0], [0.2, 0.1, 3.0]])
    hits = engine.raycast([start] * 2, [[down] * len(start)] * 2)
    ids = {e.name: i + 1 for i, e in enumerate(world.entities)}
    assert hits.entity[0].tolist() == [ids["mug~1"], ids["post"], ids["chest~0"], ids["lid"]]
    floor = 0 if engine.world.geoms[0].body == WORLD else -1
    assert hits.entity[1].tolist() == [ids["table"], ids["table"], floor, ids["box"]]
    # and all around: nothing is parked where something could look
    rng = np.random.default_rng(0)
    around = rng.standard_normal((500, 3))
    away = engine.raycast([np.tile([0.0, 0.0, 5.0], (500, 1))], [around], env_ids=[1])
    gone = {i + 1 for i in np.flatnonzero(~engine.presence[1])}
    assert not gone & set(away.entity.ravel().tolist())


@needs(C.VARYING_ENTITIES, C.RENDER_RGB, C.RENDER_SEGMENTATION, C.RENDER_DEPTH)
def test_no_picture_shows_what_is_absent(build, engine_class):
    """An image of an env shows what is there, and is that of a world without the rest."""
    engine = _engine(build, engine_class, 3, cameras=True)
    world = engine.world
    rows = np.concatenate([having(world, *FULL), having(world), having(world, "mug~0", "chest~1")])
    engine.reset(present=rows)
    channels = ("rgb", "depth", "segmentation")
    images = engine.render("front", channels=channels)
    for env, row in enumerate(rows):
        seen = set(np.unique(images["segmentation"][env]).tolist()) - {0}
        assert seen == {int(i) + 1 for i in np.flatnonzero(row)}, f"what env {env} shows"
    less = reduced(world)
    alone = build(less)
    picture = alone.render("front", channels=channels)
    assert (images["rgb"][1] == picture["rgb"][0]).mean() > 0.999
    assert_close(
        np.nan_to_num(images["depth"][1], posinf=0.0), np.nan_to_num(picture["depth"][0], posinf=0.0), 1e-3, "depth"
    )
    # the camera may look into any direction
    for target in ((0.0, -10.0, 0.9), (0.0, -2.2, 10.0), (10.0, -2.2, 0.0), (-10.0, -2.2, 0.0), (0.0, 0.0, -10.0)):
        _look(engine, target)
        seen = set(np.unique(engine.render("front", env_ids=[1], channels=("segmentation",))["segmentation"]).tolist())
        assert seen <= {0, *(int(i) + 1 for i in np.flatnonzero(rows[1]))}, target


def _look(engine, target):
    from anysim.math import pose as P

    eye = np.array(EYE)
    engine.set_camera_pose("front", np.concatenate([eye, P.look_at(eye, np.array(target))])[None], env_ids=[1])


# ---------------------------------------------------------------------- nothing of it is left


@varies
def test_other_envs_do_not_notice(build, engine_class):
    """A reset that changes which entities are present touches its own rows alone, bit for bit, then and later."""
    engine, calm = _engine(build, engine_class, 3), _engine(build, engine_class, 3)
    targets = tape(engine.world, range(3), 20)
    for e in (engine, calm):
        e.reset([2], present=_other(e))
        play(e, targets[:8])
    before = read(engine, [0, 2])
    engine.reset([1], present=having(engine.world, *FULL))
    assert_same(read(engine, [0, 2]), before, "the others at the reset")
    for e in (engine, calm):
        play(e, targets[8:])
    assert_same(read(engine, [0, 2]), read(calm, [0, 2]), "the others, 24 steps later")


@varies
def test_the_past_leaves_nothing_over(build, engine_class):
    """A, then B, then A again: the run is that of a new engine with A, bit for bit."""
    engine, fresh = _engine(build, engine_class), _engine(build, engine_class)
    world, rng = engine.world, np.random.default_rng(5)
    for _ in range(4):
        engine.reset(present=random_presence(world, rng, 2))
        play(engine, tape(world, [3, 4], 5), 5)
    last = np.concatenate([having(world, *FULL), having(world, "mug~2", "chest~0")])
    for e in (engine, fresh):
        e.reset(present=last)
    assert_same(read(engine), read(fresh), "after the reset")
    for e in (engine, fresh):
        play(e, tape(world, [0, 1], 30), 5)
    assert_same(read(engine), read(fresh), "150 steps later")


@varies
def test_an_env_depends_on_its_own_presence_alone(build, engine_class):
    """Env i has the same trajectory, bit for bit, whatever `num_envs` is and whatever is in the others."""
    few, many = _engine(build, engine_class, 1), _engine(build, engine_class, 4)
    world = few.world
    few.reset(present=having(world, *FULL))
    many.reset(present=np.concatenate([having(world, *FULL), random_presence(world, np.random.default_rng(2), 3)]))
    for e in (few, many):
        play(e, tape(world, range(e.num_envs), 40), 4)
    assert_same(read(many, [0]), read(few), "env 0 among 4 against alone")


@varies
def test_a_reset_without_presence_keeps_it(build, engine_class):
    """A reset that says nothing of presence brings the same entities back to their initial state."""
    engine = _engine(build, engine_class)
    engine.reset([1], present=_other(engine))
    wanted, present = read(engine), engine.presence
    play(engine, tape(engine.world, [0, 1], 10))
    engine.reset()
    assert_same(read(engine), wanted, "after the second reset")
    assert np.array_equal(engine.presence, present)


@varies
def test_many_presences_in_a_row(build, engine_class):
    """Forty random presences, some steps in each: the states are finite, and the last run is that of a new engine."""
    engine, fresh = _engine(build, engine_class, 3), _engine(build, engine_class, 3)
    world, rng = engine.world, np.random.default_rng(7)
    for turn in range(40):
        ids = np.flatnonzero(rng.random(3) < 0.6)
        rows = random_presence(world, rng, len(ids))
        engine.reset(ids, present=rows)
        assert np.array_equal(engine.presence[ids], rows)
        engine.step(int(rng.integers(1, 8)))
        assert not engine.get_state().fault.any(), turn
    rows = random_presence(world, rng, 3)
    for e in (engine, fresh):
        e.reset(present=rows)
        play(e, tape(world, range(3), 10), 3)
    assert_same(read(engine), read(fresh), "the last run")
