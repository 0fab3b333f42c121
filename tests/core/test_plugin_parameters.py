"""Parameters of plugins: constructors that hand `**options` on to their base have its parameters too."""

from typing import Annotated, TypedDict, Unpack

import pytest
from pydantic import Field, ValidationError

from anysim.errors import SpecError
from anysim.plugin_parameters import checked, options_model, parameters


class Options(TypedDict, total=False):
    speed: Annotated[float, Field(gt=0)]


class Base:
    def __init__(self, channel: str, *, speed: Annotated[float, Field(gt=0)] = 0.5) -> None:
        self.channel, self.speed = channel, speed


class Heir(Base):
    def __init__(self, channel: str, *, gain: int = 2, **options: Unpack[Options]) -> None:
        super().__init__(channel, **options)
        self.gain = gain


class Silent(Heir):
    """Has the constructor of its base."""


class Grandchild(Silent):
    def __init__(self, channel: str, *, gain: int = 3, mode: str = "slow", **options: Unpack[Options]) -> None:
        super().__init__(channel, gain=gain, **options)
        self.mode = mode


class Loose:
    def __init__(self, *, size: int = 1, **options: object) -> None:
        self.size, self.options = size, options


def test_what_is_handed_on_comes_first() -> None:
    assert list(parameters(Heir)) == ["speed", "gain"]
    assert list(parameters(Silent)) == ["speed", "gain"]
    assert list(parameters(Base)) == ["speed"]


def test_own_defaults_win_over_those_of_the_base() -> None:
    assert {name: p.default for name, p in parameters(Grandchild).items()} == {"speed": 0.5, "gain": 3, "mode": "slow"}


def test_what_is_handed_on_is_checked_and_reaches_the_base() -> None:
    given = options_model(Grandchild).model_validate({"speed": 2.0, "mode": "fast"})
    made = Grandchild("arm", **given.model_dump())
    assert (made.channel, made.speed, made.gain, made.mode) == ("arm", 2.0, 3, "fast")
    with pytest.raises(ValidationError, match="greater than 0"):
        options_model(Grandchild).model_validate({"speed": -1.0})
    with pytest.raises(ValidationError, match="Extra inputs"):
        options_model(Grandchild).model_validate({"sped": 1.0})


def test_what_is_wrong_is_said_as_of_files() -> None:
    for params, message in (
        ({"sped": 1.0}, "option.sped: unknown key; did you mean 'speed'?"),
        ({"x": 1.0}, "option.x: unknown key; the keys here are speed, gain, mode"),
        ({"speed": 0}, "option.speed: must be greater than 0, got 0"),
        ({"gain": "many"}, "option.gain: expected a whole number, got the text 'many'"),
    ):
        with pytest.raises(SpecError) as raised:
            checked(options_model(Grandchild), params, "option")
        assert str(raised.value).strip() == message


def test_options_that_are_handed_to_no_base_are_no_parameters() -> None:
    assert list(parameters(Loose)) == ["size"]
