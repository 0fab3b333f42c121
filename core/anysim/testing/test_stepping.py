"""Time, partial steps and resets, and determinism."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.testing import plugin, tolerances, worlds
from anysim.testing.compare import (
    MOTION,
    assert_close,
    assert_ratio,
    assert_same,
    play,
    read,
    run_and_read,
    run_elsewhere,
    spread,
    tape,
)
from anysim.testing.fixtures import needs


def test_time_advances(build):
    """`State.time` is the number of steps since the env's reset times dt."""
    engine = build(worlds.scene(), 3)
    dt = engine.world.physics.dt
    engine.step(5)
    engine.step(2, env_ids=[1])
    engine.reset([2])
    assert_close(engine.get_state().time, np.array([5 * dt, 7 * dt, 0.0]), 1e-12, "time")


def test_a_step_moves_what_moves(build):
    """A body with a velocity is elsewhere after a step: success is never silent standstill."""
    engine = build(worlds.drifting())
    engine.set_body_state(twist=[1.0, 0.0, -0.5, 0.0, 0.0, 0.0])
    start = engine.get_state().body_pose[0, 0, :3]
    engine.step(100)
    moved = engine.get_state().body_pose[0, 0, :3] - start
    assert_close(moved, np.array([0.2, 0.0, -0.1]), tolerances.MOTION, "the distance of a drifting body")


@needs(C.DYNAMICS)
def test_a_dropped_ball_falls(build):
    """An engine that declares dynamics has gravity, in z, from the first step."""
    engine = build(worlds.falling_ball())
    engine.step(1)
    assert engine.get_state().body_twist[0, 0, 2] < 0.0


def test_many_steps_are_single_steps(build):
    """`step(n)` is n times `step()`, bit for bit."""
    world = worlds.scene()
    many, single = build(world), build(world)
    target = tape(world, [3], 1)[0]
    for engine in (many, single):
        engine.set_control(position=target)
    many.step(60)
    for _ in range(60):
        single.step()
    assert_same(read(many), read(single), "step(60) against 60 x step()")


def test_reading_changes_nothing(build):
    """Reading the state between steps does not change the run."""
    world = worlds.scene()
    seen, unseen = build(world), build(world)
    for _ in range(40):
        seen.step()
        read(seen)
        unseen.step()
    assert_same(read(seen), read(unseen), "read at every step against read once")


def test_the_same_run_twice(build):
    """Two engines with the same world and commands go through the same states, bit for bit."""
    world = worlds.scene()
    targets = tape(world, [0, 1], 60)
    states = []
    for _ in range(2):
        engine = build(world, 2)
        spread(engine)
        play(engine, targets)
        states.append(read(engine))
    assert_same(states[1], states[0], "the second run")


def test_the_same_run_in_another_process(new_engine, pytestconfig):
    """A run is the same, bit for bit, in another process."""
    arguments = (pytestconfig.getoption("engine"), plugin.engine_options(pytestconfig))
    engine = new_engine()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(run_elsewhere, *arguments)
        here = run_and_read(engine, worlds.buildable(engine))
        assert_same(there.result(timeout=300), here, "the other process")


def test_envs_do_not_depend_on_their_number(build):
    """Env i has the same trajectory, bit for bit, whatever `num_envs` is."""
    world = worlds.scene()
    few, many = build(world, 2), build(world, 5)
    for engine in (few, many):
        spread(engine)
        play(engine, tape(world, range(engine.num_envs), 50))
    assert_same(read(many, [0, 1]), read(few), "envs 0 and 1 among 5 against among 2")


def test_equal_envs_stay_equal(build):
    """Envs with equal states and commands stay equal, bit for bit: their place in the batch does not matter."""
    world = worlds.scene()
    engine = build(world, 4)
    for target in tape(world, [7], 40):
        engine.set_control(position=np.repeat(target, 4, axis=0))
        engine.step(2)
    state = read(engine)
    for env in range(1, 4):
        assert_same(
            {k: v[env] for k, v in state.items()}, {k: v[0] for k, v in state.items()}, f"env {env} against env 0"
        )


def test_partial_step_leaves_the_others(build):
    """`step(env_ids)` moves only those envs; they move as in a full step."""
    world = worlds.scene()
    engine, full = build(world, 3), build(world, 3)
    spread(engine)
    spread(full)
    before = read(engine)
    engine.step(20, env_ids=[0, 2])
    full.step(20)
    assert_same(read(engine, [1]), {k: v[[1]] for k, v in before.items()}, "the env that did not step")
    assert_same(read(engine, [0, 2]), read(full, [0, 2]), "the envs that stepped")


def test_partial_reset_leaves_the_others(build):
    """`reset(env_ids)` touches no other env: same state now, and the same future as without the reset."""
    world = worlds.scene()
    engine, undisturbed, fresh = build(world, 3), build(world, 3), build(world, 3)
    for e in (engine, undisturbed):
        spread(e)
        play(e, tape(world, range(3), 25))
    before = read(engine)
    engine.reset([1])
    assert_same(read(engine, [0, 2]), {k: v[[0, 2]] for k, v in before.items()}, "the other envs right after the reset")
    assert_same(read(engine, [1]), read(fresh, [1]), "the env that was reset")
    targets = tape(world, range(3), 25, seed=9)
    for e in (engine, undisturbed, fresh):
        play(e, targets)
    assert_same(read(engine, [0, 2]), read(undisturbed, [0, 2]), "the other envs 50 steps later")
    assert_same(read(engine, [1], MOTION), read(fresh, [1], MOTION), "the env that was reset, 50 steps later")


def test_the_order_of_env_ids_does_not_matter(build):
    """Rows go where `env_ids` says, in any order."""
    world = worlds.tree()
    engine = build(world, 3)
    joints = len(world.joints)
    rows = np.arange(3 * joints, dtype=float).reshape(3, joints) / 100
    engine.set_joint_state(rows[[2, 0]], env_ids=[2, 0])
    got = engine.get_state().joint_pos
    assert_close(got[[0, 2]], rows[[0, 2]], tolerances.READ_BACK, "rows of envs 0 and 2")
    assert_close(got[1], np.array([j.initial for j in world.joints]), tolerances.READ_BACK, "the env not named")
    one, other = build(worlds.scene(), 3), build(worlds.scene(), 3)
    one.step(5, env_ids=[0, 2])
    other.step(5, env_ids=[2, 0])
    assert_same(read(one), read(other), "step(env_ids=[0, 2]) against [2, 0]")


def test_the_order_of_partial_calls_does_not_matter(build):
    """Stepping env 0 and then env 1 equals stepping them together."""
    world = worlds.scene()
    apart, together = build(world, 2), build(world, 2)
    for engine in (apart, together):
        spread(engine)
    apart.step(15, env_ids=[1])
    apart.step(15, env_ids=[0])
    together.step(15)
    assert_same(read(apart), read(together), "one by one against together")


@pytest.mark.parametrize("call", ["step", "reset"])
def test_no_envs_is_no_work(build, call):
    """An empty `env_ids` does nothing, quietly: masks may be empty."""
    engine = build(worlds.scene(), 2)
    engine.step(3)
    before = read(engine)
    getattr(engine, call)(env_ids=[])
    assert_same(read(engine), before, f"{call}(env_ids=[])")


def test_a_fault_stays_in_its_env(build):
    """An env driven to absurd speeds is marked or stays finite; the others go on as if nothing had happened."""
    world = worlds.scene()
    engine, calm = build(world, 2), build(world, 2)
    ball = [engine.index.body("ball")]
    engine.set_body_state(twist=[1e12, 0.0, 0.0, 1e12, 0.0, 0.0], env_ids=[1], bodies=ball)
    for e in (engine, calm):
        e.step(20)
    state = engine.get_state()
    finite = np.isfinite(state.body_pose[1]).all() and np.isfinite(state.body_twist[1]).all()
    assert state.fault[1] or finite
    assert not state.fault[0]
    assert_same(read(engine, [0]), read(calm, [0]), "the env beside the fault")
    engine.reset([1])
    assert not engine.get_state().fault[1], "a reset clears the fault"
    assert_same(read(engine, [1], MOTION), read(build(world, 1), [0], MOTION), "the env after its reset")


@needs(C.DYNAMICS)
def test_dt_is_the_worlds(build):
    """One step advances by `world.physics.dt`, whatever the engine likes: the speed after a fall tells."""
    for dt in (0.001, 1 / 240):
        engine = build(worlds.falling_ball(dt=dt))
        engine.step(60)
        assert_ratio(engine.get_state().body_twist[0, 0, 2], -9.81 * 60 * dt, tolerances.FALL_SPEED, f"dt {dt:g}")
