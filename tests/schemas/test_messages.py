"""No words of pydantic reach a person: every error type has a sentence."""

import re
from pathlib import Path

import pytest
from pydantic import ValidationError
from pydantic_core._pydantic_core import list_all_errors

from anysim_schemas.errors import SpecError
from anysim_schemas.load import load_run
from anysim_schemas.messages import describe, sentence, shown

LEAKS = (
    *(
        "Input should",
        "Input must",
        "Extra inputs",
        "Field required",
        "Value error",
        "Assertion",
        "should be",
        "valid ",
    ),
    *("pydantic", "None", "tuple", "dict"),
)
GOOD = Path(__file__).parent / "good" / "pick.yaml"
NAN = float("nan")
JUNK = (
    *(None, True, -7, NAN, "junk", [None, -1, {}], {"junk": 1}, [[1, 2], [3]]),
    *({"range": [3, 1]}, {"choice": [[], {}]}, {"normal": {"mean": "x"}}),
)

OWN_WORDS = ("value_error", "assertion_error")
"""Errors of the validators of the specs, whose sentences are passed on."""


@pytest.mark.parametrize(
    "error", [e for e in list_all_errors() if e["type"] not in OWN_WORDS], ids=lambda error: error["type"]
)
def test_every_error_type_has_a_sentence(error):
    text = sentence(error["type"], error.get("example_context") or {}, "abc", error["message_template_python"])
    assert text
    assert "{" not in text
    assert "?" not in text
    assert not [leak for leak in LEAKS if leak in text]


@pytest.mark.parametrize("kind", OWN_WORDS)
def test_the_words_of_validators_are_passed_on(kind):
    assert sentence(kind, {"error": ValueError("too blue")}, 3, "Value error, too blue") == "too blue"


def places(value, path=()):
    yield path
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield from places(child, (*path, key))


def replaced(value, path, junk):
    """A copy of the data with junk at the path."""
    if not path:
        return junk
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(value[path[0]], path[1:], junk)
    return copy


@pytest.mark.parametrize("junk", JUNK, ids=str)
def test_junk_anywhere_is_answered_in_sentences(junk, resolver):
    """Each value of a whole run is replaced by junk: what is refused is refused in words for people."""
    data = load_run(GOOD).data
    refused = 0
    for path in [path for path in places(data) if path]:
        try:
            load_run(replaced(data, path, junk), resolver=resolver)
        except SpecError as error:
            refused += 1
            for issue in error.issues:
                assert not [leak for leak in LEAKS if leak in issue.message], (path, issue)
                assert not re.search(r"as:|\[|\]", issue.path), (path, issue)
                steps = ".".join(map(str, path))
                assert issue.path.startswith(steps) or steps.startswith(issue.path.rpartition(".")[0]), (path, issue)
    assert refused > 30


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "nothing (null)"),
        (True, "true"),
        ("abc", "the text 'abc'"),
        (3, "the number 3"),
        ([], "an empty list"),
        ([1], "a list of 1 item"),
        ([1, 2], "a list of 2 items"),
        ({}, "an empty mapping"),
        ({"a": 1}, "a mapping with the key 'a'"),
        ({"a": 1, "b": 2}, "a mapping with the keys 'a', 'b'"),
    ],
)
def test_values_are_described(value, words):
    assert describe(value) == words


def test_long_values_are_cut():
    assert len(shown("x" * 500)) <= 60


def test_a_sentence_of_a_plugin_is_kept():
    assert sentence("my_own_type", {}, 3, "three is company") == "three is company"


def test_a_spec_made_in_python_still_raises_pydantic_errors():
    from anysim_schemas.engine import PhysicsSpec

    with pytest.raises(ValidationError):
        PhysicsSpec(dt=0.003)
