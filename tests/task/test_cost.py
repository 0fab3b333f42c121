"""Costs that are said before a build begins."""

import time
import warnings
from contextlib import contextmanager

import pytest

import anysim
from anysim.errors import EngineError
from anysim.task import cost
from anysim.task.cost import Cost, CostWarning, announce, available, grown, measured, told
from tests.task.helpers import BLOCKS, blocks


def test_more_envs_than_fit_are_refused_before_they_are_built() -> None:
    with pytest.raises(
        EngineError, match=r"1,000,000,000 envs of 'blocks' on null take about .* measured with \d+\)"
    ) as told:
        blocks(10**9)
    assert "lower num_envs" in str(told.value)


def test_the_memory_of_an_env_is_about_what_many_take() -> None:
    each = measured(lambda count: blocks(count))
    assert 500 < each.bytes < 50_000
    assert each.envs >= 4


@pytest.mark.parametrize(("seconds", "size", "told"), [(1e-4, 10, False), (1e-2, 10, True)])
def test_what_takes_long_is_said(seconds: float, size: float, told: bool) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        announce("envs", 10_000, Cost(seconds, size, 4), "lower num_envs")
    assert [str(one.message) for one in caught] == (
        ["building 10,000 envs takes about 100 s and 9.3e-05 GiB (0.00977 KiB and 10 ms each, measured with 4)"]
        if told
        else []
    )


def test_seconds_may_grow_faster_than_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured with a tenth of them: where an engine is slow alone from there on, a few would not show it."""
    monkeypatch.setattr(cost, "_of", lambda _build, number: (0.0, 5.0 * number))
    monkeypatch.setattr(cost, "_seconds", lambda _build, number: (number / 500) ** 2)

    @contextmanager
    def nothing(_number: int):
        yield

    found = grown(nothing, 20_000)
    assert (found.seconds * 20_000, found.bytes, found.envs) == (pytest.approx(1600.0), 5.0, 2000)


def test_many_instances_are_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cost, "CROWD", 80)
    monkeypatch.setattr(cost, "_WORTH_A_WORD", 0.0)
    ball = {"source": {"sphere": 0.03}, "count": 100}
    spec = BLOCKS | {"world": BLOCKS["world"] | {"objects": BLOCKS["world"]["objects"] | {"many": ball}}}
    with (
        pytest.warns(CostWarning, match=r"building 100 instances of many on null takes about"),
        anysim.make(spec) as env,
    ):
        assert len(env.engine.world.entities) == 103


@pytest.mark.parametrize("live", [True, False])
def test_a_build_says_how_long_it_takes(
    live: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: live)
    with told("building 'blocks'"):
        time.sleep(0.05)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(cost, "_WORTH_A_WORD", 0.01)
    with told("building 'blocks'"):
        time.sleep(0.2)
    line = "building 'blocks': 0 s so far\n"
    assert capsys.readouterr().err == ("\r" if live else "") + line


def test_what_is_free_is_known_here() -> None:
    free = available()
    assert free is not None
    assert free > 1 << 20
