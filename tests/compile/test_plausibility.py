"""Bounds of physics: what no engine can hold is refused where it is written, before anything is built."""

from typing import Any

import pytest

from anysim.api import compile_world, load
from anysim.errors import SpecError
from anysim.model.world import World
from anysim_schemas.bounds import DEFAULT_EXTENT


def compiled(thing: dict[str, Any], place: Any = (0, 0, 1), **physics: float) -> World:
    world = {"objects": {"a": thing}, "layout": {"a": {"position": list(place)}}}
    return compile_world(load({"world": world, "physics": physics}))


BOX = {"box": [0.1, 0.1, 0.1]}


@pytest.mark.parametrize(
    ("thing", "told"),
    [
        ({"source": {"cylinder": [1e30, 1e30]}}, "source.cylinder.0: must be at most 10000"),
        ({"source": {"box": [1e300, 1, 1]}}, "source.box.0: must be at most 10000"),
        ({"source": {"sphere": 1e-9}}, "source.sphere: must be at least 0.0001"),
        ({"source": BOX, "mass": 1e12}, r"mass: must be at most 1e\+09"),
        ({"source": BOX, "mass": {"range": [1, 1e300]}}, r"must be at most 1e\+09"),
        ({"source": BOX, "density": 1e9}, r"density: must be at most 1e\+06"),
        ({"source": BOX, "scale": 1e9}, r"scale: must be at most 1e\+06"),
        ({"source": BOX, "scale": 1e6}, r"source: one of its sizes is 1e\+05 m; from 0.0001 to 10,000 m is possible"),
        ({"source": BOX, "scale": 1e-5}, r"source: one of its sizes is 1e-06 m; .* sink through the ground"),
        ({"source": {"box": [1000, 1000, 10]}}, r"source: its mass is 1e\+10 kg; from 1e-9 to 1e9 kg is possible"),
        ({"source": {"sphere": 0.00015}, "mass": 1e-9}, "mass: one of its moments of inertia is 9e-18 kg m"),
    ],
)
def test_sizes_and_masses_have_bounds_with_a_reason(thing: dict[str, Any], told: str) -> None:
    with pytest.raises(SpecError, match=told):
        compiled(thing)


def test_what_is_fixed_may_weigh_anything() -> None:
    assert compiled({"source": {"box": [1000, 1000, 10]}, "fixed": True}).bodies


@pytest.mark.parametrize("dt", [0.1, 1.0, 1e-9])
def test_time_steps_have_bounds(dt: float) -> None:
    with pytest.raises(SpecError, match=r"physics.dt: must be at (most 0.05|least 1e-06)"):
        compiled({"source": BOX}, dt=dt, control_dt=1.0)


def test_everything_begins_inside_of_the_world() -> None:
    with pytest.raises(SpecError, match=r"world.layout.a: 'a' begins 2e\+04 m from the origin, beyond the world's end"):
        compiled({"source": BOX}, (0, 2e4, 1))
    assert compiled({"source": BOX}, (0, 2e4, 1), extent=3e4).physics.extent == 3e4


def test_an_extent_that_is_not_given_changes_no_hash() -> None:
    default, same = compiled({"source": BOX}), compiled({"source": BOX}, extent=DEFAULT_EXTENT)
    assert default.hash == same.hash
    assert compiled({"source": BOX}, extent=5.0).hash != default.hash
