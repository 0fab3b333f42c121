"""The word about the first use of kernels, which compiles them."""

import logging
from types import SimpleNamespace

import pytest
from numba.core import event

from anysim_sensors.kernels.first_use import WORDS, tell_of_compiling


def compiled(module: str) -> None:
    """As numba says when it begins to compile a function of a module."""
    function = SimpleNamespace(__module__=module)
    with event.trigger_event("numba:compile", data={"dispatcher": SimpleNamespace(py_func=function)}):
        pass


def test_it_is_said_once_and_of_our_kernels_alone(caplog: pytest.LogCaptureFixture) -> None:
    compiled("anysim_sensors.kernels.rays")  # what the import of kernels has registered has said it by now
    teller = tell_of_compiling()
    try:
        with caplog.at_level(logging.INFO, logger="anysim_sensors"):
            compiled("somebody.kernels")
            assert caplog.messages == []
            compiled("anysim_sensors.kernels.rays")
            compiled("anysim_tactile.kernels.gel")
            assert caplog.messages == [WORDS]
    finally:
        event.unregister("numba:compile", teller)
