"""Salvage of a faulty file: wrong parts are left out only where the rest then says nothing false."""

import pytest

from anysim_schemas.errors import SpecError, SpecIssue
from anysim_schemas.load import load_run

CUBE = {"source": {"box": [0.1, 0.1, 0.1]}}


def test_unknown_keys_are_told_and_the_rest_is_loaded() -> None:
    past: list[SpecIssue] = []
    data = {"worlds": {"objects": {"cube": {**CUBE, "masss": 2.0, "friction": -1.0}}}, "seed": 3}
    found = load_run(data, past=past)
    assert {issue.path for issue in past} == {"worlds", "world.objects.cube.masss", "world.objects.cube.friction"}
    cube = found.spec.world.objects["cube"]
    assert (cube.mass, cube.friction, found.spec.seed) == (2.0, None, 3)
    assert found.provenance["world.objects.cube.mass"] == "data"


def test_a_right_file_is_loaded_as_ever() -> None:
    past: list[SpecIssue] = []
    data = {"world": {"objects": {"cube": CUBE}}}
    assert load_run(data, past=past) == load_run(data)
    assert past == []


@pytest.mark.parametrize(
    "data",
    [
        {"world": {"things": {"cube": CUBE}}},
        {"world": {"objects": {"cube": 5}}},
        {"world": {"objects": {"cube": {"source": {"ball": 1}}}}},
        {"physics": {"dt": 0.003, "control_dt": 0.02}},
        {"world": {"cameras": {"eye": {"from": [1, 2], "look_at": [0, 0, 0]}}}},
    ],
)
def test_what_others_may_refer_to_is_not_left_out(data: dict[str, object]) -> None:
    """The message is that of a load without `past`, and `past` stays empty."""
    past: list[SpecIssue] = []
    with pytest.raises(SpecError) as plain:
        load_run(data)
    with pytest.raises(SpecError) as caught:
        load_run(data, past=past)
    assert caught.value.issues == plain.value.issues
    assert past == []
