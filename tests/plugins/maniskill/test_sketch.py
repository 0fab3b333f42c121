"""Sketches and pairs of rules, without any peer: states are written as asked, and a wrong rule is found."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim_maniskill.verdicts.maniskill_pairs import PAIRS
from anysim_maniskill.verdicts.pair import Difference, Pair, agreements, direction
from anysim_maniskill.verdicts.sketch import Sketch


def distance_rule(tolerance: float, speed: float = 0.2) -> Pair:
    """The pair of `pick_cube`, with a rule of our own for the peer's: the cube near the goal, the arm at rest."""

    def verdict(sketch: Sketch) -> Array:
        apart = P.norm(sketch.pose("cube")[:, :3] - sketch.pose("goal")[:, :3])
        fast = np.abs(sketch.joint_velocities("panda")[:, :7]).max(axis=1)
        return (apart <= tolerance) & (fast <= speed)

    return replace(PAIRS[0], peer="rule:pick_cube", verdict=verdict)


def test_a_frame_stands_and_moves_as_it_was_placed() -> None:
    rng = np.random.default_rng(3)
    with Sketch("peg_in_hole", 20) as sketch:
        pose = np.concatenate([rng.normal(size=(20, 3)), P.normalize(rng.normal(size=(20, 4)))], axis=1)
        twist = rng.normal(size=(20, 6))
        sketch.place("peg.tip", pose, twist)
        np.testing.assert_allclose(P.unsigned(sketch.pose("peg.tip")), P.unsigned(pose), atol=1e-12)
        np.testing.assert_allclose(sketch.twist("peg.tip"), twist, atol=1e-12)
        tool = sketch.pose("panda.tool")
        tool[:, :3] = rng.normal(size=(20, 3))
        sketch.place("panda.tool", tool)
        np.testing.assert_allclose(P.unsigned(sketch.pose("panda.tool")), P.unsigned(tool), atol=1e-12)
        with pytest.raises(TaskError, match=r"'block.hole' belongs to a body that cannot move"):
            sketch.place("block.hole", pose, twist)


def test_joints_open_by_a_share_of_their_range() -> None:
    with Sketch("open_drawer", 4, ("task.success.free=null",)) as sketch:
        share = np.array([0.0, 0.74, 0.76, 1.0])
        sketch.open_joint("cabinet.drawer_1", share, np.zeros(4))
        closed, opened = sketch.joint_ends("cabinet.drawer_1")
        np.testing.assert_allclose(sketch.joint_position("cabinet.drawer_1"), closed + share * (opened - closed))
        assert sketch.judge().tolist() == [False, False, True, True]
        sketch.open_joint("cabinet.drawer_1", share, np.full(4, 0.2))
        assert not sketch.judge().any()


def test_the_same_rule_agrees_in_every_state() -> None:
    for found in agreements(distance_rule(0.025), 1000, 0):
        assert found.differ == found.unexplained == 0
        assert found.ours == found.theirs
        assert 200 < found.ours < 800  # the states lie on both sides of the boundary


def test_a_rule_with_another_constant_is_found() -> None:
    near, slow = agreements(distance_rule(0.027), 1000, 0)
    assert near.differ == near.unexplained > 20
    assert slow.differ == 0
    near, slow = agreements(distance_rule(0.025, speed=0.19), 1000, 0)
    assert near.differ == 0
    assert slow.unexplained > 20


def test_a_listed_difference_explains_what_it_says_and_no_more() -> None:
    listed = Difference("theirs is wider", ("task.success.at_goal.tolerance=0.027",))
    near, _ = agreements(replace(distance_rule(0.027), differences={"wider": listed}), 1000, 0)
    assert near.by["wider"] == near.differ > 20
    assert near.unexplained == 0
    near, _ = agreements(replace(distance_rule(0.029), differences={"wider": listed}), 1000, 0)
    assert 0 < near.unexplained < near.differ


def test_directions_have_length_one() -> None:
    rng = np.random.default_rng(0)
    np.testing.assert_allclose(P.norm(direction(rng, 50)), 1.0)
    assert (direction(rng, 50, level=True)[:, 2] == 0.0).all()
