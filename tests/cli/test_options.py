"""Options whose values are several, separated by commas."""

import pytest

from anysim.cli.options import numbers, parts
from anysim.errors import TaskError


def test_words_and_numbers_are_told_apart_by_commas() -> None:
    assert parts(" mujoco, sapien,", "--engines") == ["mujoco", "sapien"]
    assert numbers("1, 4", "--num-envs", int, 1) == [1, 4]
    assert numbers("0.3", "--speeds", float, 0.05) == [0.3]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("snad", r"--kinds: there is no 'snad'; did you mean 'sand'\? \(there are: sand, rice\)"),
        (" , ", "--kinds: there is no ' , '"),
    ],
)
def test_a_word_that_there_is_not_is_told(text: str, said: str) -> None:
    with pytest.raises(TaskError, match=said):
        parts(text, "--kinds", ["sand", "rice"])


@pytest.mark.parametrize("text", ["x", "0", "1.5", "inf"])
def test_what_is_no_number_of_the_kind_is_told(text: str) -> None:
    with pytest.raises(TaskError, match=r"-n .*: expected whole numbers of at least 1, separated by commas"):
        numbers(text, "-n", int, 1)
