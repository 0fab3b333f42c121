"""Presence in snapshots, parameters and live editing."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from anysim.compile.edit import without_entity
from anysim.engine.capability import Capability as C
from anysim.engine.parameters import PARAMETERS
from anysim.model.world import Box, Sphere
from anysim.testing import plugin, tolerances
from anysim.testing.compare import MOTION, assert_close, assert_same, play, read, tape
from anysim.testing.fixtures import needs, skip_without_parameter
from anysim.testing.sketch import Sketch
from anysim.testing.varying import FULL, having, varied, with_slots

varies = needs(C.VARYING_ENTITIES)
IDENTITY = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def _engine(build, engine_class, num_envs=2):
    return build(varied(engine_class.capabilities), num_envs)


def _other(engine):
    """Rows of another presence than `FULL` and none."""
    return having(engine.world, "mug~2", "chest~1", "lid")


# ---------------------------------------------------------------------- snapshots


def _snapshot_run(engine):
    """A run with a presence of its own, its snapshot, and what follows."""
    world = engine.world
    engine.reset(present=np.concatenate([having(world, *FULL), having(world, "mug~2", "chest~1")]))
    play(engine, tape(world, [0, 1], 15), 4)
    snapshot = engine.snapshot()
    play(engine, tape(world, [0, 1], 15, seed=3), 4)
    return snapshot, read(engine)


@needs(C.VARYING_ENTITIES, C.SNAPSHOT_TRAJECTORY)
def test_snapshots_bring_back_what_was_present(build, engine_class):
    """A snapshot restored where others are there now, in place and in a new engine, goes on bit for bit."""
    engine = _engine(build, engine_class)
    snapshot, wanted = _snapshot_run(engine)
    engine.reset(present=having(engine.world).repeat(2, axis=0))
    engine.step(7)
    for e in (engine, _engine(build, engine_class)):
        e.restore(snapshot)
        assert np.array_equal(e.presence, snapshot.data["present"])
        play(e, tape(e.world, [0, 1], 15, seed=3), 4)
        assert_same(read(e), wanted, "from the snapshot")


@needs(C.VARYING_ENTITIES, C.SNAPSHOT_TRAJECTORY)
def test_rows_of_a_snapshot_go_into_envs_of_another_presence(build, engine_class):
    """A row goes into another env, which then has the entities of the first; the rest is untouched."""
    engine = _engine(build, engine_class, 3)
    world = engine.world
    engine.reset([0], present=having(world, *FULL))
    play(engine, tape(world, range(3), 10))
    snapshot, untouched = engine.snapshot([0]), read(engine, [0, 1])
    engine.restore(snapshot, [2])
    assert_same(read(engine, [0, 1]), untouched, "the others")
    play(engine, tape(world, [4, 5, 4], 20))
    state = read(engine)
    assert_same({k: v[2] for k, v in state.items()}, {k: v[0] for k, v in state.items()}, "env 2 as a twin of env 0")


@needs(C.VARYING_ENTITIES, C.SNAPSHOT_STATE)
def test_states_bring_back_what_was_present(build, engine_class):
    """A snapshot of the level STATE brings back who was there, and where."""
    engine = _engine(build, engine_class)
    engine.reset([1], present=_other(engine))
    play(engine, tape(engine.world, [0, 1], 10))
    before, present, snapshot = read(engine, fields=MOTION), engine.presence, engine.snapshot(level="state")
    engine.reset(present=having(engine.world).repeat(2, axis=0))
    engine.restore(snapshot)
    assert np.array_equal(engine.presence, present)
    for name, value in read(engine, fields=MOTION).items():
        assert_close(value, before[name], tolerances.READ_BACK, name)


@needs(C.VARYING_ENTITIES, C.SNAPSHOT_TRAJECTORY)
def test_a_snapshot_goes_on_in_another_process(new_engine, engine_class, pytestconfig):
    """A snapshot taken in another process brings its entities along, and its run, bit for bit."""
    arguments = (pytestconfig.getoption("engine"), plugin.engine_options(pytestconfig))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(snapshot_elsewhere, *arguments)
        engine = new_engine().create_world(varied(engine_class.capabilities), 2)
        engine.reset(present=having(engine.world, "mug~0").repeat(2, axis=0))
        snapshot, wanted = there.result(timeout=300)
        engine.restore(snapshot)
        play(engine, tape(engine.world, [0, 1], 15, seed=3), 4)
        assert_same(read(engine), wanted, "after a snapshot of another process")


def snapshot_elsewhere(name, options):
    """What the other process does."""
    with plugin.load_engine(name)(**options) as engine:
        engine.create_world(varied(engine.capabilities), 2)
        snapshot, wanted = _snapshot_run(engine)
        return snapshot, wanted


# ---------------------------------------------------------------------- parameters and live editing


def _other_values(world, name, values):
    """Other values (N, K, ...) of a parameter, where it can be changed."""
    changed = {"body.inertia": 1.5 * values, "body.com": values + 0.004, "geom.color": 0.5 * values}
    rows = changed.get(name, 0.5 * values + 0.2)
    if name.startswith("body."):
        kinds = np.array([body.kind == "static" for body in world.bodies])
        kept = ~world.loose if PARAMETERS[name].loose else kinds
        rows[:, kept] = values[:, kept]
    return rows


@varies
@pytest.mark.parametrize(
    "name",
    [
        "body.mass",
        "body.com",
        "body.inertia",
        "body.linear_damping",
        "body.angular_damping",
        "geom.friction",
        "geom.restitution",
        "geom.color",
        "joint.damping",
        "joint.friction",
        "joint.armature",
    ],
)
def test_parameters_of_what_is_absent_wait_for_it(build, engine_class, name):
    """What is written while an entity is absent is read back then, and acts when it comes, like one written there."""
    skip_without_parameter(engine_class, name)
    late, early = _engine(build, engine_class), _engine(build, engine_class)
    world = late.world
    if name.startswith("joint") and not world.joints:
        pytest.skip("this engine's world has no joints")
    values = _other_values(world, name, late.get_parameters(name))
    late.reset(present=having(world).repeat(2, axis=0))
    late.set_parameters(name, values)
    assert_close(late.get_parameters(name), values, tolerances.READ_BACK, "read back while absent")
    rows = having(world, *FULL).repeat(2, axis=0)
    late.reset(present=rows)
    assert_close(late.get_parameters(name), values, tolerances.READ_BACK, "read back when there")
    early.reset(present=rows)
    early.set_parameters(name, values)
    early.reset()
    for e in (late, early):
        play(e, tape(world, [0, 1], 20), 4)
    assert_same(read(late), read(early), f"with {name} of what was absent")


@varies
def test_live_editing_keeps_what_is_present(build, engine_class):
    """An object is added and removed; presence stays, and the run goes on."""
    engine, calm = _engine(build, engine_class), _engine(build, engine_class)
    for e in (engine, calm):
        e.reset([1], present=_other(e))
        play(e, tape(e.world, [0, 1], 10))
    present, before = engine.presence, read(engine, fields=MOTION)
    engine.add_object("crate", {"box": [0.2, 0.2, 0.2]}, mass=1.0, position=(3.0, 3.0, 0.5))
    assert np.array_equal(engine.presence[:, :-1], present)
    assert engine.presence[:, -1].all()
    bodies = len(calm.world.bodies)
    for name, value in read(engine, fields=MOTION[:2]).items():
        if name != "time":
            assert_close(value[:, :bodies], before[name], tolerances.READ_BACK, name)
    engine.step(5)
    engine.remove_object("crate")
    assert np.array_equal(engine.presence, present)
    calm.step(5)
    wanted, got = calm.get_state().body_pose, engine.get_state().body_pose
    assert_close(got, wanted, 100 * tolerances.READ_BACK, "poses after the crate came and went")


@varies
def test_a_world_of_nothing_but_what_may_be_absent(build):
    """All of a world may be absent: then nothing is there, nothing moves, and what comes is as built."""
    s = Sketch("ghosts")
    s.free("ball", Sphere(0.1), (0.0, 0.0, 1.0), collides=False)
    s.fixed("block", Box((0.1, 0.1, 0.1)), (1.0, 0.0, 0.5), collides=False)
    world = with_slots(s.world(), {"ball": ("ball",), "block": ("block",)})
    engine = build(world, 2)
    wanted = read(engine)
    engine.reset(present=np.zeros((2, 2), dtype=bool))
    engine.step(5)
    assert (engine.get_state().body_pose == IDENTITY).all()
    assert not engine.get_state().fault.any()
    engine.reset(present=np.ones((2, 2), dtype=bool))
    assert_same(read(engine), wanted, "when all came back")


@varies
def test_what_may_be_absent_can_be_removed(build, engine_class):
    """Removing an entity of a slot leaves the others of it, in a new engine as after live editing."""
    world = without_entity(varied(engine_class.capabilities), "mug~1")
    engine = build(world)
    engine.reset(present=having(world, "mug~2"))
    engine.step(3)
    assert not engine.get_state().fault.any()
