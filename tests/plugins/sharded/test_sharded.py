"""Worker processes behind the interface of an engine: results do not depend on how many there are."""

import warnings

import numpy as np
import pytest

from anysim.engine import executor, factory
from anysim.engine.capability import Capability
from anysim.errors import EngineError, SnapshotError
from anysim.testing import worlds
from anysim.testing.compare import assert_same, play, read, spread, tape
from anysim.testing.engines import require_engine
from anysim.testing.kinematic import NullEngine
from anysim_sharded.blocks import Blocks, joined
from anysim_sharded.engine import ShardedEngine, sharded
from tests.plugins.sharded.shards_help import children, descriptors, program
from tests.task.helpers import arm


def same_pages(pages, wanted, what):
    assert len(pages) == len(wanted)
    for number, (page, other) in enumerate(zip(pages, wanted, strict=True)):
        assert_same(page, other, f"{what}, page {number}")


# ---------------------------------------------------------------------- results


@pytest.mark.parametrize("shards", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
def test_results_do_not_depend_on_the_shards(shards):
    with NullEngine() as alone, sharded(NullEngine, shards)() as engine:
        same_pages(program(engine), program(alone), f"{shards} shards")
        assert len(engine.workers) == shards


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", ["pybullet", "sapien", "mujoco"])
def test_results_of_physics_do_not_depend_on_the_shards(name, seed):
    found = require_engine(name)
    level = "trajectory" if Capability.SNAPSHOT_TRAJECTORY in found.capabilities else "state"
    with found() as alone:
        wanted = program(alone, seed, level=level)
    for shards in (1, 3) if seed else (2,):
        with sharded(found, shards)() as engine:
            same_pages(program(engine, seed, level=level), wanted, f"{name} in {shards} shards")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pybullet", "sapien", "mujoco"])
def test_contacts_rays_wrenches_and_images_are_the_same(name):
    found, world = require_engine(name), worlds.scene(cameras=True)
    have = found.capabilities
    with found() as alone, sharded(found, 2)() as engine:
        for e in (alone, engine):
            e.create_world(world, 3)
            spread(e)
            if Capability.WRENCHES in have:
                e.apply_wrench([1.0, 0.5, 2.0, 0.0, 0.1, 0.0], [e.index.body("box")], [2, 0])
            e.step(150)
        order = [2, 0, 1]
        assert_same(read(engine), read(alone), "after 150 steps")
        if Capability.CONTACT_POINTS in have:
            wanted = alone.contacts(order)
            assert len(wanted.env)
            for got, column in zip(engine.contacts(order), wanted, strict=True):
                assert np.array_equal(got, column)
        if Capability.RAYCAST in have:
            rays = np.tile([[0.4, 0.0, 2.0], [9.0, 9.0, 1.0]], (3, 1, 1)), np.tile([0.0, 0.0, -1.0], (3, 2, 1))
            for got, column in zip(engine.raycast(*rays, order), alone.raycast(*rays, order), strict=True):
                assert np.array_equal(got, column)
        try:
            wanted = alone.render("front", 32, 24, order)
        except EngineError as error:
            warnings.warn(f"images are not compared: {error}", stacklevel=1)
        else:
            assert np.array_equal(engine.render("front", 32, 24, order)["rgb"], wanted["rgb"])
            assert engine.renderer_name() == alone.renderer_name()
        back, wanted = engine.read_back(), alone.read_back()
        assert_same(back, wanted, "what is read back")


def test_snapshots_fit_any_number_of_shards():
    world = worlds.scene()
    with NullEngine() as one, sharded(NullEngine, 2)() as two, sharded(NullEngine, 3)() as three:
        for engine in (one, two, three):
            engine.create_world(world, 4)
        spread(two)
        play(two, tape(world, range(4), 5))
        kept = two.snapshot()
        assert (kept.engine, kept.engine_version) == ("null", one.version)
        for engine in (one, three):
            engine.restore(kept)
            engine.step(5)
        two.step(5)
        assert_same(read(one), read(two), "without shards")
        assert_same(read(three), read(two), "in three shards")
        with pytest.raises(SnapshotError, match="4 envs"):
            two.restore(kept, [0])


def test_an_env_is_the_same_in_a_task():
    """A whole task, with its managers, in two processes and in none."""
    runs = []
    for shards in (1, 2):
        with arm(3, f"engine.shards={shards}") as env:
            assert isinstance(env.engine, ShardedEngine) == (shards == 2)
            env.reset(seed=4)
            action = np.full((3, env.action_dim), 0.2)
            runs.append([env.step(action) for _ in range(5)])
    for one, two in zip(*runs, strict=True):
        assert np.array_equal(one.obs["policy"], two.obs["policy"])
        assert np.array_equal(one.reward, two.reward)


# ---------------------------------------------------------------------- what it looks like


def test_it_presents_the_engine():
    """Name, version, capabilities, parameters, options and availability are those of the engine."""
    made = sharded(NullEngine, 2)
    assert issubclass(made, ShardedEngine)
    assert made is sharded(NullEngine, 2)
    assert (made.name, made.capabilities, made.parameters) == (
        NullEngine.name,
        NullEngine.capabilities,
        NullEngine.parameters,
    )
    assert made.availability() == NullEngine.availability()
    assert made().version == NullEngine().version
    with pytest.raises(EngineError, match="null takes no options, got colour"):
        made(colour="red")


@pytest.mark.slow
def test_options_reach_the_workers():
    found = require_engine("pybullet")
    with sharded(found, 2)(iterations=77) as engine:
        assert engine.version == found(iterations=77).version
        engine.create_world(worlds.drifting(), 2)
        engine.step()
    with pytest.raises(EngineError, match="no option 'iteration'; did you mean 'iterations'"):
        sharded(found, 2)(iteration=3)


def test_mujoco_shares_its_threads():
    found = require_engine("mujoco")
    assert found.parallel
    assert found.share_of_threads({}, 3) == {"threads": 3}
    assert found.share_of_threads({"threads": 0, "solver": "cg"}, 3) == {"threads": 3, "solver": "cg"}
    assert found.share_of_threads({"threads": 5}, 3) == {"threads": 5}
    assert found(threads=5).version == found().version


def test_more_shards_than_envs_are_not_started():
    with sharded(NullEngine, 5)() as engine:
        assert engine.workers == ()
        engine.create_world(worlds.drifting(), 2)
        assert len(engine.workers) == 2


def test_auto(monkeypatch):
    """One per usable core, at most one per env; none where the engine is parallel by itself."""
    monkeypatch.setattr(executor, "usable_cores", lambda: 6)
    parallel = type("Parallel", (NullEngine,), {"parallel": True})
    assert executor.shard_count("auto", NullEngine) == 6
    assert executor.shard_count("auto", NullEngine, 4) == 4
    assert executor.shard_count("auto", parallel, 4) == 1
    assert executor.shard_count(3, parallel, 4) == 3
    assert executor.shard_count(3, NullEngine, 1) == 1
    assert executor.usable_cores() >= 1


def test_create_simulation_takes_shards(monkeypatch):
    made = factory.create_simulation("null", shards=3, shard_timeout=7.0)
    assert isinstance(made, ShardedEngine)
    assert (made.shards, made.timeout_s) == (3, 7.0)
    assert type(factory.create_simulation("null")) is NullEngine
    assert type(factory.create_simulation("null", shards=1)) is NullEngine
    with pytest.raises(EngineError, match="at least 1"):
        factory.create_simulation("null", shards=0)


def test_a_class_that_cannot_be_imported_is_refused():
    class Local(NullEngine):
        pass

    with pytest.raises(EngineError, match="define it at the top of a module"):
        sharded(Local, 2)


def test_it_builds_destroys_and_builds_again_without_a_trace():
    before, open_before = children(), descriptors()
    for _ in range(2):
        engine = sharded(NullEngine, 2)().create_world(worlds.scene(), 3)
        pids = set(engine.workers)
        assert pids <= children()
        engine.step()
        engine.destroy()
        engine.destroy()
    assert children() == before
    assert descriptors() == open_before


def test_an_engine_that_is_forgotten_ends_its_workers():
    import gc

    before = children()
    engine = sharded(NullEngine, 2)().create_world(worlds.drifting(), 2)
    assert len(children() - before) == 2
    del engine
    gc.collect()
    assert children() == before


# ---------------------------------------------------------------------- arithmetic of blocks


@pytest.mark.parametrize(("envs", "workers"), [(1, 1), (5, 2), (5, 5), (16, 3)])
def test_blocks_are_contiguous_and_even(envs, workers):
    blocks = Blocks(envs, workers)
    sizes = [stop - first for first, stop in blocks.bounds]
    assert sum(sizes) == envs
    assert max(sizes) - min(sizes) <= 1
    assert [first for first, _ in blocks.bounds[1:]] == [stop for _, stop in blocks.bounds[:-1]]


def test_rows_come_back_where_they_were_asked_for():
    blocks = Blocks(5, 2)
    ids = np.array([4, 0, 3, 1])
    parts = blocks.split(ids)
    assert [(p.worker, p.rows.tolist(), p.ids.tolist()) for p in parts] == [(0, [1, 3], [0, 1]), (1, [0, 2], [1, 0])]
    whole = joined([(p.rows, 10.0 * p.worker + p.ids[:, None] + np.zeros((1, 2 + p.worker))) for p in parts], 4)
    assert whole.tolist() == [[11.0] * 3, [0.0, 0.0, 0.0], [10.0] * 3, [1.0, 1.0, 0.0]]
    assert blocks.split(np.arange(0)) == []
    assert len(blocks.split_query(np.arange(0))) == 1
