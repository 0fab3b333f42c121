"""Promises of a sensor, checked in a world that declares it.

    from anysim.testing.sensors import check_sensor

    def test_promises():
        check_sensor("world.yaml", "altitude")

What it reads is for its own tests to say; here it is whether that depends on what it may depend on.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import anysim
from anysim.api import WATCHING, load
from anysim.conventions import Array
from anysim.errors import listing
from anysim.managers.sensors import EVERY_SENSOR
from anysim.task.env import TaskEnv
from anysim_schemas.base import NAME_PATTERN
from anysim_schemas.engine import EngineSpec
from anysim_schemas.task import TaskSpec

STEPS, ENVS = 16, 3
Readings = list[dict[str, Array]]
"""What is seen at the reset and after each step: (N, …) by field."""


def check_sensor(source: str | Path | Mapping[str, Any], name: str, *, engine: str | None = None) -> None:
    """Check the sensor `name` of a file, a task or a mapping, on its engine or another, with random actions.

    Raises:
        AssertionError: a promise that the sensor does not keep, in a sentence.
    """
    loaded = load(source)
    spec, declared = loaded.spec, loaded.spec.world.sensors or {}
    assert name in declared, f"the world has no sensor '{name}' (sensors: {listing(declared)})"
    if engine is not None:
        spec = spec.model_copy(update={"engine": EngineSpec(name=engine)})

    def make(num_envs: int, *, with_it: bool = True) -> TaskEnv:
        """An env whose task only watches, so that the sensor can be left out."""
        sensors = {key: one for key, one in declared.items() if key != name or with_it}
        world = spec.world.model_copy(update={"sensors": sensors or None})
        task = TaskSpec.model_validate({**WATCHING["task"], "horizon": 2 * STEPS})
        whole = {"task": task, "collect": None, "world": world, "num_envs": num_envs}
        return anysim.make(replace(loaded, spec=spec.model_copy(update=whole)))

    with make(ENVS, with_it=False) as env:
        without = _states(env)
    with make(1) as env:
        env.reset(seed=1)
        alone = _run(env, name)
    with make(ENVS) as env:
        _fields(env, name)
        assert _states(env) == without, f"'{name}' changes what happens: a sensor looks, and writes nothing"
        env.reset(seed=1)
        first = _run(env, name)
        env.reset(seed=1)
        _same(first, _run(env, name), "it reads something else in the same episodes again; draw nothing but in `noise`")
        mine = [{key: rows[:1] for key, rows in row.items()} for row in first]
        _same(mine, alone, "env 0 reads something else when it is alone")
        _same(mine, _partial(env, name), "env 0 reads something else when the others are reset")
        _snapshot(env, name)


def _fields(env: TaskEnv, name: str) -> None:
    assert env.sensors is not None
    fields = {key: field for key, field in env.sensors.fields(name).items() if key not in EVERY_SENSOR}
    assert fields, f"'{name}' has no field of its own"
    for key, field in fields.items():
        assert re.match(NAME_PATTERN, key), f"'{key}' cannot be recorded; letters, digits and '_' are allowed"
        assert field.unit, f"the field '{key}' has no unit; one of pure numbers has '1'"
        assert all(size > 0 for size in field.shape), f"the field '{key}' of shape {field.shape} is empty"


def _see(env: TaskEnv, name: str) -> dict[str, Array]:
    assert env.sensors is not None
    seen = {key: env.sensors.reading(name, key) for key in env.sensors.fields(name)}
    for key, rows in seen.items():
        assert np.isfinite(rows).all(), f"'{key}' is not finite; give what is not seen a number, as the end of a range"
    return seen


def _act(env: TaskEnv, tick: int, mask: Array | None = None) -> None:
    """The action of a step of an episode, the same for each env and each call."""
    low, high = env.action_bounds
    env.step(np.tile(np.random.default_rng(tick).uniform(low, high), (env.num_envs, 1)), mask)


def _run(env: TaskEnv, name: str, begin: int = 0) -> Readings:
    seen = [_see(env, name)]
    for tick in range(begin, STEPS):
        _act(env, tick)
        seen.append(_see(env, name))
    return seen


def _same(expected: Readings, found: Readings, words: str) -> None:
    for step, (one, two) in enumerate(zip(expected, found, strict=True)):
        for key, rows in one.items():
            assert rows.tobytes() == two[key].tobytes(), f"step {step}, '{key}': {words}"


def _snapshot(env: TaskEnv, name: str) -> None:
    """Going on from a snapshot reads the same, also in other envs."""
    half, words = STEPS // 2, "going on from a snapshot it reads something else; keep what it remembers in `memory`"
    env.reset(seed=2)
    for tick in range(half):
        _act(env, tick)
    snapshot = env.snapshot()
    expected = _run(env, name, half)
    env.reset(seed=3)
    env.reset_to(snapshot)
    _same(expected, _run(env, name, half), words)
    order = np.roll(np.arange(ENVS), 1)
    env.reset_to(snapshot.rows(order))
    _same([{key: rows[order] for key, rows in row.items()} for row in expected], _run(env, name, half), words)


def _partial(env: TaskEnv, name: str) -> Readings:
    """What env 0 reads when the others are reset in the middle."""
    env.reset(seed=1)
    seen = [_see(env, name)]
    for tick in range(STEPS):
        if tick == 5:
            env.reset(mask=np.arange(ENVS) > 0)
        _act(env, tick)
        seen.append(_see(env, name))
    return [{key: rows[:1] for key, rows in row.items()} for row in seen]


def _states(env: TaskEnv) -> list[bytes]:
    """Where everything is, step by step, of episodes from one seed."""
    env.reset(seed=4)
    found: list[bytes] = []
    for tick in range(STEPS):
        _act(env, tick)
        state = env.engine.get_state()
        found += [state.body_pose.tobytes(), state.body_twist.tobytes(), state.joint_pos.tobytes()]
    return found
