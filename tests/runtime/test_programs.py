"""Random programs of resets, steps, snapshots and restores, against a model of the contract."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from anysim.errors import SnapshotError, TaskError
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot
from tests.runtime import light
from tests.runtime.model import Alone, Row, action, check

N = 3
COUNTS = [pytest.param(100, marks=pytest.mark.slow), pytest.param(1000, marks=pytest.mark.full)]
"""Random programs on each engine."""
masks = st.lists(st.booleans(), min_size=N, max_size=N)
slots = st.lists(st.integers(0, N - 1), min_size=1, max_size=N, unique=True)
operations = st.one_of(
    st.tuples(st.just("step"), st.one_of(st.none(), masks)),
    st.tuples(st.just("step"), st.one_of(st.none(), masks)),  # twice: most of a program should be steps
    st.tuples(st.just("reset"), masks, st.one_of(st.none(), st.integers(0, 2))),
    st.tuples(st.just("snapshot"), masks),
    st.tuples(st.just("file"), st.integers(0, 3)),
    st.tuples(st.just("restore"), st.integers(0, 3), slots),
    st.tuples(st.just("retire"), slots),
)
programs = st.lists(operations, min_size=4, max_size=14)


def settled(examples: int) -> settings:
    """The same programs in every run."""
    return settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large],
    )


class Run:
    """An env and what it must be."""

    def __init__(self, env: TaskEnv, alone: Alone, folder: Any) -> None:
        self.env, self.alone, self.folder = env, alone, folder
        self.kept: list[tuple[EnvSnapshot, list[Row]]] = []
        env.reset(seed=0)
        self.rows = [Row(0, i).reset() for i in range(N)]

    def do(self, operation: tuple[Any, ...]) -> None:
        getattr(self, operation[0])(*operation[1:])
        check(self.env, self.rows, self.alone, str(operation))

    def step(self, mask: list[bool] | None) -> None:
        env = self.env
        actions = np.stack([action(row.episode, row.step, env.action_dim) for row in self.rows])
        chosen = range(N) if mask is None else np.flatnonzero(mask)
        given = None if mask is None else np.array(mask)
        if not all(self.rows[i].running for i in chosen):
            with pytest.raises(TaskError, match="cannot be stepped"):
                env.step(actions, given)
            return
        result = env.step(actions, given)
        for i in chosen:
            self.rows[i] = row = self.rows[i].stepped(self.alone)
            assert result.reward[i].tobytes() == self.alone.at(row.episode, row.step).reward
        assert not any(result.reward[i] for i in range(N) if i not in chosen)

    def reset(self, mask: list[bool], seed: int | None) -> None:
        obs, info = self.env.reset(mask=np.array(mask), seed=seed)
        chosen = np.flatnonzero(mask)
        assert len(obs["policy"]) == len(info["fault"]) == len(chosen)
        for i in map(int, chosen):
            self.rows[i] = (self.rows[i] if seed is None else Row(seed, i)).reset()

    def snapshot(self, mask: list[bool]) -> None:
        self.kept.append((self.env.snapshot(np.array(mask)), [self.rows[i] for i in np.flatnonzero(mask)]))

    def file(self, number: int) -> None:
        if self.kept:
            number %= len(self.kept)
            snapshot, rows = self.kept[number]
            self.kept[number] = EnvSnapshot.load(snapshot.save(self.folder / "one.snapshot")), rows

    def restore(self, number: int, slots: list[int]) -> None:
        if not self.kept:
            return
        snapshot, rows = self.kept[number % len(self.kept)]
        if len(rows) != len(slots):
            with pytest.raises(SnapshotError, match="pass env_ids"):
                self.env.reset_to(snapshot, slots)
            return
        self.env.reset_to(snapshot, slots)
        for slot, row in zip(slots, rows, strict=True):
            self.rows[slot] = row

    def retire(self, slots: list[int]) -> None:
        self.env.retire(np.array(slots))
        for slot in slots:
            self.rows[slot] = self.rows[slot].retired()


@pytest.mark.parametrize("spec", light.SPECS)
def test_programs_on_the_kinematic_engine(get, alone, tmp_path, spec) -> None:
    @settled(60)
    @given(programs)
    def run(program) -> None:
        one = Run(get("null", N, spec), alone("null", spec), tmp_path)
        for operation in program:
            one.do(operation)

    run()


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("engine", ["null", *light.REAL])
def test_programs_on_an_engine(get, alone, tmp_path, engine, count, capsys) -> None:
    done = {"programs": 0, "operations": 0}

    @settled(count)
    @given(st.sampled_from(list(light.SPECS)), programs)
    def run(spec, program) -> None:
        one = Run(get(engine, N, spec), alone(engine, spec), tmp_path)
        for operation in program:
            one.do(operation)
        done["programs"] += 1
        done["operations"] += len(program)

    run()
    with capsys.disabled():
        print(f"\n{engine}: {done['programs']} programs of {done['operations']} operations, no divergence")
    assert done["programs"] >= count
