"""YAML to plain data with places: the scalars of YAML 1.2, and nothing that runs, repeats or explodes."""

import math

import pytest
from hypothesis import example, given, settings, strategies as st

from anysim_schemas import yaml as spec_yaml
from anysim_schemas.limits import YAML_ALIASED, YAML_DEPTH
from anysim_schemas.nodes import Node
from anysim_schemas.yaml import parse


def read(text):
    faults = []
    node = parse(text, "f.yaml", faults)
    return (None if node is None else node.plain()), [f"{fault.mark}: {fault.message}" for fault in faults]


def good(text):
    data, faults = read(text)
    assert faults == []
    return data


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("true", True),
        ("False", False),
        ("yes", "yes"),
        ("on", "on"),
        ("off", "off"),
        ("y", "y"),
        ("null", None),
        ("~", None),
        ("", None),
        ("Nope", "Nope"),
        ("12", 12),
        ("-3", -3),
        ("+4", 4),
        ("014", 14),
        ("0o14", 12),
        ("0x1f", 31),
        ("0b1", "0b1"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("1e-3", 1e-3),
        ("1E3", 1000.0),
        (".5", 0.5),
        ("1.", 1.0),
        ("-2.5", -2.5),
        (".inf", math.inf),
        ("-.Inf", -math.inf),
        ("2001-01-01", "2001-01-01"),
        ("1.2.3", "1.2.3"),
        ("'1'", "1"),
        ('"true"', "true"),
        ("=", "="),
        ("!!str 5", "5"),
        ("!!float 1", 1.0),
        ("'<<'", "<<"),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text, value):
    result = good(f"key: {text}")["key"]
    assert (result, type(result)) == (value, type(value))


def test_not_a_number_is_read():
    assert math.isnan(good("key: .nan")["key"])


def test_keys_are_text_as_written():
    assert good("on: 1\ntrue: 2\n3: 4\nnull: 5\n'': 6") == {"on": 1, "true": 2, "3": 4, "null": 5, "": 6}


def test_an_empty_text_is_an_empty_mapping():
    assert good("") == good("# nothing\n") == {}


def test_every_key_and_value_knows_its_place():
    node = parse("a: 1\nlong:\n  - x\n  - {b:  c}\n", "f.yaml", [])
    assert isinstance(node, Node)
    items = node.child("long")
    assert str(items.key) == "f.yaml:2:1"
    assert str(items.mark) == "f.yaml:3:3"
    assert items.place == items.key, "a block that starts below its key is pointed at by the key"
    inner = items.child(1).child("b")
    assert (str(inner.key), str(inner.mark)) == ("f.yaml:4:6", "f.yaml:4:10")


def test_aliases_and_merge_keys():
    text = "base: &b {x: 1, y: 2}\none: *b\ntwo: {<<: *b, y: 3}\nthree:\n  <<: [{y: 4}, *b]\n  z: 5\n"
    data = good(text)
    assert data["one"] == data["base"]
    assert data["two"] == {"x": 1, "y": 3}
    assert data["three"] == {"y": 4, "x": 1, "z": 5}
    assert read("a: {<<: 3}")[1] == ["f.yaml:1:9: `<<` merges a mapping or a list of mappings, such as `<<: *anchor`"]


@pytest.mark.parametrize(
    "tag", ["!!python/object:os.system", "!!python/name:os.system", "!thing", "!!set", "!!binary", "!!omap"]
)
def test_tags_that_construct_are_refused(tag):
    _, faults = read(f"a:\n  b: {tag} {{x: 1}}")
    assert len(faults) == 1
    assert faults[0].startswith("f.yaml:2:6: the tag !")
    assert "refused" in faults[0]


def test_a_tag_that_does_not_fit_is_a_fault():
    assert read("a: !!int x")[1] == ["f.yaml:1:4: the tag !!int does not fit the text 'x'"]


def test_a_duplicate_key_gives_both_places():
    data, faults = read("a: 1\nb: {c: 1, c: 2}\na: 3\n")
    assert data == {"a": 1, "b": {"c": 1}}
    assert faults == [
        "f.yaml:2:11: the key 'c' is given twice in one mapping; the first is at f.yaml:2:5",
        "f.yaml:3:1: the key 'a' is given twice in one mapping; the first is at f.yaml:1:1",
    ]


def test_keys_that_are_no_text_are_faults():
    assert read("? [a]\n: 1")[1] == ["f.yaml:1:3: a key must be text, not a list or a mapping"]
    assert read("a: 1\n?\n: 1")[1] == ["f.yaml:2:2: a key is missing before the ':'"]


def test_aliases_are_bounded():
    laughs = "a: &a [x, x, x, x, x, x, x, x, x, x]\n"
    for name, below in zip("bcdefghi", "abcdefgh", strict=True):
        laughs += f"{name}: &{name} [{', '.join([f'*{below}'] * 10)}]\n"
    data, faults = read(laughs)
    assert data is None
    assert YAML_ALIASED.sentence() in faults[0]
    merges = "a: &a {k0: 0}\n" + "".join(f"a{i}: &a{i} {{<<: [*a]}}\n" for i in range(50))
    assert read(merges)[1] == []


def test_an_anchor_that_contains_itself_is_refused():
    assert read("a: &x [*x]")[1] == ["f.yaml:1:4: the value of this anchor contains itself"]


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize(
    "text",
    [
        "[" * 1000,
        "[" * 100_000,
        "{a: " * 3000 + "}" * 3000,
        "- " * 3000,
        "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, 300)),
    ],
    ids=["open", "wide open", "mappings", "block", "aliases"],
)
def test_depth_is_bounded(text, fast, monkeypatch):
    if not fast:
        monkeypatch.setattr(spec_yaml, "_C_LOADER", None)
    assert read(text) == (None, [f"f.yaml:1:1: the file {YAML_DEPTH.sentence()}"])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a:\n\tb: 1", "f.yaml:2:1: not valid YAML: a tab cannot indent; use spaces"),
        ("a: *b", "f.yaml:1:4: not valid YAML: the alias *b has no anchor &b before it"),
        (
            "a: &x 1\nb: &x 2",
            "f.yaml:2:4: not valid YAML: the anchor is defined twice; the first is at line 1, column 4",
        ),
        (
            "a: 1\n---\nb: 2",
            "f.yaml:2:1: not valid YAML: a spec is one document, but a second one starts here with '---'",
        ),
        ("a: @x", "f.yaml:1:4: not valid YAML: a plain text cannot start with '@'; put the text in quotes"),
        ("a: 'x", "f.yaml:1:6: not valid YAML: the quote that is opened at line 1, column 4 is not closed"),
        ("a: [1,, 2]", "f.yaml:1:7: not valid YAML: a key or a value is missing here"),
        ('a: "\\q"', "f.yaml:1:6: not valid YAML: \\q is no escape; write \\\\ for a backslash, or use single quotes"),
        ("a: 1\nb\nc: 2", "f.yaml:3:1: not valid YAML: expected a ':' after the key that starts at line 2, column 1"),
        ("a: x\x01", "f.yaml:1:5: the character U+0001 is not allowed in YAML"),
        ("a: " + "9" * 400, "f.yaml:1:4: a whole number of 400 digits is too long"),
    ],
)
def test_syntax_errors_are_sentences(text, complaint):
    assert read(text)[1] == [complaint]


@settings(max_examples=200)
@example('a: "\\U00110000"')
@example("%YAML 1.99999\n---\n")
@example('a: "\\ud800"')
@example("&a *a")
@given(st.text(alphabet=st.sampled_from("ab01 .:-[]{}&*!<|>'\"\\#%@`,?~=\t\n\x85\ufeffé"), max_size=30))
def test_no_text_raises(text):
    faults = []
    assert parse(text, "f.yaml", faults) is not None or faults


@settings(max_examples=100)
@given(st.text(alphabet=st.sampled_from("ab01 .:-[]{}&*!'\",?~\n"), max_size=25))
def test_both_readers_agree(text):
    fast = read(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spec_yaml, "_C_LOADER", None)
        slow = read(text)
    assert (fast[0] is None) == (slow[0] is None) or fast[0] is not None
    if fast[0] is None:
        assert fast == slow
