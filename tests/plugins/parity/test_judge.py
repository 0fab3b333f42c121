"""Judgements of engines by measures."""

from anysim_parity.judge import agreement, errors, largest_gap, nearest, outside
from anysim_parity.result import Measure


def test_with_an_answer_engines_are_held_against_it() -> None:
    measure = Measure("height", "m", {"a": 1.1, "b": 0.98, "c": 1.0}, 1.0, 0.05)
    assert nearest(measure) == ("c",)
    assert largest_gap(measure) == errors(measure)["a"]
    assert agreement(measure) is False
    assert outside(measure) == ("a",)
    assert agreement(measure._replace(tolerance=0.11)) is True


def test_without_an_answer_they_are_held_against_each_other() -> None:
    measure = Measure("height", "m", {"a": 1.5, "b": 1.0, "c": 1.25}, None, 0.25)
    assert nearest(measure) == ()
    assert largest_gap(measure) == 0.5
    assert agreement(measure) is False
    assert outside(measure) == ()


def test_what_cannot_be_judged_is_not() -> None:
    assert agreement(Measure("x", "", {"a": 1.0, "b": 2.0}, 1.0)) is None
    assert agreement(Measure("x", "", {"a": 1.0}, None, 0.1)) is None
    assert largest_gap(Measure("x", "", {}, 1.0, 0.1)) is None
    assert nearest(Measure("x", "", {}, 1.0, 0.1)) == ()
