"""A world to an MJCF file and back through `world.source`: the same world within rounding, names and all."""

from dataclasses import fields, is_dataclass
from math import inf
from typing import Any

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.errors import AnysimError
from anysim.model.world import World
from anysim_export_model.scene import scene_of, scene_of_world
from anysim_export_model.write import write

WORLD = {
    "physics": {"dt": 0.004, "gravity": [0, 0, -3.7]},
    "world": {
        "name": "three_things",
        "terrain": {"kind": "plane", "friction": 0.7},
        "objects": {
            "crate": {"source": {"box": [0.2, 0.1, 0.1]}, "mass": 0.5, "friction": 0.4, "color": "red"},
            "oven": {"source": {"procedural": "microwave"}, "fixed": True},
            "mug": {"source": {"procedural": "mug"}},
        },
        "layout": {
            "crate": {"position": [0.5, 0, 0.2], "yaw": 0.4, "roll": 0.2},
            "oven": {"position": [0, 0.8, 0.0], "yaw": 1.5707963267948966},
            "mug": {"position": [-0.4, 0, 0.1], "pitch": 1.5707963267948966},
        },
        "cameras": {"eye": {"from": [1, -1, 1], "look_at": [0, 0, 0.1], "fov": 40, "size": [64, 48]}},
        "lights": {"lamp": {"position": [0, 0, 2], "direction": [0, 0.1, -1], "color": [1, 1, 0.5]}},
        "collisions": {"exclude": [["crate", "mug"]]},
    },
}


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[World, World]:
    """A world, and the world of the file that it was written to."""
    world = compile_world(WORLD)
    written = write(scene_of_world(world), "mjcf", tmp_path_factory.mktemp("written"))
    return world, compile_world({"world": {"source": str(written.files[0])}})


def numbers(value: Any) -> list[Any]:
    """What a value of a part holds, flat."""
    if is_dataclass(value):
        value = [getattr(value, field.name) for field in fields(value)]
    return [leaf for one in value for leaf in numbers(one)] if isinstance(value, tuple | list) else [value]


def differences(one: Any, other: Any) -> dict[str, float]:
    """The fields of two parts that differ, and by how much; infinite where they are no numbers."""
    found: dict[str, float] = {}
    for field in fields(one):
        values = getattr(one, field.name), getattr(other, field.name)
        if values[0] != values[1]:
            pairs = zip(numbers(values[0]), numbers(values[1]), strict=True)
            found[field.name] = max(abs(a - b) if isinstance(a, float | int) else inf for a, b in pairs if a != b)
    return found


@pytest.mark.parametrize("kind", ["bodies", "joints", "geoms", "sites", "lights", "cameras"])
def test_parts_are_the_same_to_rounding(pair: tuple[World, World], kind: str) -> None:
    one, other = (getattr(world, kind) for world in pair)
    assert [part.name for part in one] == [part.name for part in other]
    worst = {part.name: differences(part, back) for part, back in zip(one, other, strict=True)}
    assert {name: found for name, found in worst.items() if any(v > 1e-12 for v in found.values())} == {}


def test_what_is_around_them_is_the_same(pair: tuple[World, World]) -> None:
    one, other = pair
    assert (one.name, one.physics, one.excluded_pairs) == (other.name, other.physics, other.excluded_pairs)
    assert [entity.name for entity in one.entities] == [entity.name for entity in other.entities]
    assert [entity.family for entity in one.entities] == [entity.family for entity in other.entities]
    assert np.abs(one.initial_body_pose - other.initial_body_pose).max() < 1e-12


def test_the_name_of_an_asset_hints_at_its_source() -> None:
    with pytest.raises(AnysimError, match="the asset of that name is 'procedural:microwave'"):
        scene_of("microwave")
