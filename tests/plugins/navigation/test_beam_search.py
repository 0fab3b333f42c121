"""The beam search: bases that turn or shunt to let somebody pass where the best single velocity does not."""

from collections.abc import Callable

import numpy as np
import pytest

from anysim.conventions import Array
from anysim_navigation.beam_search import USUAL, BeamSearch, Search, left_to_go
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
    """Somebody comes along the way, a little to the right: to the left at once, and on wheels without a turn."""
    person = np.array([[1.2, -0.1, -0.5, 0.0, PERSON]])
    asked = Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, np.zeros(3), person
    told = {kind: BeamSearch(limits(kind)).choose(*asked).twist for kind in BaseKind}
    assert told[BaseKind.HOLONOMIC][1] > 0.25
    assert told[BaseKind.HOLONOMIC][2] == 0.0
    assert told[BaseKind.QUADRUPED][1] > 0.05
    assert told[BaseKind.DIFFERENTIAL][1] == told[BaseKind.ACKERMANN][1] == 0.0


@pytest.mark.parametrize("kind", [BaseKind.HOLONOMIC, BaseKind.QUADRUPED])
def test_who_goes_sideways_more_slowly_keeps_to_that(kind: BaseKind) -> None:
    made, rng = limits_of(kind, DISC, speed=0.6, turn=1.5, side=0.2, back=0.3), np.random.default_rng(3)
    search, now, seen = BeamSearch(made), np.zeros(3), []
    for _ in range(40):
        person, aim = np.array([[*rng.uniform(-1, 1, 2), *rng.uniform(-0.5, 0.5, 2), PERSON]]), rng.uniform(-1, 1, 2)
        now = search.choose(Scene().field(np.zeros(3)), CELL, way_to(aim), aim, now, person).twist
        seen.append(now)
    assert (np.array(seen) <= made.high + 1e-12).all()
    assert (np.array(seen) >= made.low - 1e-12).all()
    assert np.abs(seen).max(axis=0)[1] == pytest.approx(0.2)


def test_legs_are_told_no_more_than_they_can_change_in_a_tick() -> None:
    """They do it at once, and stumble over more: a trot fell in 5 of 59 rooms on PyBullet. Wheels are told further."""
    most, asked = {}, (Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD)
    for kind in (BaseKind.HOLONOMIC, BaseKind.QUADRUPED):
        made, rng = limits(kind), np.random.default_rng(5)
        search, changes = BeamSearch(made), []
        for _ in range(40):
            now = rng.uniform(made.low, made.high)
            person = np.array([[*rng.uniform(-1, 1, 2), *rng.uniform(-0.5, 0.5, 2), PERSON]])
            changes.append(np.abs(search.choose(*asked, now, person).twist - now))
        most[kind] = np.max(changes, axis=0) / made.acceleration
    assert most[BaseKind.QUADRUPED] == pytest.approx(STEP)
    assert most[BaseKind.HOLONOMIC] == pytest.approx(Search().lead)


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
    told, cost, plan = search.choose(walls.field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, moving, np.zeros((0, 5)))
    assert told[0] < moving[0]
    assert cost == np.inf
    assert (plan == search.no_plan).all()


def test_equal_questions_have_equal_answers() -> None:
    search = BeamSearch(limits(BaseKind.DIFFERENTIAL))
    movers = np.array([[1.0, 0.1, -0.4, 0.0, 0.25], [0.0, 1.0, 0.1, -0.3, 0.25]])
    asked = Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, np.array([0.3, 0.0, 0.1]), movers
    first, again = search.choose(*asked), search.choose(*asked)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))


def test_a_car_that_shunts_goes_on_as_it_meant_to() -> None:
    """Who stands may begin forwards or backwards to come to a place beside it: what was chosen last decides."""
    search, nobody = BeamSearch(limits(BaseKind.ACKERMANN)), np.array([[9.0, 9.0, 0.0, 0.0, 0.25]])
    aside = np.array([0.0, 0.6])
    asked = Scene().field(np.zeros(3)), CELL, way_to(aside), aside, np.zeros(3), nobody
    told = []
    for x in (2.0, -2.0):
        to = np.array([x, 0.0])
        meant = search.choose(*asked[:2], way_to(to), to, *asked[4:], np.sign(x)).plan
        told.append(search.choose(*asked, plan=np.array([5, *meant[1:]])).twist[0])  # the first motion is over
    assert told[0] >= 0.0 >= told[1]
    assert told[0] != told[1]


@pytest.mark.parametrize("kind", [BaseKind.DIFFERENTIAL, BaseKind.ACKERMANN, BaseKind.HOLONOMIC])
def test_what_was_meant_is_not_given_up_because_it_is_not_found_again(kind: BaseKind) -> None:
    """Of few states that are gone on with, none may be of the plan; it is followed to its end all the same."""
    movers = np.array([[1.2, 0.0, -0.4, 0.0, 0.25], [0.3, 1.0, 0.1, -0.3, 0.25]])
    aside = np.array([1.0, 0.8])
    asked = Scene().field(np.zeros(3)), CELL, way_to(aside), aside, np.zeros(3), movers
    made = USUAL.get(kind, Search())._replace(keeps=True)
    wide, narrow = BeamSearch(limits(kind), made, width=400), BeamSearch(limits(kind), made, width=1)
    meant = wide.choose(*asked)
    again = narrow.choose(*asked, plan=np.array([0, *meant.plan[1:]]))
    assert narrow.choose(*asked).cost > meant.cost + 0.02
    assert again.cost <= meant.cost + 1e-9
    assert again.plan[1] == meant.plan[1]


def test_what_is_told_is_what_the_motions_come_to_a_little_later() -> None:
    """Also where the first of them is nearly over, and the next one goes back: told is not what overshoots it."""
    search, rng = BeamSearch(limits(BaseKind.ACKERMANN)), np.random.default_rng(1)
    speeds, turned = [0.6, 0.3, 0.0, -0.3], 0  # of motions: five with each speed, one that stands
    of_motion = [speed for speed in speeds for _ in range(5 if speed else 1)]
    plan = search.no_plan
    for _ in range(60):
        movers = np.array([[*rng.uniform(-1.5, 1.5, 2), *rng.uniform(-0.5, 0.5, 2), 0.25]])
        now = np.array([rng.uniform(-0.3, 0.6), 0.0, 0.0])
        told, _, found = search.choose(Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, now, movers, 1.0, plan)
        speed, left = now[0], round((6 - found[0]) * STEP, 6)  # of the first motion, as it was chosen
        for tick in range(35):
            aim = of_motion[found[1] if tick * 0.01 < left - 1e-9 else found[2]]
            speed += np.clip(aim - speed, -0.01 * search.limits.acceleration[0], 0.01 * search.limits.acceleration[0])
        assert told[0] == pytest.approx(speed, abs=0.02)
        turned += bool(left < 0.3 and of_motion[found[1]] != of_motion[found[2]])
        plan = found
    assert turned > 3


def test_a_car_is_told_the_curve_of_its_next_motion_before_that_begins() -> None:
    """Wheels take time to turn: told when it begins, the car would have been round the last curve for longer."""
    search, rng = BeamSearch(limits(BaseKind.ACKERMANN)), np.random.default_rng(1)
    plan, now = search.no_plan, np.array([0.3, 0.0, 0.0])
    told_of: dict[int, set[float]] = {}
    early: list[tuple[int, int, float]] = []
    for _ in range(80):
        movers = np.array([[*rng.uniform(-1.5, 1.5, 2), *rng.uniform(-0.5, 0.5, 2), 0.25]])
        told, _, plan = search.choose(Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, now, movers, 1.0, plan)
        if abs(told[0]) < 0.05:
            continue
        curve = round(told[2] / told[0], 6)
        if plan[0] <= 3:
            told_of.setdefault(plan[1], set()).add(curve)
        else:
            early.append((plan[1], plan[2], curve))
    assert all(len(curves) == 1 for curves in told_of.values())
    known = [(told_of[a], told_of[b], curve) for a, b, curve in early if a in told_of and b in told_of]
    assert all(curve in b for _, b, curve in known)
    assert sum(a != b for a, b, _ in known) > 3


def test_a_plan_goes_on_where_it_is() -> None:
    """After a motion the next one is the first; in the middle of one the rest of it is."""
    search = BeamSearch(limits(BaseKind.ACKERMANN))
    nobody, now, plan = np.array([[9.0, 9.0, 0.0, 0.0, 0.25]]), np.zeros(3), None
    for step in range(12):
        found = search.choose(Scene().field(np.zeros(3)), CELL, way_to(AHEAD), AHEAD, now, nobody, 1.0, plan)
        assert found.plan[0] == 1 + step % 5
        plan = found.plan


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
