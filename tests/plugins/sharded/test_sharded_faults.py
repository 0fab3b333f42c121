"""A worker that dies or hangs costs its own envs their episode; everything else goes on, and nothing is left behind."""

import os
import re
import signal
import sys
import warnings
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import CapabilityError, EngineError
from anysim.testing import worlds
from anysim.testing.compare import FIELDS, assert_same, play, read, spread, tape
from anysim.testing.kinematic import NullEngine
from anysim_sharded.engine import WorkerWarning, sharded
from tests.plugins.sharded.shards_help import alive, children, descriptors
from tests.task.helpers import arm


@pytest.fixture
def moody(monkeypatch):
    """The module of misbehaving engines, importable by name here and in workers."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    import shard_engines

    yield shard_engines
    sys.modules.pop("shard_engines", None)


def _pair(engine_class=NullEngine, timeout_s=60.0, envs=5, **options):
    """The same run without workers and in two, of envs 0 to 2 and 3 to 4."""
    alone = NullEngine().create_world(worlds.scene(), envs)
    engine = sharded(engine_class, 2, timeout_s)(**options).create_world(worlds.scene(), envs)
    for e in (alone, engine):
        spread(e)
        play(e, tape(e.world, range(envs), 4))
    return alone, engine


def _lose(engine, blow, says):
    """Strike a worker, and step: what the warning says is checked."""
    blow()
    with pytest.warns(WorkerWarning, match=says) as caught:
        engine.step(2)
    assert len(caught) == 1


@pytest.mark.parametrize(
    ("blow", "says"),
    [
        (
            signal.SIGKILL,
            r"worker 1 of null \(envs 3 to 4\) was ended by signal 9 \(SIGKILL\); a new worker.*until reset",
        ),
        pytest.param(signal.SIGTERM, r"signal 15 \(SIGTERM\)", marks=pytest.mark.slow),
        pytest.param(signal.SIGSTOP, r"did not answer within 1\.5 s and was killed", marks=pytest.mark.slow),
    ],
)
def test_a_lost_worker_faults_its_own_envs(blow, says):
    alone, engine = _pair(timeout_s=60.0 if blow != signal.SIGSTOP else 1.5)
    with alone, engine:
        for e in (alone, engine):
            e.set_parameters("body.mass", [[3.5]], [3], [e.index.body("ball")])
        masses = engine.get_parameters("body.mass")
        first, second = engine.workers
        _lose(engine, lambda: os.kill(second, blow), says)
        assert not alive(second)
        assert engine.workers[0] == first
        assert alive(engine.workers[1])
        alone.step(2)
        healthy, lost = [0, 1, 2], [3, 4]
        assert engine.get_state().fault.tolist() == [False, False, False, True, True]
        fields = [f for f in FIELDS if f != "fault"]
        assert_same(read(engine, healthy, fields), read(alone, healthy, fields), "the others")
        fresh = NullEngine().create_world(engine.world, 5)
        fresh.step(2)
        assert not read(engine, lost, ["body_twist"])["body_twist"].any()
        assert np.array_equal(engine.get_parameters("body.mass"), masses), "parameters are those from before"
        play(engine, tape(engine.world, range(5), 3))
        play(alone, tape(engine.world, range(5), 3))
        assert_same(read(engine, healthy, fields), read(alone, healthy, fields), "the others, later")
        assert engine.get_state().fault.tolist() == [False, False, False, True, True], "until they are reset"
        for e in (alone, engine):
            e.reset([3])
        assert engine.get_state().fault.tolist() == [False, False, False, False, True]
        for e in (alone, engine):
            e.reset([4])
            play(e, tape(e.world, range(5), 3))
        assert_same(read(engine), read(alone), "all of them, after the reset")


@pytest.mark.parametrize(
    ("wish", "says"),
    [(1, r"was ended by signal 11 \(SIGSEGV\)"), (5, r"ended with exit code 7")],
    ids=["crash", "exit"],
)
def test_a_worker_that_ends_in_a_step(moody, wish, says, capfd):
    """A crash in the engine's library; faulthandler says on the worker's stderr where."""
    alone, engine = _pair(moody.Moody)
    with alone, engine:
        _lose(engine, lambda: engine.set_control(position=[[float(wish), 0.0]], env_ids=[3]), says)
        assert engine.get_state().fault.tolist() == [False, False, False, True, True]
        engine.step()
        engine.reset()
        assert not engine.get_state().fault.any()


def test_a_worker_that_hangs_in_a_step(moody):
    alone, engine = _pair(moody.Moody, timeout_s=3.0)
    with alone, engine:
        _lose(engine, lambda: engine.set_control(position=[[2.0, 0.0]], env_ids=[0]), r"worker 0 .*within 3 s")
        assert engine.get_state().fault.tolist() == [True, True, True, False, False]
        engine.step()


@pytest.mark.slow
def test_a_long_step_has_more_time(moody):
    """The limit is for a control step: many of them in one call may take as many times as long."""
    engine = sharded(moody.Moody, 1, 0.5)().create_world(worlds.scene(), 1)
    with engine:
        engine.set_control(position=[6.0, 0.0])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            engine.step(10 * engine.world.physics.substeps)
        with pytest.warns(WorkerWarning, match=r"within 0\.5 s"):
            engine.step(engine.world.physics.substeps)


@pytest.mark.parametrize(
    ("wish", "kind", "says"),
    [
        (3, EngineError, r"ZeroDivisionError: no way\nin the worker:\nTraceback.*shard_engines\.py"),
        (4, CapabilityError, r"^env 0 cannot do that \(in a worker, whose env 0 is env 3\)$"),
    ],
)
def test_errors_come_back(moody, wish, kind, says):
    """One of anysim's has its type and message, another its traceback; the worker lives on."""
    alone, engine = _pair(moody.Moody)
    with alone, engine:
        workers = engine.workers
        engine.set_control(position=[[float(wish), 0.0]], env_ids=[3])
        with pytest.raises(kind) as caught:
            engine.step()
        assert re.search(says, str(caught.value), re.DOTALL)
        assert engine.workers == workers
        engine.set_control(position=0.0)
        engine.step()


@pytest.mark.parametrize(
    ("name", "kind", "says"),
    [("Unbuildable", CapabilityError, "too few envs for me"), ("Unborn", EngineError, r"exit code 3 in 'build'")],
)
def test_a_build_that_fails_leaves_nothing(moody, name, kind, says):
    before, open_before = children(), descriptors()
    engine = sharded(getattr(moody, name), 2)()
    with pytest.raises(kind, match=says):
        engine.create_world(worlds.scene(), 5)
    assert children() == before
    assert descriptors() == open_before
    engine.destroy()


def test_a_worker_that_dies_again_is_an_error(moody):
    """A question that kills each worker that is asked is not asked for ever."""
    engine = sharded(moody.Fragile, 2)().create_world(worlds.scene(), 5)
    with engine:
        with pytest.warns(WorkerWarning), pytest.raises(EngineError, match=r"in 'get_parameter', and so did the one"):
            engine.get_parameters("body.mass")
        with pytest.warns(WorkerWarning, match="was lost before|exit code 4"):
            engine.step()
        engine.step()


def test_a_read_survives_a_lost_worker():
    """What is asked for is answered by the new worker."""
    alone, engine = _pair()
    with alone, engine:
        os.kill(engine.workers[1], signal.SIGKILL)
        with pytest.warns(WorkerWarning):
            fault = engine.get_state().fault
        assert fault.tolist() == [False, False, False, True, True]
        assert_same(read(engine, [0, 1, 2]), read(alone, [0, 1, 2]), "the others")


@pytest.mark.parametrize("worker", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_parameters_are_those_of_their_envs_after_a_loss(worker):
    """Whichever worker is lost when they are asked for: a lost first one does not put its envs last."""
    alone, engine = _pair()
    with alone, engine:
        values = np.linspace(0.1, 0.5, 5)[:, None]
        for e in (alone, engine):
            e.set_parameters("body.mass", values, indices=[0])
        os.kill(engine.workers[worker], signal.SIGKILL)
        with pytest.warns(WorkerWarning):
            found = engine.get_parameters("body.mass", indices=[0])
        assert np.array_equal(found, values)
        os.kill(engine.workers[worker], signal.SIGKILL)
        with pytest.warns(WorkerWarning):
            engine.set_parameters("body.mass", values[::-1], indices=[0])


def test_a_live_edit_keeps_the_fault():
    """An edit rebuilds the world, and does not make a lost episode sound."""
    alone, engine = _pair()
    with alone, engine:
        _lose(engine, lambda: os.kill(engine.workers[0], signal.SIGKILL), "worker 0")
        engine.add_object("crate", {"box": [0.2, 0.2, 0.2]}, position=(3.0, 3.0, 0.5))
        assert engine.get_state().fault.tolist() == [True, True, True, False, False]
        engine.reset()
        assert not engine.get_state().fault.any()


def test_an_edit_that_kills_the_workers_leaves_the_old_world(moody):
    """New workers hold the world from before the edit, in its state."""
    alone, engine = _pair(moody.Balks)
    with alone, engine:
        before = read(engine)
        with pytest.raises(EngineError, match="exit code 5 in 'build'"):
            engine.add_object("crate", {"box": [0.2, 0.2, 0.2]}, position=(3.0, 3.0, 0.5))
        assert_same(read(engine), before, "right after")
        for e in (alone, engine):
            e.step(3)
        assert_same(read(engine), read(alone), "later")


def test_a_snapshot_mends_a_lost_env():
    """A restore puts an env into a sound state, as a reset does."""
    alone, engine = _pair()
    with alone, engine:
        kept = engine.snapshot([3])
        _lose(engine, lambda: os.kill(engine.workers[1], signal.SIGKILL), "worker 1")
        for e in (alone, engine):
            e.restore(kept, [3])
            e.step(2, [3])
        assert engine.get_state().fault.tolist() == [False, False, False, False, True]
        assert_same(read(engine, [3]), read(alone, [3]), "the restored env")


def test_an_interrupted_call_leaves_a_usable_engine(moody, monkeypatch):
    """Ctrl-C while the workers step: their late answers are not taken for those to the next question."""
    alone, engine = _pair()
    with alone, engine:
        from anysim_processes.worker_handle import Worker

        def interrupted(*_):
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(Worker, "answer", interrupted)
            with pytest.raises(KeyboardInterrupt):
                engine.step(2)
        alone.step(2)
        assert_same(read(engine, fields=FIELDS[:4]), read(engine, fields=FIELDS[:4]), "twice")
        got, wanted = read(engine, fields=FIELDS[:4]), read(alone, fields=FIELDS[:4])
        del got["time"], wanted["time"]  # the call did not come to the point of counting
        assert_same(got, wanted, "after the interruption")


def test_ctrl_c_within_a_message_waits_for_its_end(monkeypatch):
    """The length of an answer was read and the answer not: nothing could be read from that worker any more."""
    alone, engine = _pair()
    with alone, engine:
        read_bytes = Connection._recv

        def interrupted(*words):
            monkeypatch.setattr(Connection, "_recv", read_bytes)
            length = read_bytes(*words)
            signal.raise_signal(signal.SIGINT)
            return length

        monkeypatch.setattr(Connection, "_recv", interrupted)
        with pytest.raises(KeyboardInterrupt):
            engine.step(2)
        alone.step(2)
        assert np.array_equal(engine.get_state().body_pose, alone.get_state().body_pose)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_episode_of_a_lost_env_counts_as_failed():
    """In a task the env's status is failed and its info says fault; the others run on, and it starts anew by reset."""
    with arm(4, "engine.shards=2") as env:
        env.reset(seed=1)
        still = np.zeros((4, env.action_dim))
        env.step(still)
        os.kill(env.engine.workers[1], signal.SIGKILL)
        with pytest.warns(WorkerWarning):
            result = env.step(still)
        assert result.status.tolist() == ["running", "running", "failed", "failed"]
        assert result.info["fault"].tolist() == [False, False, True, True]
        env.reset(mask=np.array([False, False, True, True]))
        result = env.step(still)
        assert result.status.tolist() == ["running"] * 4
