"""Pools: the same bits as one local env, also where a service is lost."""

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from anysim.task.env import TaskEnv
from anysim_client.env import STAYS
from anysim_client.errors import ConnectionLost, ServiceError
from anysim_client.pool import PooledEnv
from anysim_serving.server import Service
from tests.plugins.serving.helpers import BLOCKS, local, same, service

ACTION = np.zeros((4, 0))


@pytest.fixture
def two() -> Iterator[list[Service]]:
    with service() as one, service() as other:
        yield [one, other]


def pool(services: list[Service], **options: Any) -> PooledEnv:
    return anysim.connect([one.address for one in services], **options)  # type: ignore[return-value]


@pytest.fixture(autouse=True)
def _one_token(monkeypatch: pytest.MonkeyPatch) -> None:
    """All services of a pool have the token of the environment."""
    from tests.plugins.serving import helpers

    monkeypatch.setenv("ANYSIM_SERVE_TOKEN", "t" * 40)
    monkeypatch.setattr(helpers, "fresh_token", lambda: "t" * 40)


def test_it_has_what_an_env_has(two: list[Service]) -> None:
    with pool(two, num_envs=1) as env:
        names = {name for name in dir(TaskEnv) if not name.startswith("_")} | {"engine", "name", "num_envs", "streams"}
        assert names - STAYS - {"sensor_rows", "located"} <= set(dir(env))
        assert (env.num_envs, len(env.members)) == (2, 2)


def test_results_are_those_of_one_local_env(two: list[Service]) -> None:
    with pool(two, num_envs=2) as far, local(num_envs=4) as near:
        assert same(far.reset(seed=6), near.reset(seed=6))
        for t in range(4):
            mask = np.array([True, False, True, True]) if t == 2 else None
            assert same(tuple(far.step(ACTION, mask)), tuple(near.step(ACTION, mask)))
        mask = np.array([False, True, True, False])
        overrides = [{"layout.red.x": 0.1}, {"layout.red.x": 0.2}]
        assert same(far.reset(mask=mask, overrides=overrides), near.reset(mask=mask, overrides=overrides))
        assert same(far.obs, near.obs)
        assert same(far.info, near.info)
        assert same(far.status, near.status)
        theirs, ours = far.snapshot(), near.snapshot()
        assert theirs.streams == ours.streams
        assert same(dict(theirs.engine.data), dict(ours.engine.data))
        for _ in range(2):
            far.step(ACTION)
            near.step(ACTION)
        order = [3, 1, 0, 2]
        assert same(far.reset_to(ours, order), near.reset_to(ours, order))
        assert same(far.reset(), near.reset())  # the streams went along
        with pytest.raises(TaskError, match="cannot be overridden"):
            far.reset(overrides={"nothing": 1})
        with pytest.raises(TaskError, match="cannot be overridden"):
            near.reset(overrides={"nothing": 1})
        assert same(far.reset(), near.reset())


def test_the_loss_of_a_member_costs_its_envs_alone() -> None:
    """They fault in the step that finds it out; the others go on, and their episodes are those of a local env."""
    with ExitStack() as stack:
        one = stack.enter_context(service())
        dying = ExitStack()
        other = dying.enter_context(service())
        far = stack.enter_context(pool([one, other], num_envs=2))
        near = stack.enter_context(local(num_envs=4))
        assert same(far.reset(seed=6), near.reset(seed=6))
        dying.close()
        here = slice(0, 2)
        result, wanted = far.step(ACTION), near.step(ACTION)
        assert same(result.reward[here], wanted.reward[here])
        assert np.isnan(result.reward[2:]).all()
        assert result.status.tolist() == ["running", "running", "failed", "failed"]
        assert result.info["fault"].tolist() == [False, False, True, True]
        assert same(result.obs["policy"][here], wanted.obs["policy"][here])
        with pytest.raises(TaskError, match=r"reset\(mask=...\) before step"):
            far.step(ACTION)
        going = np.array([True, True, False, False])
        assert same(far.step(ACTION, going).reward, near.step(ACTION, going).reward)
        # a service that is there takes the envs of the one that is not
        near.retire(np.array([2, 3]))
        assert same(far.reset(mask=~going), near.reset(mask=~going))
        assert far.members[1].address.address == one.address
        for _ in range(2):
            assert same(tuple(far.step(ACTION)), tuple(near.step(ACTION)))
        assert far.losses == 1


def test_where_nobody_is_left_it_is_told() -> None:
    with service() as one:
        far = pool([one], num_envs=4)
        far.reset(seed=0)
    far.step(ACTION)
    with pytest.raises(ConnectionLost, match="found no service"):
        far.reset()
    with pytest.raises(ConnectionLost, match="reset them first"):
        far.snapshot()
    far.close()


def test_services_that_differ_are_no_pool() -> None:
    other = {**BLOCKS, "task": {**BLOCKS["task"], "horizon": 9}}
    with service() as one, service(other) as two, pytest.raises(ServiceError, match="spec hash"):
        pool([one, two])
    with pytest.raises(TaskError, match="has an address"):
        anysim.connect([])
