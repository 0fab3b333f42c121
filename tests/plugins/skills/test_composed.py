"""Commands composed of others, on real engines: each solves a small world."""

import pytest

from anysim import make
from anysim.errors import SpecError
from anysim.skills.base import Outcome
from anysim.skills.runner import SkillPolicy
from tests.plugins.skills.test_honest_failures import given_up
from tests.plugins.skills.test_manipulation import WORLDS, solved
from tests.tiers import others_in_turn

COMPOSED = ["tidy", "stack_two", "lift_and_regrasp", "unplug", "place_near"]


@pytest.mark.parametrize("world", COMPOSED)
def test_it_is_solved_on_mujoco(world: str) -> None:
    assert solved(world, "mujoco", 2) == 1.0


@pytest.mark.parametrize(("world", "engine"), others_in_turn(COMPOSED))
def test_it_is_solved_on_the_other_engines(world: str, engine: str) -> None:
    assert solved(world, engine, 4) >= 0.75


@pytest.mark.parametrize(
    ("objects", "said"), [("[cube, cubee]", "objects.1.*cubee"), ("[cube, cube]", "objects.1.*twice")]
)
def test_a_wrong_name_is_told_at_its_key(objects: str, said: str) -> None:
    change = f"collect.commands=[{{do: tidy, objects: {objects}, target: tray}}]"
    with make(WORLDS / "tidy.yaml", engine="mujoco", overrides=[change]) as env, pytest.raises(SpecError, match=said):
        SkillPolicy(env)


def test_where_there_is_no_room_beside_it_nothing_is_touched() -> None:
    outcomes, said = given_up("place_near", "collect.commands.0.gap=0.3")
    assert set(outcomes) == {Outcome.ADVERSE_STATE}
    assert said["phase"] == "1 place_near: side: choose a side"
