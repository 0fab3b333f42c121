"""The beam search: bases that turn or shunt to let somebody pass where the best single velocity does not."""

from collections.abc import Callable

import numpy as np
import pytest

from anysim.conventions import Array
from anysim_navigation.beam_search import USUAL, BeamSearch, left_to_go
from anysim_navigation.dynamic_window import STEP, DynamicWindow
from anysim_navigation.kernels.window import distance_at
from anysim_navigation.limits import BaseKind, BaseLimits, limits_of
from anysim_navigation.pose_control import in_frame
from tests.plugins.navigation.test_local_planning import CELL, DISC, SIDE, Scene, limits

PASSAGE = Scene(((-3.0, -1.0, 6.0, -0.65), (-3.0, 0.65, -1.4, 2.4), (0.0, 0.65, 6.0, 2.4), (-1.4, 1.9, 0.0, 2.4)))
"""A passage of 1.3 m, in which nobody passes a base of 0.5 m, and a bay beside it."""
GOAL = np.array([4.0, 0.0])
PERSON, AHEAD = 0.25, np.array([1.0, 0.0])
Chooser = Callable[[Array, Array, Array, Array, Array], Array]


def way_to(place: Array) -> Array:
    return np.array([[0.0, 0.0], place])


def moved(pose: Array, now: Array) -> Array:
    """Where a base is a step later, by its own velocity."""
    middle = pose[2] + 0.5 * now[2] * STEP
    c, s = np.cos(middle), np.sin(middle)
    return pose + STEP * np.array([c * now[0] - s * now[1], s * now[0] + c * now[1], now[2]])


def met(choose: Chooser, made: BaseLimits) -> tuple[float, float]:
    """[m] the least between the base and a person who comes along the passage, and what is left to the goal."""
    pose, now, nearest = np.zeros(3), np.zeros(3), np.inf
    person, pace = np.array([3.0, 0.0]), np.array([-0.4, 0.0])
    for _ in range(300):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        at = in_frame(pose, person[None])[0]
        movers = np.array([[*at, c * pace[0] + s * pace[1], c * pace[1] - s * pace[0], PERSON]])
        aim = in_frame(pose, (pose[:2] + np.clip(GOAL - pose[:2], -1.0, 1.0))[None])[0]
        told = choose(PASSAGE.field(pose), aim, now, movers, pose)
        now = now + np.clip(told - now, -made.acceleration * STEP, made.acceleration * STEP)
        pose = moved(pose, now)
        person = person + STEP * pace
        nearest = min(nearest, float(np.hypot(*(person - pose[:2]))) - PERSON - 0.25)
        assert PASSAGE.clearance(pose) > 0.01  # of the 2 cm that motions keep
        if np.hypot(*(GOAL - pose[:2])) < 0.2:
            break
    return nearest, float(np.hypot(*(GOAL - pose[:2])))


@pytest.mark.parametrize("kind", [BaseKind.DIFFERENTIAL, BaseKind.ACKERMANN, BaseKind.HOLONOMIC])
def test_a_base_leaves_a_passage_for_who_comes_along_it_and_goes_on(kind: BaseKind) -> None:
    made = limits(kind)
    made.low[0] = -0.6
    search = BeamSearch(made)

    def choose(field: Array, aim: Array, now: Array, movers: Array, pose: Array) -> Array:
        way = in_frame(pose, np.array([pose[:2], GOAL]))
        return search.choose(field, CELL, way, aim, now, movers).twist

    nearest, left = met(choose, made)
    assert nearest > 0.0
    assert left < 0.2


def test_one_velocity_at_a_time_is_caught_there() -> None:
    """What the test above shows is the search's doing."""
    made = limits(BaseKind.DIFFERENTIAL)._replace(low=np.array([-0.6, 0.0, -1.5]))
    window, last = DynamicWindow(made), np.zeros(3)

    def choose(field: Array, aim: Array, now: Array, movers: Array, pose: Array) -> Array:
        way = in_frame(pose, np.array([pose[:2], GOAL]))
        last[:] = window.choose(field, CELL, way, aim, now, last, movers).twist
        return last

    nearest, left = met(choose, made)
    assert nearest < 0.0 or left > 1.0


def test_who_can_goes_sideways_from_who_comes_and_the_others_do_not() -> None:
    """Somebody comes along the way, a little to the right: to the left at once, and without a turn."""
    person = np.array([[1.2, -0.1, -0.5, 0.0, PERSON]])
    asked = Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, np.zeros(3), person
    told = {kind: BeamSearch(limits(kind)).choose(*asked).twist for kind in BaseKind}
    assert told[BaseKind.HOLONOMIC][1] > 0.25
    assert told[BaseKind.HOLONOMIC][2] == 0.0
    assert all(told[kind][1] == 0.0 for kind in BaseKind if kind is not BaseKind.HOLONOMIC)


def test_who_goes_sideways_more_slowly_keeps_to_that() -> None:
    made, rng = limits_of(BaseKind.HOLONOMIC, DISC, speed=0.6, turn=1.5, side=0.2, back=0.3), np.random.default_rng(3)
    search, now, seen = BeamSearch(made), np.zeros(3), []
    for _ in range(40):
        person, aim = np.array([[*rng.uniform(-1, 1, 2), *rng.uniform(-0.5, 0.5, 2), PERSON]]), rng.uniform(-1, 1, 2)
        now = search.choose(Scene().field(np.zeros(3)), CELL, way_to(aim), aim, now, person).twist
        seen.append(now)
    assert (np.array(seen) <= made.high + 1e-12).all()
    assert (np.array(seen) >= made.low - 1e-12).all()
    assert np.abs(seen).max(axis=0)[1] == pytest.approx(0.2)


def test_who_is_shut_in_by_a_person_does_not_come_closer() -> None:
    """A blind alley of 0.7 m, a person in its mouth who comes on, and all that is made for behind them."""
    alley = Scene(((-0.5, -0.9, 2.0, -0.35), (-0.5, 0.35, 2.0, 0.9), (-0.9, -0.9, -0.5, 0.9)))
    person = np.array([[0.48, 0.0, -0.2, 0.0, PERSON]])
    asked = alley.field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, np.zeros(3), person
    base = limits(BaseKind.HOLONOMIC)
    usual = USUAL[BaseKind.HOLONOMIC]
    assert BeamSearch(base).choose(*asked).twist[0] < 0.05
    assert BeamSearch(base, usual._replace(weights=usual.weights._replace(closer=0.0))).choose(*asked).twist[0] > 0.2


@pytest.mark.parametrize("looks", [0.0, 0.2, 1.0, 2.6])
def test_who_goes_sideways_gets_through_a_gap_hardly_wider_than_it(looks: float) -> None:
    """Whichever way it looks; 7 cm to either side, a metre long, of which a scan of 4 cm leaves 3."""
    walls = Scene(((0.4, -2.0, 1.4, -0.32), (0.4, 0.32, 1.4, 2.0)))
    search, pose, now = BeamSearch(limits(BaseKind.HOLONOMIC)), np.array([0.0, 0.02, looks]), np.zeros(3)
    away = np.array([[4.0, 4.0, 0.0, 0.0, PERSON]])
    for _ in range(50):
        aim = in_frame(pose, np.array([[min(pose[0] + 1.0, 2.0), 0.0]]))[0]
        now = search.choose(walls.field(pose), CELL, way_to(aim), aim, now, away).twist
        pose = moved(pose, now)
        assert walls.clearance(pose) > 0.0
    assert np.hypot(*(pose[:2] - [2.0, 0.0])) < 0.15


def test_a_car_never_turns_tighter_than_it_can() -> None:
    search, rng = BeamSearch(limits(BaseKind.ACKERMANN)), np.random.default_rng(0)
    for _ in range(30):
        movers = np.array([[*rng.uniform(-2, 2, 2), *rng.uniform(-0.5, 0.5, 2), 0.25]])
        now = np.array([rng.uniform(-0.3, 0.6), 0.0, 0.0])
        aim = rng.uniform(-1, 1, 2)
        told = search.choose(Scene().field(np.zeros(3)), CELL, way_to(aim), aim, now, movers).twist
        assert abs(told[2]) <= abs(told[0]) / 0.5 + 1e-9


def test_who_is_walled_in_stands() -> None:
    walls = Scene(((-1.0, -1.0, 1.0, -0.26), (-1.0, 0.26, 1.0, 1.0), (0.26, -1.0, 1.0, 1.0), (-1.0, -1.0, -0.26, 1.0)))
    search = BeamSearch(limits(BaseKind.ACKERMANN))
    moving = np.array([0.6, 0.0, 0.0])
    told, cost, _ = search.choose(walls.field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, moving, np.zeros((0, 5)))
    assert told[0] < moving[0]
    assert cost == np.inf


def test_equal_questions_have_equal_answers() -> None:
    search = BeamSearch(limits(BaseKind.DIFFERENTIAL))
    movers = np.array([[1.0, 0.1, -0.4, 0.0, 0.25], [0.0, 1.0, 0.1, -0.3, 0.25]])
    asked = Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, np.array([0.3, 0.0, 0.1]), movers
    first, again = search.choose(*asked), search.choose(*asked)
    assert (first.twist == again.twist).all()
    assert first[1:] == again[1:]


def test_a_car_that_shunts_goes_on_as_it_meant_to() -> None:
    """Who stands may begin forwards or backwards to come to a place beside it: what was chosen last decides."""
    search, nobody = BeamSearch(limits(BaseKind.ACKERMANN)), np.array([[9.0, 9.0, 0.0, 0.0, 0.25]])
    aside = np.array([0.0, 0.6])
    asked = Scene().field(np.zeros(3)), CELL, way_to(aside), aside, np.zeros(3), nobody
    speeds = [search.choose(*asked, last=last).speed for last in (0.6, -0.6)]
    assert speeds[0] >= 0.0 >= speeds[1]
    assert speeds[0] != speeds[1]


def test_what_is_left_to_go_leads_around_walls_to_where_the_way_leaves_the_scan() -> None:
    """A wall of 2 m across the straight line: around its end; where nothing leads around, straight and further."""
    wall = Scene(((0.5, -1.0, 0.6, 1.0),))
    to = np.array([[0.0, 0.0], [0.55, 1.5], [1.1, 0.0]])
    togo = left_to_go(wall.field(np.zeros(3)), CELL, to, 0.25)
    size = 2 * CELL
    at = {x: float(distance_at(togo, size, x, 0.0)) for x in (0.0, 1.1)}
    corner = np.hypot(0.5 - 0.0, 1.25), np.hypot(1.1 - 0.6, 1.25)  # the disc goes around the wall's ends
    assert at[0.0] == pytest.approx(sum(corner) + 0.1, rel=0.12)
    assert at[1.1] < 0.1
    beyond = left_to_go(Scene().field(np.zeros(3)), CELL, np.array([[0.0, 0.0], [20.0, 0.0]]), 0.25)
    assert distance_at(beyond, size, 0.0, 0.0) == pytest.approx(SIDE * CELL / 2, abs=0.2)
    shut = Scene(((0.3, -9.0, 0.4, 9.0),))
    assert distance_at(left_to_go(shut.field(np.zeros(3)), CELL, to, 0.25), size, 0.0, 0.0) > 3.0
