"""Public calls from several threads block; they do not race."""

import threading

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.testing import worlds
from anysim.testing.compare import FIELDS, assert_same, read, spread, tape
from anysim.testing.fixtures import needs

THREADS = 4


def _at_once(work):
    """Run `work(k)` in threads that start together; return what they raised."""
    barrier, raised = threading.Barrier(THREADS), []

    def body(k):
        try:
            barrier.wait(timeout=30)
            work(k)
        except Exception as error:  # noqa: BLE001 - whatever it is, the test shows it
            raised.append(error)

    threads = [threading.Thread(target=body, args=(k,)) for k in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=120)
    assert not any(thread.is_alive() for thread in threads), "threads wait for each other for ever"
    return raised


def test_steps_from_threads_add_up(build):
    """Steps of several threads come one after the other: as many as asked for, with the state of a serial run."""
    world = worlds.scene()
    engine, serial = build(world, 2), build(world, 2)
    spread(engine)
    spread(serial)
    assert _at_once(lambda _: [engine.step(2) for _ in range(25)]) == []
    serial.step(THREADS * 50)
    assert_same(read(engine), read(serial), "200 steps from 4 threads")


def test_readers_see_whole_states(build):
    """A thread that reads while another steps sees states of one moment: time and pose belong together."""
    world = worlds.drifting()
    engine = build(world, 2)
    engine.set_body_state(twist=[1.0, 0.0, 0.0, 0.0, 0.0, 0.0])

    def work(k):
        for _ in range(60):
            if k == 0:
                engine.step()
                continue
            with engine.lock:
                state = engine.get_state()
                pose, time = state.body_pose, state.time
            assert np.allclose(pose[:, 0, 0], time, rtol=1e-3, atol=1e-6)

    assert _at_once(work) == []


def test_mixed_calls_do_not_break(build):
    """Commands, reads, resets and snapshots from several threads leave a sound engine."""
    world = worlds.scene()
    engine = build(world, 3)
    targets = tape(world, range(3), 20)

    def work(k):
        for target in targets:
            engine.set_control(position=target[[k % 3]], env_ids=[k % 3])
            engine.step(1)
            if k == 1:
                engine.reset([k])
            if k == 2:
                engine.get_observation(skip_images=True)

    assert _at_once(work) == []
    engine.reset()
    fresh = build(world, 3)
    for e in (engine, fresh):
        e.step(20)
    assert_same(read(engine), read(fresh), "after a reset")


@pytest.mark.parametrize("field", FIELDS)
def test_a_state_is_read_from_another_thread(build, field):
    """A state handed to another thread is read there."""
    engine = build(worlds.scene(), 2)
    state, seen = engine.get_state(), []
    thread = threading.Thread(target=lambda: seen.append(getattr(state, field)))
    thread.start()
    thread.join(timeout=30)
    assert np.array_equal(seen[0], getattr(engine.get_state(), field))


@needs(C.RENDER_RGB)
def test_images_from_another_thread(build):
    """A thread that did not build the engine may render, before and after the one that did; the images are equal."""
    engine, images = build(worlds.scene(cameras=True)), []
    images.append(engine.render("front")["rgb"])
    thread = threading.Thread(target=lambda: images.append(engine.render("front")["rgb"]))
    thread.start()
    thread.join(timeout=60)
    images.append(engine.render("front")["rgb"])
    assert len(images) == 3, "the other thread's render failed"
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


def test_an_engine_made_in_a_thread_serves_another(new_engine):
    """An engine built in one thread is stepped and freed in another."""
    engine = new_engine()
    world = worlds.buildable(engine)
    builder = threading.Thread(target=lambda: engine.create_world(world))
    builder.start()
    builder.join(timeout=60)
    engine.step(3)
    assert np.allclose(engine.get_state().time, 3 * world.physics.dt)
    ender = threading.Thread(target=engine.destroy)
    ender.start()
    ender.join(timeout=60)
    assert not ender.is_alive()
