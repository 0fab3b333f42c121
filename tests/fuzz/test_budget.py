"""Budgets of the fuzzers: time and memory are really measured, and faults are really noted."""

import gc
import time

import numpy as np
import pytest

from anysim.errors import TaskError
from tests.fuzz.budget import OverBudgetError, Tally, within


def _busy(seconds: float) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        pass


def test_time_and_memory_are_measured() -> None:
    with pytest.raises(OverBudgetError, match=r"took more than 0.05 s"), within(0.05):
        _busy(1.0)
    gc.collect()  # what is freed on the way would count against what is taken
    with pytest.raises(OverBudgetError, match=r"took \d+ MiB"), within(5.0, 100 << 20):
        np.ones(45 << 20).sum()  # far more: the system may take back other pages of the process meanwhile
    with pytest.raises(MemoryError), within(5.0, 20 << 20):
        np.ones(100 << 20)
    with within(5.0, 200 << 20):
        np.ones(5 << 20).sum()


def test_an_interrupt_that_was_caught_still_counts() -> None:
    def stubborn() -> None:
        try:
            _busy(1.0)
        except BaseException:  # noqa: BLE001
            return

    with pytest.raises(OverBudgetError, match=r"took more than 0.1 s: 0\.\d+ s"), within(0.1):
        stubborn()


def test_an_interrupt_of_which_an_error_was_made_is_no_refusal() -> None:
    """As `anysim.registry.Blame` makes one of whatever comes out of a plugin."""

    def blaming() -> None:
        try:
            _busy(1.0)
        except BaseException as error:
            raise TaskError("the plugin failed") from error

    tally = Tally("calls", 0.1)
    tally.run("blaming", blaming)
    assert (tally.refused, len(tally.faults)) == (0, 1)
    assert "blaming: OverBudgetError: took more than 0.1 s" in tally.faults[0]


def test_inputs_are_counted() -> None:
    tally = Tally("numbers", 0.2)

    def refused() -> None:
        raise TaskError("no")

    def broken() -> None:
        raise ValueError("oh")

    assert tally.run("good", lambda: None) is None
    assert isinstance(tally.run("bad", refused), TaskError)
    tally.passed(2)
    with pytest.raises(AssertionError, match="2 numbers were tried, not 3"):
        tally.passed(3)
    tally.run("raw", broken)
    tally.run("slow", lambda: _busy(1.0))
    assert (tally.inputs, tally.accepted, tally.refused, len(tally.faults)) == (4, 1, 1, 2)
    with pytest.raises(AssertionError, match=r"raw: ValueError: oh \(test_budget.py:\d+"):
        tally.passed(4)
