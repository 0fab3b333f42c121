"""Worlds built and destroyed many times leave nothing behind."""

import gc
import os
import threading
from pathlib import Path

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.testing import tolerances, worlds
from anysim.testing.fixtures import skip_without

ROUNDS = 40
_PROC = Path("/proc/self")


def _cycle(new_engine, rounds, render=False):
    for _ in range(rounds):
        engine = new_engine()
        engine.create_world(worlds.buildable(engine, cameras=render), 2)
        engine.step(2)
        _ = engine.get_state().body_pose
        if render:
            engine.render("front")
        engine.destroy()
    gc.collect()


def _resident() -> int:
    return int((_PROC / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _handles() -> int:
    return len(list((_PROC / "fd").iterdir()))


def test_no_memory_threads_or_handles_are_left(new_engine, engine_class):
    """Building and destroying 40 worlds leaves no thread, no file handle, and no growing memory."""
    if not (_PROC / "statm").exists():
        pytest.skip("no /proc here: memory and handles cannot be counted")
    _cycle(new_engine, 10)
    memory, threads, handles = _resident(), threading.active_count(), _handles()
    _cycle(new_engine, ROUNDS)
    assert threading.active_count() <= threads
    assert _handles() <= handles
    grown = _resident() - memory
    assert grown < tolerances.LEAK_BYTES, f"{grown / 2**20:.1f} MiB more after {ROUNDS} worlds"


def test_renderers_are_freed(new_engine, engine_class):
    """Rendering worlds leave no thread and no file handle either."""
    skip_without(engine_class, C.RENDER_RGB)
    if not (_PROC / "fd").exists():
        pytest.skip("no /proc here: handles cannot be counted")
    _cycle(new_engine, 2, render=True)
    threads, handles = threading.active_count(), _handles()
    _cycle(new_engine, 5, render=True)
    assert threading.active_count() <= threads
    assert _handles() <= handles


def test_resets_do_not_grow(build, engine_class):
    """Many resets and states leave no growing memory."""
    if not (_PROC / "statm").exists():
        pytest.skip("no /proc here: memory cannot be measured")
    engine = build(worlds.everyday(engine_class.capabilities), 4)

    def rounds(n):
        for _ in range(n):
            engine.reset()
            engine.step()
            _ = engine.get_state().body_twist
        gc.collect()

    rounds(100)
    memory = _resident()
    rounds(1000)
    assert _resident() - memory < tolerances.LEAK_BYTES


def test_resets_with_drawn_parameters_keep_no_objects(build, engine_class):
    """Other masses, inertias and frictions in each reset leave no Python objects: what is kept of them is bounded."""
    engine = build(worlds.everyday(engine_class.capabilities), 2)
    rng = np.random.default_rng(0)
    drawn = [name for name in ("body.mass", "body.inertia", "geom.friction") if name in engine_class.parameters]

    def rounds(n):
        for _ in range(n):
            scale = rng.uniform(0.8, 1.2, 2)
            for name in drawn:
                built = engine.built_parameters(name)
                engine.set_parameters(name, scale.reshape(2, *(1,) * built.ndim) * built)
            engine.reset()
        gc.collect()
        return len(gc.get_objects())

    before = rounds(100)
    grown = rounds(60) - before
    assert grown < 20, f"{grown} more objects after 60 resets; bound what is cached by the values of parameters"
