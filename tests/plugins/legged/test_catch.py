"""Steps that catch a push, without physics: what the pressure holds, where feet may land, and how they get there."""

import numpy as np
import pytest

from anysim_legged.catch import AHEAD, FAR, NEAR, accelerations, approach, beyond, lowered, reachable
from anysim_legged.footsteps import Footsteps, Gait
from anysim_legged.preview import Preview

TICK, OMEGA = 0.01, 3.8
GAIT = Gait(double=0.2, single=0.5, clearance=0.05, lead=1.0, width=0.2)
SQUARE = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
OFFSET, STILL = np.zeros((2, 2)), np.zeros(3)


def standing() -> Footsteps:
    """A robot on feet beside each other whose swinging legs weigh nothing."""
    steps = Footsteps(GAIT, TICK, 1, np.zeros((2, 2, 3)))
    steps.begin(0, np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]))
    return steps


def advance(steps: Footsteps, ticks: int) -> list[np.ndarray]:
    """The feet's places (2, 3) before each tick."""
    seen = []
    for _ in range(ticks):
        feet = steps.now(0)
        seen.append(feet.places)
        steps.advance(0, STILL, feet.places[:, :2], STILL)
    return seen


def test_the_pressure_holds_what_is_within_its_part_of_the_room() -> None:
    centre = np.zeros(2)
    assert (beyond(np.array([0.08, 0.0]), centre, SQUARE, 0.8) == 0.0).all()
    assert beyond(np.array([0.12, -0.05]), centre, SQUARE, 0.8) == pytest.approx([0.04, 0.0])
    at_the_rim = np.array([0.1, 0.0])
    assert (beyond(np.array([0.01, 0.0]), at_the_rim, SQUARE, 0.8) == 0.0).all(), "slight errors never move a step"
    assert beyond(np.array([0.02, 0.0]), at_the_rim, SQUARE, 0.8) == pytest.approx([0.02, 0.0])
    assert (beyond(np.array([-0.1, 0.0]), at_the_rim, SQUARE, 0.8) == 0.0).all()


@pytest.mark.parametrize("heading", [0.0, 2.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_feet_never_cross_and_reach_no_further_than_legs(heading: float, side: float) -> None:
    stance = np.array([0.3, -0.2, heading])
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, -s], [s, c]])
    for wanted in np.random.default_rng(0).uniform(-1.0, 1.0, size=(50, 2)):
        place = np.array([*(stance[:2] + turn @ wanted), heading])
        x, y = turn.T @ (reachable(place, stance, side)[:2] - stance[:2])
        assert x == pytest.approx(np.clip(wanted[0], -AHEAD, AHEAD))
        assert side * y == pytest.approx(np.clip(side * wanted[1], NEAR, FAR))


def test_an_approach_arrives_at_rest_and_its_accelerations_are_known_ahead() -> None:
    state, goal, left = np.array([[0.0, 0.1], [0.2, 0.0], [0.0, -1.0]]), np.array([0.1, -0.05]), 0.3
    ahead = accelerations(state, goal, left, TICK * np.arange(1, 40))
    seen = []
    for k in range(30):
        state = approach(state, goal, left - k * TICK, TICK)
        seen.append(state[2])
    assert np.allclose(state, [goal, [0.0, 0.0], [0.0, 0.0]])
    assert np.allclose(seen[:-1], ahead[:29]), "the smoothest way from any point of it is the rest of it"
    assert (ahead[30:] == 0.0).all()
    assert (accelerations(state, goal + 1.0, left, -np.ones(3)) == 0.0).all(), "not before it begins"


def test_a_trunk_goes_down_for_feet_far_aside_but_not_for_lifted_ones() -> None:
    near, far = np.array([[0.1, 0.0], [0.0, -0.1]]), np.array([[0.25, 0.0], [0.0, 0.0]])
    assert lowered(near, np.zeros(2)) == 0.0
    assert 0.02 < lowered(far, np.zeros(2)) < 0.05
    assert lowered(far, np.array([0.05, 0.0])) == 0.0


def test_a_shifted_landing_is_where_the_foot_lands_and_no_longer_where_it_was_planned() -> None:
    steps = standing()
    steps.start(0, 1, np.array([[0.0, 0.1], [0.0, -0.1]]), STILL)
    shift, more = steps.landing(0, np.array([0.1, 0.05]))
    assert (shift == more).all()
    assert shift == pytest.approx([0.1, 0.05])
    steps.send(0, shift)
    before = steps.planned(0, np.zeros(2))
    seen = advance(steps, 95)
    assert steps.now(0).places[0] == pytest.approx([0.1, 0.15, 0.0])
    assert np.abs(np.diff(seen, axis=0)).max() < 0.01, "no foot jumps"
    assert steps.planned(0, np.array([0.1, 0.05])) == pytest.approx(before + shift), "the plan took the push"
    advance(steps, 200)
    assert steps.stands(0)
    places = steps.now(0).places
    assert places[0] - places[1] == pytest.approx([0.0, 0.2, 0.0], abs=1e-9)


def test_a_hasty_step_lands_earlier_and_the_pressure_ahead_knows_it() -> None:
    steps, preview = standing(), Preview(OMEGA, TICK, 3.0)
    steps.start(0, 1, np.array([[0.0, 0.1], [0.0, -0.1]]), STILL)
    for rate in steps.rates(0):
        steps.pace(0, rate)
    steps.pace(0, 1.5)
    steps.send(0, np.array([0.1, 0.0]))
    ahead = steps.pressure(0, STILL, preview.times, OFFSET)
    taken = []
    for _ in range(100):
        feet = steps.now(0)
        steps.advance(0, STILL, feet.places[:, :2], STILL)
        taken.append(steps.pressure(0, STILL, preview.times[:1], OFFSET)[0])
    assert np.allclose(taken, ahead[1:101], atol=0.01), "within a tick's motion of what was planned"


def test_a_landing_moves_the_plan_in_proportion() -> None:
    steps, preview = standing(), Preview(OMEGA, TICK, 3.0)
    steps.start(0, 1, np.array([[0.0, 0.1], [0.0, -0.1]]), STILL)

    def com(further: float) -> np.ndarray:
        return preview.next(np.zeros(2), steps.pressure(0, STILL, preview.times, OFFSET, further))

    assert not np.allclose(com(0.1) - com(0.0), 0.1 * (com(1.0) - com(0.0))), (
        "beside the other foot it is the last step"
    )
    steps.pace(0, 1.0)  # a step that catches never is
    metre = com(1.0) - com(0.0)
    assert np.allclose(com(0.1) - com(0.0), 0.1 * metre)
    moved = metre / (TICK * OMEGA)  # of the capture point per metre of the landing
    late, soon = 0.1 + 2 * GAIT.double + GAIT.single, 0.1 + GAIT.double + GAIT.single
    assert np.exp(-OMEGA * late) < moved[0] < np.exp(-OMEGA * soon)
