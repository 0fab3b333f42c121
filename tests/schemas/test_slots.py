"""The slots of plugins are checked with the models of the plugins, and only they."""

import pytest
from pydantic import BaseModel, ConfigDict

from anysim_schemas.errors import AnysimError, SpecError
from anysim_schemas.load import load_run
from anysim_schemas.plugin import UnknownPlugin


def issues(data, resolver):
    with pytest.raises(SpecError) as caught:
        load_run(data, resolver=resolver)
    return [str(issue) for issue in caught.value.issues]


def test_without_a_resolver_slots_are_not_checked():
    assert load_run({"engine": {"name": "nowhere", "options": {"x": 1}}}).spec.engine.options == {"x": 1}


def test_the_resolver_is_asked_for_what_is_written():
    asked = []

    def resolver(kind, name):
        asked.append((kind, name))

    data = {
        "engine": "bullet",
        "world": {"robots": {"arm": {"robot": "r", "actions": {"arm": "pd", "eef": {"controller": "grip"}}}}},
        "task": {
            "command": {"goal": None},
            "observations": {"policy": ["q", {"term": "dq"}], "privileged": ["pose"]},
            "rewards": {"reach": {"weight": 1}, "lift": {"term": "height"}, "act": "effort"},
            "success": {"near": None},
            "failure": {"fell": {}},
            "events": {"push": {"when": "step"}},
            "expert": {"skill": "pick"},
        },
        "record": {"writer": "csv"},
    }
    load_run(data, resolver=resolver)
    assert asked == [
        ("engine", "bullet"),
        ("controller", "pd"),
        ("controller", "grip"),
        ("command", "goal"),
        ("observation", "q"),
        ("observation", "dq"),
        ("observation", "pose"),
        ("reward", "reach"),
        ("reward", "height"),
        ("reward", "effort"),
        ("predicate", "near"),
        ("predicate", "fell"),
        ("event", "push"),
        ("skill", "pick"),
        ("writer", "csv"),
    ]


def test_a_default_name_is_checked_where_its_options_are_given():
    asked = []

    def resolver(kind, name):
        asked.append((kind, name))

    load_run({"record": {"cameras": ["front"]}, "engine": {}}, resolver=resolver)
    assert asked == []
    with pytest.raises(SpecError) as caught:
        load_run({"record": {"options": {"level": 3}}}, resolver=resolver)
    assert asked == [("writer", "mcap")]
    assert "takes no parameters" in str(caught.value)


def test_slots_are_checked_although_the_core_is_wrong(resolver):
    data = {
        "seed": -1,
        "engine": {"name": "mujoco", "options": {"iterations": 0}, "shard": 2},
        "task": {"expert": {"skill": "x"}},
    }
    assert [line.split(": ")[0] for line in issues(data, resolver)] == [
        "engine.shard",
        "seed",
        "task.observations",
        "engine.options.iterations",
        "task.expert.skill",
    ]


def test_options_that_are_no_mapping_are_reported_once(resolver):
    assert issues({"engine": {"name": "mujoco", "options": 3}}, resolver) == [
        "engine.options: expected a mapping, got the number 3"
    ]


def test_other_errors_of_a_resolver_that_are_meant_for_people_become_issues():
    def resolver(kind, name):
        raise AnysimError(f"the {kind} '{name}' does not load")

    assert issues({"engine": "x"}, resolver) == ["engine.name: the engine 'x' does not load"]

    def buggy(kind, name):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        load_run({"engine": "x"}, resolver=buggy)


def test_plugins_may_use_any_pydantic_model():
    class Left(BaseModel):
        model_config = ConfigDict(extra="forbid")
        side: str
        left: int

    class Right(BaseModel):
        model_config = ConfigDict(extra="forbid")
        right: dict[str, list[int]]

    class Options(BaseModel):
        hand: Left | Right | None = None
        speeds: list[float] = []

    def resolver(kind, name):
        if name != "e":
            raise UnknownPlugin(name)
        return Options

    def engine(**options):
        return {"engine": {"name": "e", "options": options}}

    load_run(engine(hand={"right": {"a": [1]}}, speeds=[1, 2]), resolver=resolver)
    assert issues(engine(hand={"right": {"a": ["x"]}}, speeds=[1, "y"]), resolver) == [
        "engine.options.hand.right.a.0: expected a whole number, got the text 'x'",
        "engine.options.speeds.1: expected a number, got the text 'y'",
    ]
    assert issues(engine(hand={"side": "a", "left": "b"}), resolver) == [
        "engine.options.hand.left: expected a whole number, got the text 'b'"
    ]
    assert issues(engine(hand=5), resolver) == ["engine.options.hand: expected a mapping, got the number 5"]
