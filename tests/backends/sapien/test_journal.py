"""Exact snapshots: the journal of a scene, playing it again, and the scenes that are built anew to keep it short."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.compile.world import compile_world
from anysim.errors import SnapshotError
from anysim.testing import worlds
from anysim.testing.compare import assert_same, play, read, spread, tape
from anysim_schemas.run import WorldSpec


def _busy(engine):
    """All that a journal knows of: written states, wrenches, commands, gains, masses, friction, armature."""
    spread(engine)
    play(engine, tape(engine.world, range(engine.num_envs), 5))
    engine.set_parameters("body.mass", 1.2 * engine.get_parameters("body.mass"))
    engine.set_parameters("joint.friction", 0.05)
    engine.set_parameters("joint.armature", 0.02)
    engine.set_parameters("actuator.kp", 45.0)
    engine.set_parameters("joint.damping", 0.3)
    engine.apply_wrench([[0.5, 0.0, 1.0, 0.0, 0.1, 0.0]], [engine.index.body("ball")])
    engine.step(4)
    engine.set_body_state(pose=[0.75, 0.05, 0.4, 0.0, 0.0, 0.0, 1.0], bodies=[engine.index.body("ball")])
    engine.set_control_mode("velocity", actuators=[0])
    engine.set_control(velocity=0.3)
    engine.step(30)
    return engine


def _journal(engine, env=0):
    return engine._envs.scenes[env].journal.rows()


def test_a_restored_scene_has_the_journal_of_the_one_before(make):
    """So that a snapshot of what was restored is the snapshot, and not one of a longer or another past."""
    engine = _busy(make(worlds.scene(sensor=True)))
    snapshot = engine.snapshot()
    other = make(worlds.scene(sensor=True), 2)
    other.step(3)
    other.restore(snapshot, [1])
    again = other.snapshot([1])
    assert set(again.data) == set(snapshot.data)
    for name, rows in snapshot.data.items():
        assert np.array_equal(again.data[name], rows), name
    assert np.array_equal(_journal(other, 1), _journal(engine))
    engine.step(25)
    other.step(25)
    assert_same(read(other, [1]), read(engine), "after going on")


def test_a_journal_is_as_short_as_what_was_done(make):
    """Commands that stay, and steps that follow each other, take no room."""
    engine = make(worlds.scene())
    engine.step(5)
    before = engine._envs.scenes[0].journal.size
    target = engine.control.position
    for _ in range(50):
        engine.set_control(position=target)
        engine.step(3)
    assert engine._envs.scenes[0].journal.size == before
    engine.set_control(position=target + 0.1)
    engine.step(1)
    added = len(_journal(engine)) - before // 8
    assert added <= 4 * len(engine.world.actuators) + 8, "an entry of commands between two of steps"


def test_scenes_are_renewed_at_the_same_instants_however_they_are_stepped(make):
    """In one call or many, alone or beside others, with or without snapshots and reads; and it is no large change."""
    world = worlds.scene()
    one, many, beside = (make(world, n, rebase_steps=20) for n in (1, 1, 3))
    plain = make(world)
    one.step(90)
    plain.step(90)
    for n in (1, 18, 1, 1, 30, 39):
        many.step(n)
        many.snapshot()
        read(many)
        many.contacts()
    beside.step(7, [1])
    beside.step(83, [1, 2])
    beside.step(90, [0])
    beside.step(7, [2])
    assert_same(read(many), read(one), "in many calls")
    assert_same(read(beside, [0]), read(one), "beside others")
    assert_same(read(beside, [1]), read(one), "in parts")
    assert_same(read(beside, [2]), read(one), "in other parts")
    assert one._envs.scenes[0].journal.steps == 10
    assert np.abs(read(plain)["body_pose"] - read(one)["body_pose"]).max() < 2e-3
    assert not np.array_equal(read(plain)["body_pose"], read(one)["body_pose"]), "scenes were not renewed at all"


def test_a_snapshot_on_either_side_of_a_renewal_is_exact(make):
    """Before, at, and after the instant."""
    engine = make(worlds.scene(sensor=True), rebase_steps=20)
    spread(engine)
    engine.step(18)
    taken = []
    for _ in range(5):
        taken.append((engine.snapshot(), read(engine), engine.contacts()))
        engine.step(1)
    engine.step(30)
    wanted = read(engine)
    for k, (snapshot, state, contacts) in enumerate(taken):
        other = make(worlds.scene(sensor=True), rebase_steps=20)
        other.restore(snapshot)
        assert_same(read(other), state, f"{18 + k} steps in, at once")
        assert all(np.array_equal(a, b) for a, b in zip(other.contacts(), contacts, strict=True))
        other.step(35 - k)
        assert_same(read(other), wanted, f"{18 + k} steps in, going on")


def test_a_journal_stays_bounded_where_nothing_steps(make):
    """Writes alone renew a scene, too; what is read stays."""
    engine = make(worlds.scene(), rebase_steps=50)
    engine.step(5)
    sizes = []
    for k in range(400):
        engine.set_joint_state(position=[[0.001 * k, 0.0]])
        sizes.append(engine._envs.scenes[0].journal.size)
    assert max(sizes) < 60 * 8 * (2 + 2 + 2 * len(engine.world.joints)) + 2000
    assert np.allclose(engine.get_state().joint_pos, [[0.399, 0.0]], atol=1e-6)


def test_a_resting_stack_does_not_feel_a_renewal(make):
    """A stack at rest moves by micrometres where its scene is built anew, and stays where it was."""
    engine = make(worlds.scene(), rebase_steps=400)
    engine.step(1599)
    before = read(engine)
    engine.step(1)
    engine.step(1)
    after = read(engine)
    assert engine._envs.scenes[0].journal.steps == 1, "the scene was not renewed"
    assert np.abs(after["body_pose"] - before["body_pose"]).max() < 2e-5


def test_a_fault_outlives_a_renewal_and_a_snapshot(make):
    """An env whose state is not finite stays marked, and goes on alike."""
    engine, other = (make(worlds.scene(), rebase_steps=6) for _ in range(2))
    engine.apply_wrench(np.full((1, 1, 6), 1e38), [engine.index.body("ball")])
    engine.step(4)
    assert engine.get_state().fault.all()
    other.restore(engine.snapshot())
    for e in (engine, other):
        e.step(5)
        assert e.get_state().fault.all()
    for name, value in read(engine).items():
        assert np.array_equal(read(other)[name], value, equal_nan=True), name


def test_a_live_edit_is_part_of_a_snapshot(make):
    """What was carried over into the new world is restored with its bits, and goes on."""
    engine = make(worlds.scene())
    spread(engine)
    engine.step(40)
    engine.add_object("post", {"box": [0.05, 0.05, 0.05]}, fixed=True, position=(0.4, 0.4, 0.0))
    snapshot, state = engine.snapshot(), read(engine)
    engine.step(30)
    wanted = read(engine)
    other = make(engine.world)
    other.restore(snapshot)
    assert_same(read(other), state, "at once")
    other.step(30)
    assert_same(read(other), wanted, "going on")


def test_other_instants_are_another_engine(make):
    """A snapshot would not continue to the bit where scenes are renewed at other instants, and says so."""
    snapshot = make(worlds.scene(), rebase_steps=100).snapshot()
    with pytest.raises(SnapshotError, match="rebase_steps=100"):
        make(worlds.scene()).restore(snapshot)


def test_a_damaged_journal_is_refused(make):
    engine = make(worlds.scene())
    engine.step(5)
    snapshot = engine.snapshot()
    rows = snapshot.data["engine.journal"].copy()
    rows[0, 0] = 77.0
    with pytest.raises(SnapshotError, match="damaged: there is no entry of a journal at number 0"):
        engine.restore(replace(snapshot, data={**snapshot.data, "engine.journal": rows}))


def test_a_scene_renewed_after_a_restore_has_the_inertia_that_was_asked_for(make):
    """PhysX rounds what it is given; asked for again as it was read, a tilted tensor would come out in other bits."""
    ajar = {"*": {"opened": 0.5, "friction": 0.0}}
    spec = {"objects": {"cabinet": {"source": "procedural:cabinet", "fixed": True, "joints": ajar}}}
    world = compile_world(WorldSpec.model_validate(spec))
    engine, other = (make(world, rebase_steps=20) for _ in range(2))
    engine.set_parameters("body.mass", 0.9 * engine.get_parameters("body.mass"))
    engine.set_parameters("body.inertia", 0.9 * engine.get_parameters("body.inertia"))
    engine.set_joint_state(velocity=[[0.1, 0.2, -0.1, 0.5]])
    engine.step(30)
    other.restore(engine.snapshot())
    for e in (engine, other):
        e.step(60)
    assert_same(read(other), read(engine), "going on")
