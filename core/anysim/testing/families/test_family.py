"""Promises of a family, whatever it is made of."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.families.cosolver import CoSolver
from anysim.record.header import NumberType
from anysim.task.snapshot import EnvSnapshot
from anysim.testing.families.fixtures import ENVS, NAME, STEPS, Make, family_of, run, same, seen

LYING = 2e-8
"""[N s] that any matter may lose: where it lies as it begins, weight and ground give it next to nothing in sum."""


def test_parameters(run_spec: dict[str, Any]) -> None:
    """Its parameters are closed: a key that it does not know is told at its place."""
    families = {NAME: {**run_spec["world"]["families"][NAME], "no_such_key_of_it": 1}}
    with pytest.raises(SpecError, match=rf"world\.families\.{NAME}\.no_such_key_of_it"):
        anysim.make({**run_spec, "world": {**run_spec["world"], "families": families}}).close()


def test_state(make: Make) -> None:
    """`state` has finite points and velocities of the envs asked for, ids of its own entities, faces of its points."""
    env = make(ENVS)
    env.reset(seed=1)
    env.step(np.zeros((ENVS, env.action_dim)))
    assert env.families is not None
    state = env.families.state(NAME, np.array([2, 0]))
    count = state.points.shape[1]
    assert state.points.shape == state.velocities.shape == (2, count, 3)
    assert np.isfinite(state.points).all()
    assert np.isfinite(state.velocities).all()
    assert state.radius.shape == (count,)
    assert (state.radius >= 0).all()
    own = {entity + 1 for entity in family_of(env).setting.entities}
    assert state.ids.shape == (count,)
    assert set(state.ids.tolist()) <= own, "an id is that of an entity of its own"
    assert state.faces.shape[1:] == (3,)
    assert not len(state.faces) or (state.faces.min() >= 0 and state.faces.max() < count)
    whole = env.families.state(NAME)
    np.testing.assert_array_equal(state.points, whole.points[[2, 0]], "rows are those of the envs asked for")
    assert all(rows.shape[:2] == (2, count) for rows in state.fields.values())
    color = family_of(env).color
    assert len(color) == 3
    assert all(0.0 <= share <= 1.0 for share in color)


def test_facts(make: Make) -> None:
    """`facts` are plain data about its own entities; what is recorded is finite and has a row for each env."""
    env = make(ENVS)
    env.reset(seed=1)
    env.step(np.zeros((ENVS, env.action_dim)))
    assert env.families is not None
    facts: Mapping[str, object] = env.families.facts(1)
    json.dumps(facts)
    own = {env.engine.world.entities[i].name for i in family_of(env).setting.entities}
    assert set(facts) <= own
    for key, rows in env.families.recorded(np.array([1, 2])).items():
        assert len(rows) == 2, key
        assert str(rows.dtype) in get_args(NumberType), f"{key}: a recording has no numbers of type {rows.dtype}"
        assert np.isfinite(rows).all(), key


def test_repeats(make: Make) -> None:
    """Equal seeds give equal episodes: what is drawn comes from the env's streams."""
    env = make(ENVS)
    env.reset(seed=1)
    first = run(env)
    env.reset(seed=1)
    same(first, run(env), "another episode from the same seed; draw from `setting.streams` alone")


def test_alone(make: Make) -> None:
    """Env 0 is the same with others and alone."""
    many, one = make(ENVS), make(1)
    many.reset(seed=1)
    one.reset(seed=1)
    same(run(one), run(many, rows=np.array([0])), "env 0 depends on how many envs there are")


def test_partial_reset(make: Make) -> None:
    """A reset of some envs leaves the others alone, bit for bit, and begins anew in those."""
    env, others = make(ENVS), np.array([False, True, True])
    env.reset(seed=1)
    expected = run(env, rows=np.array([0]))
    env.reset(seed=1)
    found = run(env, 5, rows=np.array([0]))
    env.reset(mask=others)
    found += run(env, STEPS - 5, rows=np.array([0]))[1:]
    same(expected, found, "env 0 changed when others were reset")
    env.reset(seed=7, mask=others)
    again = seen(env, np.array([1]))
    env.reset(seed=7)
    assert seen(env, np.array([1])) == again, "an env is not the same after a reset as after another one"


def test_partial_step(make: Make) -> None:
    """A step of some envs leaves the others as they are."""
    env = make(ENVS)
    env.reset(seed=1)
    run(env, 3)
    before = seen(env, np.array([1]))
    run(env, 3, mask=np.array([True, False, True]))
    assert seen(env, np.array([1])) == before, "an env moved that was not stepped"


def test_snapshot(make: Make, tmp_path: Path) -> None:
    """Going on from a snapshot is going on, bit for bit: in other envs, in a new env, from a file."""
    env, order = make(ENVS), np.roll(np.arange(ENVS), 1)
    env.reset(seed=2)
    run(env, STEPS // 2)
    snapshot = env.snapshot()
    expected = run(env)
    words = "it goes on differently from a snapshot; keep all that it knows in `memory`"
    env.reset(seed=3)
    run(env, 4)
    env.reset_to(snapshot)
    same(expected, run(env), words)
    fresh = make(ENVS, fresh=True)
    fresh.reset(seed=5)
    fresh.reset_to(EnvSnapshot.load(snapshot.save(tmp_path / "one")))
    same(expected, run(fresh), f"in another process {words}")
    env.reset_to(snapshot)
    mine = run(env, rows=np.array([order[0]]))
    env.reset_to(snapshot.rows(order))
    same(mine, run(env, rows=np.array([0])), f"in another env {words}")


def test_driven(make: Make) -> None:
    """What it drives is where it says, within 0.1 mm, and moves so from one step to the next."""
    env = make(1)
    env.reset(seed=1)
    family = family_of(env)
    if not (bodies := [i for e in family.setting.entities for i in _bodies(env, e)]) or "driven" not in family.memory:
        pytest.skip("it drives no bodies")
    for _ in range(STEPS):
        env.step(np.zeros((1, env.action_dim)))
        there = env.engine.get_state().body_pose[0, bodies, :3]
        said = family.memory["driven"][0, :, :3]
        gap = np.abs(there[:, None] - said[None]).max(axis=2).min(axis=0).max()
        assert gap < 1e-4, f"a driven body is {gap * 1e3:.2f} mm from where the family has it"


def test_balance(make: Make) -> None:
    """What the matter of a co-solver gains is what weight and fixed things gave it, less what bodies got, to 1e-6."""
    env = make(ENVS)
    family, everyone = family_of(env), np.arange(ENVS)
    if not isinstance(family, CoSolver):
        pytest.skip("it has no solver of its own")
    env.reset(seed=1)
    run(env)
    found = family.balance(everyone)
    lost = found.now - found.begun - found.received + found.given
    scale = max(np.abs(rows[:, :3]).max() for rows in (found.received, found.given))
    assert scale > 0, "nothing acts on its matter"
    assert np.abs(lost[:, :3]).max() <= 1e-6 * scale + LYING, "momentum is lost; count all that it gets and gives"


def _bodies(env: Any, entity: int) -> range:
    one = env.engine.world.entities[entity]
    return range(one.body_start, one.body_stop)
