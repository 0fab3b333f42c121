"""Data in, data out: nothing that was handed out or taken in shares memory with the engine."""

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.errors import StaleStateError
from anysim.testing import worlds
from anysim.testing.compare import FIELDS, assert_same, play, read, spread, tape
from anysim.testing.fixtures import needs, skip_without, skip_without_parameter


def test_state_arrays_are_read_only(build):
    """Arrays of a `State` refuse to be written."""
    state = build(worlds.scene()).get_state()
    for name in FIELDS:
        array = getattr(state, name)
        assert not array.flags.writeable, name
        if array.size:
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1


def test_state_arrays_never_change_later(build):
    """Arrays that were read stay as they are through steps, writes, resets, restores and the engine's end."""
    engine = build(worlds.scene(), 2)
    spread(engine)
    state = engine.get_state()
    held = {name: getattr(state, name) for name in FIELDS}
    kept = {name: array.copy() for name, array in held.items()}
    play(engine, tape(engine.world, [0, 1], 5))
    assert_same(held, kept, "after steps")
    engine.set_joint_state(np.full(2, 0.5), np.full(2, 0.5))
    engine.set_body_state(pose=[5.0, 5.0, 5.0, 0.0, 0.0, 0.0, 1.0], twist=np.ones(6))
    assert_same(held, kept, "after writes")
    engine.reset()
    assert_same(held, kept, "after a reset")
    engine.destroy()
    assert_same(held, kept, "after destroy")


def test_states_do_not_share_memory(build):
    """Two states, before and after a step, have nothing in common."""
    engine = build(worlds.scene(), 2)
    first = [getattr(engine.get_state(), name) for name in FIELDS]
    engine.step()
    second = [getattr(engine.get_state(), name) for name in FIELDS]
    for name, a, b in zip(FIELDS, first, second, strict=True):
        assert not np.shares_memory(a, b), name


def test_the_state_is_cached_until_the_engine_moves(build):
    """Reading twice gives the same array; it costs the engine one read."""
    engine = build(worlds.scene())
    assert engine.get_state().body_pose is engine.get_state().body_pose
    old = engine.get_state()
    engine.step()
    assert engine.get_state() is not old


@pytest.mark.parametrize("move", ["step", "reset", "set_joint_state", "destroy"])
def test_an_unread_field_of_an_old_state_is_refused(build, move):
    """A field that was not read before the engine moved on raises, rather than give the new value; read ones stay."""
    engine = build(worlds.scene())
    state = engine.get_state()
    position = state.joint_pos
    getattr(engine, move)(*([[0.1, 0.1]] if move == "set_joint_state" else []))
    with pytest.raises(StaleStateError, match="body_pose was not read"):
        _ = state.body_pose
    assert state.joint_pos is position


def test_inputs_are_not_kept(build):
    """Changing an array after handing it in changes nothing, now or later."""
    world = worlds.scene()
    scribbled, clean = build(world, 2), build(world, 2)
    free = [i for i, b in enumerate(world.bodies) if b.kind == "free"]
    for engine in (scribbled, clean):
        joints, speeds = np.full((2, 2), 0.3), np.full((2, 2), 0.1)
        pose, twist = engine.get_state().body_pose[:, free].copy(), np.full((2, len(free), 6), 0.05)
        pose[..., 0] += 0.5
        targets = [np.full((2, 2), 0.4), np.full((2, 2), 0.02), np.full((2, 2), 0.1)]
        engine.set_joint_state(joints, speeds)
        engine.set_body_state(pose, twist, bodies=free)
        engine.set_control(*targets)
        if engine is scribbled:
            for array in (joints, speeds, pose, twist, *targets):
                array[...] = -7.0
        for _ in range(10):
            engine.step()
    assert_same(read(scribbled), read(clean), "after the inputs were overwritten")


@needs(C.WRENCHES)
def test_wrenches_are_not_kept(build):
    """The array of a wrench may be reused at once."""
    engine, clean = build(worlds.spinning_ball()), build(worlds.spinning_ball())
    force = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for e in (engine, clean):
        e.apply_wrench(force.copy() if e is clean else force, [0])
    force[:] = 50.0
    for e in (engine, clean):
        e.step(10)
    assert_same(read(engine), read(clean), "after the wrench was overwritten")


def test_inputs_are_not_written(build):
    """Inputs come back unchanged; read-only ones, lists and other number types are welcome."""
    engine = build(worlds.scene(), 2)
    values = np.full((2, 2), 0.3)
    values.setflags(write=False)
    engine.set_joint_state(values, values)
    engine.set_control(position=values)
    engine.set_joint_state([[0, 0], [0, 0]])
    engine.set_control(position=np.float32(0.1))
    pose = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0005])
    before = pose.copy()
    engine.set_body_state(pose=pose)
    assert np.array_equal(pose, before)


def test_parameters_come_as_copies(build, engine_class):
    """Writing into what `get_parameters` returned, or into what was handed to `set_parameters`, changes nothing."""
    skip_without_parameter(engine_class, "body.mass")
    engine = build(worlds.drifting(), 2)
    masses = np.array([[3.0], [4.0]])
    engine.set_parameters("body.mass", masses)
    masses[:] = 99.0
    got = engine.get_parameters("body.mass")
    got[:] = 77.0
    assert np.allclose(engine.get_parameters("body.mass"), [[3.0], [4.0]])


@pytest.mark.parametrize("level", ["state", "trajectory"])
def test_snapshots_are_copies(build, engine_class, level):
    """A snapshot does not change when the engine goes on, nor by being restored; the engine keeps none of it."""
    skip_without(engine_class, C(f"snapshot: {level}"))
    engine = build(worlds.scene(), 2)
    spread(engine)
    engine.step(5)
    snapshot = engine.snapshot(level=level)
    kept = {name: array.copy() for name, array in snapshot.data.items()}
    play(engine, tape(engine.world, [0, 1], 5))
    assert_same(snapshot.data, kept, "while the engine went on")
    engine.restore(snapshot)
    engine.step(5)
    wanted = read(engine)
    assert_same(snapshot.data, kept, "after it was restored")
    engine.restore(snapshot)
    for array in snapshot.data.values():
        array[...] = 0
    engine.step(5)
    assert_same(read(engine), wanted, "after the snapshot was overwritten")


def test_observations_are_copies(build):
    """Arrays of `get_observation` may be written without harm."""
    engine = build(worlds.scene())
    before = read(engine)
    for array in engine.get_observation(skip_images=True).values():
        array[...] = 9.0
    assert_same(read(engine), before, "after the observation was overwritten")


@needs(C.RENDER_RGB)
def test_images_are_fresh(build):
    """Each image is a new array that may be written."""
    engine = build(worlds.scene(cameras=True))
    one = engine.render("front")["rgb"]
    two = engine.render("front")["rgb"]
    assert not np.shares_memory(one, two)
    one[...] = 0
    assert two.any()


def test_camera_poses_are_copies(build):
    """Poses of cameras are handed in and out as copies."""
    world = worlds.scene(cameras=True)
    engine = build(world)
    pose = np.array([[0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0]])
    engine.set_camera_pose("front", pose)
    pose[:] = 5.0
    got = engine.camera_poses("front")
    got[:] = 7.0
    assert np.array_equal(engine.camera_poses("front"), [[0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0]])
