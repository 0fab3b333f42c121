"""The rules of all engines once more, on free bodies alone: what an engine without joints or contacts is held to.

Nothing touches anything here, so no solver's tolerance stands between an engine and the exact answer.
"""

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.engine.parameters import PARAMETERS
from anysim.math import pose as P
from anysim.testing import tolerances, worlds
from anysim.testing.compare import FIELDS, MOTION, assert_close, assert_same, read, spread
from anysim.testing.fixtures import needs, skip_without, skip_without_parameter

BOX, BALL = 1, 2
"""Indices of bodies in the loose world."""

exact = needs(C.SNAPSHOT_TRAJECTORY)
PER_BODY = ["body.mass", "body.com", "body.inertia"]


def _flying(build, num_envs=2):
    """Bodies under way, each env with velocities of its own."""
    engine = build(worlds.loose(), num_envs)
    spread(engine)
    engine.step(20)
    return engine


def _other(name, values):
    """Other values that are as plausible as the present ones."""
    return values + (0.03 if name == "body.com" else 0.3 * values)


# ---------------------------------------------------------------------- resets and steps


def test_reset_is_a_fresh_start(build):
    """After a reset an env has the state and the future of a new one, and the others keep every bit."""
    used, fresh = _flying(build, 3), build(worlds.loose(), 3)
    before = read(used, [0, 2])
    used.reset([1])
    assert_same(read(used, [0, 2]), before, "the envs that were not reset")
    assert_same(read(used, [1]), read(fresh, [1]), "the env after its reset")
    used.step(30, [1])
    fresh.step(30, [1])
    assert_same(read(used, [1]), read(fresh, [1]), "30 steps later")
    assert_same(read(used, [0, 2]), before, "the envs that were not stepped")


def test_an_env_does_not_see_the_others(build):
    """Env i has the same bits whatever the number of envs, and whether it is stepped alone or with them."""
    few, many = _flying(build, 2), _flying(build, 7)
    assert_same(read(many, [0, 1]), read(few), "envs 0 and 1 among 7 against among 2")
    few.step(30)
    for ids in ([1], [6, 0], [2, 3, 4, 5]):
        many.step(30, ids)
    assert_same(read(many, [0, 1]), read(few), "envs stepped apart against together")


def test_steps_add_up(build):
    """Thirty steps in one call are thirty calls of one step, and states that were read stay as they were."""
    once, often = _flying(build), _flying(build)
    state = often.get_state()
    held = {name: getattr(state, name) for name in FIELDS}
    kept = {name: array.copy() for name, array in held.items()}
    once.step(30)
    for _ in range(30):
        often.step()
        assert often.get_state().body_pose.flags.writeable is False
    assert_same(read(often), read(once), "30 calls against one")
    assert_same(held, kept, "arrays read before")


@needs(C.DYNAMICS)
def test_bodies_fall_and_posts_stand(build):
    """Centres of mass fall g t^2 / 2 whatever the body, and what is fixed stays."""
    engine = build(worlds.loose())
    world = engine.world
    start = engine.get_state().body_pose[0]
    engine.step(500)
    end = engine.get_state().body_pose[0]
    for i in range(1, len(world.bodies)):
        com = np.array(world.bodies[i].inertial.com)
        first, last = (pose[i, :3] + P.rotate(pose[i, 3:], com) for pose in (start, end))
        assert_close(last - first, np.array([0.0, 0.0, -9.81 / 2]), 10 * tolerances.MOTION, world.bodies[i].name)
    assert np.array_equal(end[0], start[0])


# ---------------------------------------------------------------------- wrenches


@needs(C.DYNAMICS, C.WRENCHES)
def test_a_force_acts_at_the_centre_of_mass(build):
    """A force gives F t / m and no spin, one env alone, for one call; the body's frame lies off its centre."""
    engine, free = build(worlds.loose(), 2), build(worlds.loose(), 2)
    engine.apply_wrench([4.0, 0.0, 0.0, 0.0, 0.0, 0.0], [BOX], [1])
    for e in (engine, free):
        e.step(50)
    gained = engine.get_state().body_twist - free.get_state().body_twist
    assert not gained[0].any(), "another env felt it"
    assert_close(gained[1, BOX], np.array([4.0 * 0.1 / 2.0, 0, 0, 0, 0, 0]), tolerances.READ_BACK * 10, "gained twist")
    before = engine.get_state().body_twist[1, BOX, 0]
    engine.step(50)
    assert_close(engine.get_state().body_twist[1, BOX, 0], before, tolerances.READ_BACK * 10, "the force has ended")


@needs(C.DYNAMICS, C.WRENCHES)
def test_a_torque_turns_by_the_inertia(build):
    """A torque about a principal axis gives T t / I."""
    engine = build(worlds.loose())
    inertia = engine.world.bodies[BALL].inertial.inertia[2]
    engine.apply_wrench([0.0, 0.0, 0.0, 0.0, 0.0, 0.01 * inertia], [BALL])
    engine.step(100)
    assert_close(engine.get_state().body_twist[0, BALL, 5], 0.01 * 0.2, 10 * tolerances.READ_BACK, "rate")


# ---------------------------------------------------------------------- parameters


@pytest.mark.parametrize("name", [*PER_BODY, "world.gravity"])
def test_parameters_of_loose_bodies(build, engine_class, name):
    """The World's values at first; a write reaches its env and index alone, survives a reset, and leaves other envs."""
    skip_without_parameter(engine_class, name)
    engine, clean = build(worlds.loose(), 3), build(worlds.loose(), 3)
    bodies = engine.world.bodies
    wanted = (
        [engine.world.physics.gravity]
        if name == "world.gravity"
        else [getattr(body.inertial, name.partition(".")[2]) for body in bodies]
    )
    which = [0] if name == "world.gravity" else [BOX, BALL]
    before = engine.get_parameters(name)
    for row in before:
        assert np.allclose(row[which], np.array(wanted)[which], rtol=tolerances.READ_BACK, atol=1e-9)
    values = _other(name, before[1, which])
    engine.set_parameters(name, values, [1], which)
    kept = engine.get_parameters(name)
    assert np.allclose(kept[1, which], values, rtol=tolerances.READ_BACK)
    assert np.array_equal(kept[[0, 2]], before[[0, 2]])
    assert kept.shape[2:] == PARAMETERS[name].shape
    for e in (engine, clean):
        spread(e)
        e.step(30)
    assert_same(read(engine, [0, 2]), read(clean, [0, 2]), f"envs beside a changed {name}")
    engine.reset()
    assert np.array_equal(engine.get_parameters(name), kept)


@needs(C.DYNAMICS, C.WRENCHES)
@pytest.mark.parametrize("name", PER_BODY[::2])
def test_mass_and_inertia_resist(build, engine_class, name):
    """Twice the mass gets half of a force's speed, twice the inertia half of a torque's rate."""
    skip_without_parameter(engine_class, name)
    engine = build(worlds.loose(), 2)
    wrench = [3.0, 0, 0, 0, 0, 0] if name == "body.mass" else [0, 0, 0, 0, 0, 0.001]
    column = 0 if name == "body.mass" else 5
    engine.set_parameters(name, 2.0 * engine.get_parameters(name, [1], [BALL]), [1], [BALL])
    engine.apply_wrench(wrench, [BALL])
    engine.step(20)
    gained = engine.get_state().body_twist[:, BALL, column]
    assert gained[0] > 0.01
    assert_close(gained[1] / gained[0], 0.5, 1e-3, "ratio of the gained speeds")


# ---------------------------------------------------------------------- snapshots


@pytest.mark.parametrize("level", ["state", "trajectory"])
def test_snapshots_bring_loose_bodies_back(build, engine_class, level):
    """Poses, twists and clocks return, at every level; the snapshot is not changed by going on."""
    skip_without(engine_class, C(f"snapshot: {level}"))
    engine = _flying(build)
    before, snapshot = read(engine, fields=MOTION), engine.snapshot(level=level)
    for _ in range(2):
        engine.step(25)
        engine.restore(snapshot)
        for field, value in before.items():
            assert_close(read(engine, fields=MOTION)[field], value, tolerances.READ_BACK, f"{field} after restore")


@exact
def test_loose_bodies_go_on_exactly(build):
    """TRAJECTORY: from the snapshot on every bit is that of the uninterrupted run; also in another env and engine."""
    engine, other = _flying(build, 3), build(worlds.loose(), 2)
    snapshot, row = engine.snapshot(), engine.snapshot([0])
    engine.step(40)
    wanted = read(engine)
    engine.restore(snapshot)
    engine.step(40)
    assert_same(read(engine), wanted, "from the snapshot")
    engine.restore(row, [2])
    other.restore(row, [1])
    for e in (engine, other):
        e.step(40)
    alone = {name: value[0] for name, value in wanted.items()}
    assert_same({name: value[2] for name, value in read(engine).items()}, alone, "in another env")
    assert_same({name: value[1] for name, value in read(other).items()}, alone, "in another engine")


@exact
@pytest.mark.parametrize("name", [*PER_BODY, "world.gravity"])
def test_snapshots_hold_changed_parameters(build, engine_class, name):
    """Parameters that were changed are in the snapshot, and a snapshot from before takes the change back."""
    skip_without_parameter(engine_class, name)
    engine, other = _flying(build), build(worlds.loose(), 2)
    plain = engine.snapshot()
    which = [0] if name == "world.gravity" else [BOX, BALL]
    engine.set_parameters(name, _other(name, engine.get_parameters(name, [1], which)), [1], which)
    changed, kept = engine.snapshot(), engine.get_parameters(name)
    other.restore(changed)
    assert np.array_equal(other.get_parameters(name), kept)
    for e in (engine, other):
        e.step(30)
    assert_same(read(other), read(engine), f"with {name} changed, in another engine")
    engine.restore(plain)
    assert np.allclose(engine.get_parameters(name)[1], engine.get_parameters(name)[0], rtol=tolerances.READ_BACK)


# ---------------------------------------------------------------------- live editing and faults


def test_loose_bodies_come_and_go(build):
    """A body added and another removed leave the rest where it is, under way."""
    engine = _flying(build)
    before = read(engine, fields=MOTION)
    engine.add_object("late", {"sphere": 0.1}, mass=1.0, position=(0.0, 5.0, 3.0), collides=False)
    engine.remove_object("ball")
    names = [body.name for body in engine.world.bodies]
    assert sorted(names) == ["box", "late", "post", "slab"]
    after = read(engine, fields=MOTION)
    for name, old in (("post", 0), ("box", BOX), ("slab", 3)):
        for field in ("body_pose", "body_twist"):
            assert_close(after[field][:, names.index(name)], before[field][:, old], tolerances.READ_BACK, name)
    assert np.array_equal(after["time"], before["time"])
    engine.step(10)
    assert not engine.get_state().fault.any()


def test_a_lost_env_is_marked_and_hurts_no_other(build):
    """Absurd speeds leave the other envs alone: the env is marked or stays finite, and a reset heals it."""
    engine, calm = _flying(build), _flying(build)
    engine.set_body_state(twist=[1e12, 0.0, 0.0, 1e12, 0.0, 0.0], env_ids=[1], bodies=[BALL])
    for e in (engine, calm):
        e.step(20)
    state = engine.get_state()
    finite = np.isfinite(state.body_pose[1]).all() and np.isfinite(state.body_twist[1]).all()
    assert state.fault[1] or finite
    assert_same(read(engine, [0]), read(calm, [0]), "the env beside the fault")
    engine.reset([1])
    assert not engine.get_state().fault[1]
