"""Presence follows the envs to their workers, and comes back with a worker that was lost."""

import os
import signal

import numpy as np
import pytest

from anysim.testing.compare import FIELDS, assert_same, play, read, tape
from anysim.testing.engines import require_engine
from anysim.testing.varying import having, random_presence, varied
from anysim_sharded.engine import WorkerWarning, sharded

WITHOUT_FAULTS = [field for field in FIELDS if field != "fault"]
OTHERS = [pytest.param(name, marks=pytest.mark.slow) for name in ("pybullet", "sapien")]


@pytest.mark.parametrize("name", ["null", "mujoco", *OTHERS])
def test_a_lost_worker_comes_back_with_what_was_present(name):
    """Its envs are as after a reset with their own entities and parameters; the others never notice."""
    engine_class = require_engine(name)
    world = varied(engine_class.capabilities)
    rows = random_presence(world, np.random.default_rng(3), 4)
    rows[3] = having(world, "mug~2", "chest~1", "lid")
    with engine_class().create_world(world, 4) as alone, sharded(engine_class, 2)().create_world(world, 4) as engine:
        for e in (alone, engine):
            e.reset(present=rows)
            e.set_parameters("body.mass", [[0.7]], [3], [e.index.body("mug~1")])
            play(e, tape(world, range(4), 4))
        os.kill(engine.workers[1], signal.SIGKILL)
        with pytest.warns(WorkerWarning, match=r"worker 1 of .* \(envs 2 to 3\)"):
            engine.step(2)
        alone.step(2)
        assert_same(read(engine, [0, 1], WITHOUT_FAULTS), read(alone, [0, 1], WITHOUT_FAULTS), "the others")
        assert np.array_equal(engine.presence, rows)
        for e in (alone, engine):
            e.reset([2, 3])
            play(e, tape(world, range(4), 6))
        fields = [*WITHOUT_FAULTS, "fault"]
        assert_same(read(engine, [2, 3], fields), read(alone, [2, 3], fields), "the envs of the new worker")
        everything = engine.get_parameters("body.mass")
        assert np.array_equal(everything, alone.get_parameters("body.mass"))


@pytest.mark.parametrize("name", ["null", *OTHERS[:1]])
def test_a_worker_that_is_lost_in_a_reset_takes_over_what_is_to_be_present(name):
    """A worker dies, and the next call is a reset with other entities: the new worker has them."""
    engine_class = require_engine(name)
    world = varied(engine_class.capabilities)
    wanted = having(world, "mug~1", "post").repeat(4, axis=0)
    with engine_class().create_world(world, 4) as alone, sharded(engine_class, 2)().create_world(world, 4) as engine:
        os.kill(engine.workers[0], signal.SIGKILL)
        with pytest.warns(WorkerWarning, match=r"worker 0 of .* \(envs 0 to 1\)"):
            engine.reset(present=wanted)
        alone.reset(present=wanted)
        for e in (alone, engine):
            play(e, tape(world, range(4), 6))
        assert_same(read(engine), read(alone), "after a reset in which a worker was replaced")
