"""Declared approximations: the numbers of a note are data, and no error is larger than the engine says."""

from math import isfinite

import pytest

from anysim.engine.capability import Capability as C
from anysim.testing.errors import MEASURES, allowed
from anysim.testing.fixtures import needs, skip_without


def test_declared_errors_are_known_and_finite(engine_class):
    """A number that no test measures is none: each belongs to its capability, is finite and not negative."""
    for capability, support in engine_class.capabilities.supported.items():
        for name, error in support.errors.items():
            there = sorted(n for n, measure in MEASURES.items() if measure.capability is capability)
            assert name in there, f"'{capability}' declares '{name}', which no test measures (there are: {there})"
            assert isfinite(error), f"'{capability}': '{name}' is {error}"
            assert error >= 0.0, f"'{capability}': '{name}' is {error}"
            assert not support.exact, f"'{capability}' is declared exact, with an error of {error}"


@needs(C.DYNAMICS)
@pytest.mark.parametrize("name", MEASURES)
def test_an_error_is_no_larger_than_declared(build, engine_class, name):
    """In the world that defines it the engine is off by no more than it says, or by no more than an exact one."""
    measure = MEASURES[name]
    skip_without(engine_class, measure.capability)
    error, limit = measure.found(build), allowed(engine_class.capabilities, name)
    assert error <= limit, f"{name} ({measure.what}) is {error:.3g}; {limit:.3g} is declared or allowed"
