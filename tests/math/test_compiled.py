"""Compilation of kernels: where numba has no place for its cache, and the word about their first use."""

import logging
from types import SimpleNamespace
from typing import Any

import numba
import pytest
from numba.core import event

from anysim.math.compiled import FIRST_USE, compiled, tell_of_compiling


def test_kernels_compile_where_no_cache_can_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    real = numba.njit

    def without_a_place(cache: bool = False, **options: Any) -> Any:
        if cache:
            raise RuntimeError("cannot cache function 'f': no locator available for file 'f.py'")
        return real(**options)

    with monkeypatch.context() as numba_alone:  # which compiles some things of its own when it compiles the first
        numba_alone.setattr(numba, "njit", without_a_place)
        kernel = compiled(lambda x: x + 1)
    assert kernel(1) == 2


def test_other_compilation_faults_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(**options: Any) -> Any:
        raise RuntimeError("out of order")

    monkeypatch.setattr(numba, "njit", broken)
    with pytest.raises(RuntimeError, match="out of order"):
        compiled(lambda x: x)


def begins(module: str) -> None:
    """As numba says when it begins to compile a function of a module."""
    function = SimpleNamespace(__module__=module)
    with event.trigger_event("numba:compile", data={"dispatcher": SimpleNamespace(py_func=function)}):
        pass


def test_first_use_is_told_once_and_of_our_kernels_alone(caplog: pytest.LogCaptureFixture) -> None:
    assert tell_of_compiling() is tell_of_compiling()
    begins("anysim.kernels")  # that one has said it by now
    teller = tell_of_compiling.__wrapped__()
    try:
        with caplog.at_level(logging.INFO, logger="anysim"):
            begins("somebody.kernels")
            assert caplog.messages == []
            begins("anysim_sensors.kernels.rays")
            begins("anysim_navigation.kernels.beam")
            assert caplog.messages == [FIRST_USE]
    finally:
        event.unregister("numba:compile", teller)
