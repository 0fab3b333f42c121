"""Arrays and whole numbers from what callers give."""

from datetime import datetime
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.math.arrays import numbers, whole, wholes

ITSELF: list[Any] = []
ITSELF.append(ITSELF)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([[1.0], [1.0, 2.0]], "x has rows of different lengths"),
        ("abc", "x must hold real numbers, got values of type <U3"),
        ([["1"], ["2"]], "values of type <U1"),
        (np.ones(2) + 1j, "values of type complex128"),
        (np.array(["2020-01-01"], dtype="datetime64[D]"), r"values of type datetime64\[D\]"),
        (np.zeros(2, dtype="timedelta64[s]"), r"values of type timedelta64\[s\]"),
        ([datetime(2020, 1, 1)], "values of type datetime"),
        (np.ma.masked_array([1.0], mask=[True]), "x is a masked array; fill what is masked"),
        ([None], "values of type NoneType"),
        (None, "values of type NoneType"),
        (np.zeros(2, dtype=[("a", float)]), "values of type"),
        ([10**400], "a whole number that is too large for a float"),
        (ITSELF, "x cannot become an array"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_no_array_of_numbers_is_refused(values: object, told: str) -> None:
    with pytest.raises(TaskError, match=told):
        numbers("x", values, TaskError)


def test_numbers_of_every_kind_become_floats() -> None:
    own = np.array([0.5, 1.5])
    assert numbers("x", own, TaskError) is own
    for values in ([1, 2], (1.0, 2.0), np.array([1, 2], np.uint8), [True, 2], [np.float32(1), Fraction(2)]):
        found = numbers("x", values, TaskError)
        assert found.dtype == np.float64
        assert found.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("value", [1.5, "1", None, True, np.bool_(1), float("nan"), [1], {}, b"1", np.array([1])])
def test_what_is_no_whole_number_is_refused(value: object) -> None:
    with pytest.raises(TaskError, match="seed must be a whole number, got "):
        whole("seed", value, TaskError)


def test_whole_numbers_have_bounds() -> None:
    assert whole("seed", np.int64(3), TaskError) == 3
    assert whole("seed", 2**64 - 1, TaskError) == 2**64 - 1
    for value in (-1, 2**64, 2**70, 10**5000):
        with pytest.raises(TaskError, match=r"seed must be from 0 to 2\^64 - 1, got "):
            whole("seed", value, TaskError)


@pytest.mark.parametrize("values", [5, "ab", None, {}, [1], [1, 2, 3], np.zeros((2, 2)), {1, 2}])
def test_a_list_has_one_number_for_each(values: object) -> None:
    with pytest.raises(TaskError, match=r"seeds must be a (list of 2 )?whole number"):
        wholes("seeds", values, 2, TaskError)


def test_lists_of_whole_numbers() -> None:
    assert wholes("seeds", np.array([1, 2**63], np.uint64), 2, TaskError) == [1, 2**63]
    assert wholes("seeds", range(2), 2, TaskError) == [0, 1]
