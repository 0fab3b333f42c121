"""Declared approximations: the numbers of a note are data, and no error is larger than the engine says."""

import re
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


NUMBER = re.compile(r"(?<![\w.^])\d+(?:\.\d+)?(?:e-?\d+)?%?")


def test_numbers_of_a_note_are_measured(engine_class):
    """A note has the numbers of its errors, and of the worlds in which they are measured; no others."""
    for capability, support in engine_class.capabilities.supported.items():
        known = {form.format(error) for error in support.errors.values() for form in ("{:g}", "{:.0%}", "{:.1%}")}
        for measure in MEASURES.values():
            if measure.capability is capability:
                known.update(NUMBER.findall(measure.what))
        bare = [number for number in NUMBER.findall(support.note) if number not in known]
        assert not bare, (
            f"'{capability}' says {', '.join(bare)} in its note, which no test measures; declare it by "
            "approximately(note, NAME=…) with a NAME of anysim.testing.errors.MEASURES, or say it without a number"
        )


@needs(C.DYNAMICS)
@pytest.mark.parametrize("name", MEASURES)
def test_an_error_is_no_larger_than_declared(build, engine_class, name):
    """In the world that defines it the engine is off by no more than it says, or by no more than an exact one."""
    measure = MEASURES[name]
    skip_without(engine_class, measure.capability)
    error, limit = measure.found(build), allowed(engine_class.capabilities, name)
    assert error <= limit, f"{name} ({measure.what}) is {error:.3g}; {limit:.3g} is declared or allowed"
