"""The fixtures of the families' suite: envs with the family under test, and what is seen of them step by step."""

from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.api import WATCHING
from anysim.conventions import Array
from anysim.families.base import Family
from anysim.task.env import TaskEnv
from anysim.testing import plugin

NAME, STEPS, ENVS = "it", 24, 3
Make = Callable[..., TaskEnv]
Seen = list[dict[str, bytes]]
"""What each env is like, step by step: the bytes of engine state, memory and looks."""


@pytest.fixture(scope="session")
def family_kind(pytestconfig: pytest.Config) -> Iterator[str]:
    """The name of the family under test; a class that is not installed is offered for the time of the suite."""
    given = str(pytestconfig.getoption("family"))
    module, colon, attribute = given.partition(":")
    if not (colon and attribute[:1].isupper()):
        yield given
        return
    mine, known = EntryPoint("under_test", f"{module}:{attribute}", "anysim.families"), registry.entry
    patch = pytest.MonkeyPatch()
    patch.setattr(registry, "entry", lambda kind, name: mine if name == mine.name else known(kind, name))
    yield mine.name
    patch.undo()


@pytest.fixture(scope="session")
def run_spec(pytestconfig: pytest.Config, family_kind: str) -> dict[str, Any]:
    """A run with the family and a ball, which only watches."""
    options = plugin.named_values(pytestconfig.getoption("family_option"), "--family-option")
    ball = {"source": {"sphere": 0.1}, "mass": 1.0}
    return {
        "engine": pytestconfig.getoption("engine") or "null",
        "physics": {"dt": 0.004, "control_dt": 0.02},
        "world": {
            "objects": {"ball": ball},
            "layout": {"ball": {"position": {"range": [[0.6, -0.2, 0.1], [0.7, 0.2, 0.1]]}}},
            "families": {NAME: {"kind": family_kind, **options}},
        },
        "task": {**WATCHING["task"], "horizon": 4 * STEPS},
    }


@pytest.fixture(scope="session")
def make(run_spec: dict[str, Any]) -> Iterator[Make]:
    """Makes envs; each number of them once, and a fresh one where `fresh` is set."""
    made: dict[int, TaskEnv] = {}
    others: list[TaskEnv] = []

    def one(num_envs: int, *, fresh: bool = False) -> TaskEnv:
        if fresh:
            others.append(anysim.make(run_spec, num_envs=num_envs))
            return others[-1]
        if num_envs not in made:
            made[num_envs] = anysim.make(run_spec, num_envs=num_envs)
        return made[num_envs]

    yield one
    for env in (*made.values(), *others):
        env.close()


def family_of(env: TaskEnv) -> Family:
    """The family under test."""
    assert env.families is not None
    return env.families.family(NAME)


def seen(env: TaskEnv, rows: Array | None = None) -> dict[str, bytes]:
    """What these envs are like now."""
    assert env.families is not None
    ids = np.arange(env.num_envs) if rows is None else rows
    state, engine = env.families.state(NAME, ids), env.engine.get_state()
    arrays = {"body_pose": engine.body_pose[ids], "body_twist": engine.body_twist[ids]}
    arrays |= {f"memory.{key}": array[ids] for key, array in family_of(env).memory.items()}
    arrays |= {"points": state.points, "velocities": state.velocities}
    arrays |= {f"field.{key}": array for key, array in state.fields.items()} | env.families.recorded(ids)
    return {key: np.ascontiguousarray(array).tobytes() for key, array in arrays.items()}


def run(env: TaskEnv, steps: int = STEPS, rows: Array | None = None, mask: Array | None = None) -> Seen:
    """What these envs are like from now on."""
    found = [seen(env, rows)]
    for _ in range(steps):
        env.step(np.zeros((env.num_envs, env.action_dim)), mask)
        found.append(seen(env, rows))
    return found


def same(expected: Seen, found: Seen, words: str) -> None:
    """Fail with the first step and array that differ."""
    for step, (one, two) in enumerate(zip(expected, found, strict=True)):
        differing = [key for key in one if one[key] != two[key]]
        assert not differing, f"step {step}, {differing}: {words}"
