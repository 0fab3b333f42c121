"""Snapshots: as exact as declared, or refused."""

import io
from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.engine.state import SnapshotLevel, joined
from anysim.errors import CapabilityError, SnapshotError
from anysim.testing import tolerances, worlds
from anysim.testing.compare import MOTION, assert_close, assert_same, play, read, spread, tape
from anysim.testing.fixtures import needs, skip_without, skip_without_parameter

LEVELS = [level.value for level in SnapshotLevel]
exact = needs(C.SNAPSHOT_TRAJECTORY)


def _running(build, num_envs=2, world=None):
    """An engine in the middle of things: contacts, moving drives, own states per env."""
    engine = build(world or worlds.scene(), num_envs)
    spread(engine)
    play(engine, tape(engine.world, range(num_envs), 20))
    return engine


@pytest.mark.parametrize("level", LEVELS)
def test_levels_are_as_declared(build, engine_class, level):
    """A declared level gives a snapshot with its stamp; an undeclared one is a CapabilityError that names it."""
    engine = build(worlds.scene(), 2)
    if C(f"snapshot: {level}") not in engine_class.capabilities:
        with pytest.raises(CapabilityError, match=f"snapshot: {level}"):
            engine.snapshot(level=level)
        return
    snapshot = engine.snapshot(level=level)
    assert snapshot.level == level
    assert snapshot.engine == engine.name
    assert snapshot.engine_version == engine.version
    assert snapshot.world_hash == engine.world.hash
    assert snapshot.num_envs == 2
    for name, rows in snapshot.data.items():
        assert len(rows) == 2, f"{name} has no leading env axis"


@pytest.mark.parametrize("level", LEVELS)
def test_a_snapshot_brings_the_state_back(build, engine_class, level):
    """Restoring brings poses, velocities, joints, commands and time back at once, at every level."""
    skip_without(engine_class, C(f"snapshot: {level}"))
    engine = _running(build)
    before, snapshot = read(engine, fields=MOTION), engine.snapshot(level=level)
    play(engine, tape(engine.world, [0, 1], 20, seed=3))
    engine.restore(snapshot)
    after = read(engine, fields=MOTION)
    for name, value in before.items():
        assert_close(after[name], value, tolerances.READ_BACK, f"{name} after restore")
    # without new commands: the drives go on to where the snapshot's commands send them
    again, snapshot_now = build(engine.world, 2), engine.snapshot(level=level)
    again.restore(snapshot_now)
    for e in (engine, again):
        e.step(20)
    assert_close(again.get_state().joint_pos, engine.get_state().joint_pos, tolerances.TRANSIENT, "joints 20 steps on")


@exact
def test_continuing_is_exact(build):
    """TRAJECTORY: from the snapshot on, the run equals the uninterrupted one bit for bit; as often as one likes."""
    engine = _running(build)
    snapshot = engine.snapshot()
    targets = tape(engine.world, [0, 1], 40, seed=3)
    engine.step(30)  # under the commands of the snapshot
    play(engine, targets)
    wanted = read(engine)
    for attempt in ("first", "second"):
        engine.restore(snapshot)
        engine.step(30)
        play(engine, targets)
        assert_same(read(engine), wanted, f"the {attempt} run from the snapshot")


@exact
def test_the_state_is_exact_right_after_restore(build):
    """TRAJECTORY: positions, velocities, efforts and contacts are bit for bit those at the snapshot."""
    engine = _running(build)
    wanted, snapshot = read(engine), engine.snapshot()
    engine.reset()
    engine.step(7)
    engine.restore(snapshot)
    assert_same(read(engine), wanted, "right after restore")


@exact
def test_taking_a_snapshot_changes_nothing(build):
    """A run with snapshots on the way equals one without."""
    world = worlds.scene()
    engine, clean = build(world), build(world)
    for target in tape(world, [0], 30):
        for e in (engine, clean):
            e.set_control(position=target)
            e.step(2)
        engine.snapshot()
    assert_same(read(engine), read(clean), "with snapshots against without")


@exact
def test_rows_go_into_other_envs(build):
    """Rows may be restored into other envs, which then run as the original; the rest is untouched."""
    engine = _running(build, 3)
    snapshot = engine.snapshot([0])
    untouched = read(engine, [0, 1])
    targets = tape(engine.world, [4, 5, 4], 30)
    engine.restore(snapshot, [2])
    assert_same(read(engine, [0, 1]), untouched, "envs 0 and 1 at the restore into env 2")
    play(engine, targets)
    state = read(engine)
    assert_same({k: v[2] for k, v in state.items()}, {k: v[0] for k, v in state.items()}, "env 2 as a twin of env 0")


@exact
def test_a_second_engine_takes_over(build):
    """A snapshot taken in one engine runs on in another of the same kind and world, with another number of envs."""
    engine = _running(build)
    snapshot = engine.snapshot([1])
    targets = tape(engine.world, [0, 1], 30, seed=3)
    play(engine, targets)
    other = build(engine.world, 1)
    other.restore(snapshot)
    play(other, targets[:, [1]])
    assert_same(read(other), read(engine, [1]), "the run in the second engine")


@exact
def test_rows_of_several_engines_can_be_joined(build):
    """Rows of engines with different pasts, of different lengths, become one snapshot that goes on as each did."""
    world = worlds.scene()
    engines = [_running(build, 1, world), _running(build, 2, world)]
    play(engines[1], tape(world, [5, 6], 40, seed=5))
    if C.WRENCHES in engines[1].capabilities:
        engines[1].apply_wrench([[0.0, 0.0, 2.0, 0.0, 0.1, 0.0]], [engines[1].index.body("ball")], [1])
    snapshot = joined([e.snapshot() for e in engines])
    assert snapshot.num_envs == 3
    targets = tape(world, [0, 1, 2], 20, seed=3)
    play(engines[0], targets[:, :1])
    play(engines[1], targets[:, 1:])
    other = build(world, 3)
    other.restore(snapshot)
    play(other, targets)
    assert_same(read(other, [0]), read(engines[0]), "the row of the first engine")
    assert_same(read(other, [1, 2]), read(engines[1]), "the rows of the second engine")


def test_foreign_snapshots_are_not_joined(build, engine_class):
    """Snapshots of different stamps, or none at all, are a SnapshotError that says what is wrong."""
    level = next((x for x in LEVELS if C(f"snapshot: {x}") in engine_class.capabilities), None)
    skip_without(engine_class, C.SNAPSHOT_STATE if level is None else C(f"snapshot: {level}"))
    snapshot = build(worlds.scene()).snapshot(level=level)
    with pytest.raises(SnapshotError, match="world hash"):
        joined([snapshot, replace(snapshot, world_hash="feed")])
    with pytest.raises(SnapshotError, match="no snapshot"):
        joined([])
    with pytest.raises(SnapshotError, match=r"'ticks' is in some"):
        joined([snapshot, replace(snapshot, data={k: v for k, v in snapshot.data.items() if k != "ticks"})])


@exact
def test_snapshots_can_be_stored(build):
    """A snapshot survives a file, bit for bit: it is plain arrays and a stamp."""
    engine = _running(build)
    snapshot, file = engine.snapshot(), io.BytesIO()
    np.savez(file, allow_pickle=False, **snapshot.data)
    engine.step(30)
    wanted = read(engine)
    file.seek(0)
    with np.load(file) as stored:
        engine.restore(replace(snapshot, data=dict(stored)))
    engine.step(30)
    assert_same(read(engine), wanted, "from a stored snapshot")


@exact
@pytest.mark.parametrize("name", ["body.mass", "world.gravity", "joint.damping", "actuator.kp", "geom.friction"])
def test_changed_parameters_travel(build, engine_class, name):
    """Parameters changed per env are in the snapshot; restoring undoes later changes, too."""
    skip_without_parameter(engine_class, name)
    engine = _running(build)
    plain = engine.snapshot()
    values = engine.get_parameters(name, [1])
    engine.set_parameters(name, values * 1.5 + 0.01, [1])
    changed, kept = engine.snapshot(), engine.get_parameters(name)
    targets = tape(engine.world, [0, 1], 20, seed=3)
    play(engine, targets)
    wanted = read(engine)
    other = build(engine.world, 2)
    other.restore(changed)
    assert np.array_equal(other.get_parameters(name), kept)
    play(other, targets)
    assert_same(read(other), wanted, f"with {name} changed, in another engine")
    engine.restore(plain)
    assert np.array_equal(engine.get_parameters(name)[1], values[0]), "a snapshot from before the change undoes it"


@exact
def test_placed_bodies_travel(build):
    """Fixed bodies that were placed anew are in the snapshot."""
    engine = build(worlds.scene(), 2)
    table = engine.index.body("table")
    engine.set_body_state(pose=[0.3, 0.4, 0.5, 0.0, 0.0, 0.0, 1.0], env_ids=[1], bodies=[table])
    wanted, snapshot = read(engine, fields=MOTION), engine.snapshot()
    engine.reset()
    engine.restore(snapshot)
    assert_same(read(engine, fields=MOTION), wanted, "poses with a placed table")


@exact
def test_control_modes_travel(build, engine_class):
    """The modes of drives are in the snapshot."""
    skip_without(engine_class, C.CONTROL_VELOCITY)
    engine = _running(build)
    engine.set_control_mode("velocity", env_ids=[0], actuators=[0])
    engine.set_control(velocity=0.4)
    snapshot = engine.snapshot()
    engine.step(40)
    wanted = read(engine)
    engine.reset()
    engine.restore(snapshot)
    engine.step(40)
    assert_same(read(engine), wanted, "with one drive in velocity mode")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"engine": "another"}, "engine another"),
        ({"engine_version": "0.0.0-other"}, "engine version 0.0.0-other"),
        ({"world_hash": "feed"}, "world feed"),
    ],
    ids=["engine", "version", "world"],
)
def test_foreign_snapshots_are_refused(build, engine_class, change, message):
    """A snapshot of another engine, version or world is a SnapshotError that says which, and nothing changes."""
    level = next((x for x in LEVELS if C(f"snapshot: {x}") in engine_class.capabilities), None)
    skip_without(engine_class, C.SNAPSHOT_STATE if level is None else C(f"snapshot: {level}"))
    engine = _running(build)
    snapshot = engine.snapshot(level=level)
    engine.step(5)
    before = read(engine)
    with pytest.raises(SnapshotError, match=message):
        engine.restore(replace(snapshot, **change))
    assert_same(read(engine), before, "after the refusal")


@exact
def test_a_snapshot_of_another_world_is_refused(build):
    """A snapshot taken in another world is refused, though the shapes fit, and nothing changes."""
    one, other = build(worlds.falling_ball(10.0)), build(worlds.falling_ball(11.0))
    before = read(one)
    with pytest.raises(SnapshotError, match="world"):
        one.restore(other.snapshot())
    assert_same(read(one), before, "after the refusal")


@exact
def test_the_number_of_rows_must_fit(build):
    """A snapshot of one env does not fill two, and nothing changes."""
    engine = _running(build)
    snapshot = engine.snapshot([0])
    before = read(engine)
    with pytest.raises(SnapshotError, match=r"holds 1 envs, 2 were asked for"):
        engine.restore(snapshot)
    assert_same(read(engine), before, "after the refusal")


@needs(C.SNAPSHOT_TRAJECTORY, C.WRENCHES)
def test_a_waiting_wrench_is_part_of_a_snapshot(build):
    """A wrench that waits for its step is restored with the rest, and acts in the next step as it would have."""
    engine, other = build(worlds.spinning_ball(), 2), build(worlds.spinning_ball())
    engine.apply_wrench([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0], [1])
    snapshot = engine.snapshot([1])
    engine.step(3)
    other.restore(snapshot)
    other.step(3)
    assert other.get_state().body_twist[0, 0, 0] > 0.0
    assert (other.get_state().body_twist[0] == engine.get_state().body_twist[1]).all()


@needs(C.WRENCHES)
def test_a_wrench_waits_for_the_step_of_its_own_env(build):
    """Stepping one env does not use up the wrench of another; resetting an env does."""
    engine = build(worlds.spinning_ball(), 3)
    engine.apply_wrench(np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], (3, 1, 1)), [0])
    engine.step(1, [0])
    engine.reset([2])
    start = engine.get_state().body_twist[2, 0, 0]
    engine.step(1, [1, 2])
    twist = engine.get_state().body_twist[:, 0, 0]
    assert twist[1] == twist[0]
    assert twist[2] == start
