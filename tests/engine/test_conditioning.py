"""Ill-conditioned physics: what is warned of at a build, and what is not."""

from typing import Any

import pytest

from anysim.api import compile_world
from anysim.engine.conditioning import PhysicsWarning, damping_ratio, doubts
from anysim.model.world import World
from anysim.testing.kinematic import NullEngine


def stacked(mass: float, size: float = 0.1, dt: float = 0.002, place: tuple[float, float] = (0.0, 0.15)) -> World:
    box = {"box": [size] * 3}
    objects = {"low": {"source": box, "mass": 0.1}, "high": {"source": box, "mass": mass}}
    layout = {"low": {"position": [0, 0, 0.05]}, "high": {"position": [place[0], 0, place[1]]}}
    return compile_world({"physics": {"dt": dt, "control_dt": dt}, "world": {"objects": objects, "layout": layout}})


@pytest.mark.parametrize(
    ("world", "told"),
    [
        (stacked(1.0), []),
        (stacked(100.0), ["'high' begins above 'low' and weighs 1,000 times as much"]),
        (stacked(100.0, place=(1.0, 0.15)), []),
        (stacked(100.0, place=(0.0, 0.05)), []),
        (stacked(0.1, size=0.02, dt=0.02), ["'low' and 1 more: 20 mm thick, and falls 3.9 mm in a step of 0.02 s"]),
        (stacked(0.1, size=0.02, dt=0.005), []),
        (stacked(0.1, size=0.0005), ["use a physics.dt of at most 0.002 s"]),
    ],
    ids=["light", "heavy above", "aside", "beside", "long steps", "short steps", "tiny"],
)
def test_what_is_doubted(world: World, told: list[str]) -> None:
    found = [doubt.sentence for doubt in doubts(world)]
    assert len(found) == len(told)
    assert all(part in sentence for part, sentence in zip(told, found, strict=True))


def walked(cell: float, robot: str = "unitree_go1") -> World:
    ground = {"kind": "rough", "cell": cell, "size": [4, 4], "platform": 1.0}
    return compile_world({"world": {"terrain": ground, "robots": {"dog": {"robot": robot}}}})


def test_ground_is_sampled_no_finer_than_feet_need() -> None:
    """A Go1 has feet of 4 cm, a B1 of 8; a G1 has soles."""
    assert not list(doubts(walked(0.08)))
    (found,) = doubts(walked(0.05))
    assert found.path == "world.terrain"
    assert "a height every 5 cm, and 'dog' has ball feet of 4 cm" in found.sentence
    assert "cells be 8 cm or larger" in found.sentence
    assert len(list(doubts(walked(0.1, "unitree_b1")))) == 1
    assert not list(doubts(walked(0.05, "unitree_g1")))


def test_a_build_warns_once() -> None:
    with pytest.warns(PhysicsWarning, match="begins above") as caught:
        NullEngine().create_world(stacked(100.0), 2).destroy()
    assert len(caught) == 1


def test_the_gains_of_a_robot_among_a_thousand_things_are_judged_by_its_own_tree() -> None:
    """The mass matrix of the whole world would have 36 million entries for each of its bodies."""
    alone: dict[str, Any] = {"robots": {"panda": {"robot": "franka_panda"}}}
    crowd = {"cube": {"source": {"box": [0.05] * 3}, "count": 1000}}
    many = compile_world({"world": alone | {"objects": crowd}})
    assert damping_ratio(many) == pytest.approx(damping_ratio(compile_world({"world": alone})), rel=1e-12)
