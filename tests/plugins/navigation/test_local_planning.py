"""Local planning: the five rules that let a base get through, the variants, prediction, direct control."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim_navigation.dynamic_window import STEP, DynamicWindow, distances_of
from anysim_navigation.limits import SWAY, BaseKind, BaseLimits, discs_over, kind_of, limits_of, output_of
from anysim_navigation.pose_control import PoseControl, in_frame
from anysim_navigation.progress import OFF, PATIENCE, RECOVERY, Progress
from anysim_navigation.robot_shape import discs_of, outline_of
from anysim_navigation.router import ROOM

CELL, SIDE = 0.05, 120
DISC = np.array([[0.0, 0.0, 0.25]])


def limits(kind: BaseKind, speed: float = 0.6) -> BaseLimits:
    return limits_of(kind, DISC, speed=speed, turn=1.5, turning_radius=0.5 if kind is BaseKind.ACKERMANN else 0.0)


class Scene(NamedTuple):
    """Boxes x0, y0, x1, y1 [m] of the world."""

    boxes: tuple[tuple[float, float, float, float], ...] = ()

    def field(self, pose: Array) -> Array:
        """What a scan around a base at a pose says: distances in its frame."""
        steps = (np.arange(SIDE) + 0.5) * CELL - SIDE * CELL / 2
        x, y = np.meshgrid(steps, steps)
        c, s = np.cos(pose[2]), np.sin(pose[2])
        wx, wy = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        cells = np.zeros((SIDE, SIDE), dtype=np.int8)
        for x0, y0, x1, y1 in self.boxes:
            off = np.hypot(np.maximum(0, np.maximum(x0 - wx, wx - x1)), np.maximum(0, np.maximum(y0 - wy, wy - y1)))
            cells |= (off < CELL / 2).astype(np.int8)
        return distances_of(cells, CELL)

    def clearance(self, pose: Array) -> float:
        """[m] between the disc and the boxes, exact."""
        off = [
            np.hypot(max(a - pose[0], 0, pose[0] - c), max(b - pose[1], 0, pose[1] - d)) for a, b, c, d in self.boxes
        ]
        return min(off, default=10.0) - 0.25


class Driven(NamedTuple):
    pose: Array
    twist: Array
    nearest: float


def drive(window: DynamicWindow, scene: Scene, way: list[list[float]], pose: list[float], seconds: float) -> Driven:
    """Follow a way with a base that does as it is told, within its accelerations."""
    here, now, last, nearest = np.array(pose, dtype=float), np.zeros(3), np.zeros(3), np.inf
    progress = Progress(np.array(way, dtype=float))
    for _ in range(round(seconds / STEP)):
        progress.look(here[:2], STEP)
        field = scene.field(here)
        path, aim = window.ahead(progress, here, field, CELL)
        last = window.choose(field, CELL, path, aim, now, last).twist
        now = now + np.clip(last - now, -window.limits.acceleration * STEP, window.limits.acceleration * STEP)
        middle = here[2] + 0.5 * now[2] * STEP
        here = here + STEP * np.array(
            [
                np.cos(middle) * now[0] - np.sin(middle) * now[1],
                np.sin(middle) * now[0] + np.cos(middle) * now[1],
                now[2],
            ]
        )
        nearest = min(nearest, scene.clearance(here))
        if progress.left < 0.15:
            break
    return Driven(here, now, nearest)


PILLAR = Scene(((1.0, -0.3, 1.4, 0.3),))


@pytest.mark.parametrize("kind", BaseKind)
def test_each_kind_passes_a_pillar_on_its_way(kind: BaseKind) -> None:
    """The way leads past it at 0.1 m beyond the radius; the variants differ in limits and samples alone."""
    way = [[0.0, 0.0], [0.9, 0.7], [1.5, 0.7], [3.0, 0.0]]
    found = drive(DynamicWindow(limits(kind)), PILLAR, way, [0.0, 0.0, 0.0], 20.0)
    assert np.hypot(*(found.pose[:2] - [3.0, 0.0])) < 0.3
    assert found.nearest > 0.0
    if kind in (BaseKind.DIFFERENTIAL, BaseKind.ACKERMANN):
        assert found.twist[1] == 0.0


def test_a_car_keeps_to_its_circle() -> None:
    window = DynamicWindow(limits(BaseKind.ACKERMANN))
    for bearing in np.linspace(-3.0, 3.0, 7):
        aim = np.array([np.cos(bearing), np.sin(bearing)])
        twist = window.choose(Scene().field(np.zeros(3)), CELL, aim[None], aim, np.zeros(3), np.zeros(3)).twist
        assert abs(twist[2]) * 0.5 <= abs(twist[0]) + 1e-9


@pytest.mark.parametrize("speed", [0.1, 0.2, 0.6])
def test_a_slow_car_turns_as_tightly_as_a_fast_one(speed: float) -> None:
    """Its turns are tried in steps of its tightest at each speed, not of its fastest turn."""
    window = DynamicWindow(limits(BaseKind.ACKERMANN, speed))
    aim = np.array([0.1, 0.5])
    twist = window.choose(Scene().field(np.zeros(3)), CELL, aim[None], aim, np.zeros(3), np.zeros(3)).twist
    assert twist[0] != 0.0
    assert abs(twist[2]) * 0.5 == pytest.approx(abs(twist[0]))


# ---------------------------------------------------------------------------------------------------- the five rules


def test_1_a_base_within_the_margin_may_move_where_it_comes_no_nearer() -> None:
    """It stands 2 cm from a wall beside it, or overlaps it by the grid's rounding, and drives along and away."""
    window = DynamicWindow(limits(BaseKind.DIFFERENTIAL), margin=0.12)
    for gap in (0.02, -0.01):
        wall = Scene(((-3.0, 0.25 + gap, 3.0, 0.6 + gap),))
        aim = np.array([1.0, 0.0])
        choice = window.choose(wall.field(np.zeros(3)), CELL, aim[None], aim, np.zeros(3), np.zeros(3))
        assert choice.clearance < 0.12
        assert np.isfinite(choice.cost)
        assert choice.twist[0] > 0.1


def test_2_the_margin_is_a_cost_and_contact_within_the_time_to_brake_a_limit() -> None:
    gap = Scene(((-1.0, 0.3, 3.0, 0.8), (-1.0, -0.8, 3.0, -0.3)))  # 5 cm to both sides: all of it within the margin
    found = drive(DynamicWindow(limits(BaseKind.DIFFERENTIAL)), gap, [[0.0, 0.0], [2.5, 0.0]], [0.0, 0.0, 0.0], 20.0)
    assert found.pose[0] > 2.2
    assert found.nearest > 0.0
    wall = Scene(((0.6, -2.0, 0.9, 2.0),))  # 0.35 m ahead, at a speed that needs 0.18 m to brake
    fast, aim = np.array([0.6, 0.0, 0.0]), np.array([1.5, 0.0])
    window = DynamicWindow(limits(BaseKind.DIFFERENTIAL))
    assert window.choose(wall.field(np.zeros(3)), CELL, aim[None], aim, fast, fast).twist[0] < 0.45
    found = drive(window, wall, [[0.0, 0.0], [3.0, 0.0]], [0.0, 0.0, 0.0], 10.0)  # a way through it
    assert 0.0 < found.nearest < 0.2


def test_3_a_recovery_ends_by_itself_and_starts_the_clock_anew() -> None:
    """What does not get on during it does not begin another, and turning counts for nothing."""
    progress = Progress(np.array([[0.0, 0.0], [4.0, 0.0]]))
    for _ in range(round((PATIENCE + 0.2) / STEP)):
        progress.look(np.array([0.0, 0.0]), STEP)
    assert progress.stale
    progress.recover()
    ticks = 0
    while progress.recovering > 0:
        progress.look(np.array([0.0, 0.0]), STEP)
        ticks += 1
        assert ticks < 30
    assert ticks == round(RECOVERY / STEP)
    assert progress.idle == 0.0
    assert not progress.stale


def test_4_a_way_is_made_anew_off_it_and_without_getting_on() -> None:
    progress = Progress(np.array([[0.0, 0.0], [4.0, 0.0]]))
    progress.look(np.array([1.0, OFF - 0.01]), STEP)
    assert not progress.stale
    progress.look(np.array([1.0, OFF + 0.01]), STEP)
    assert progress.stale
    progress.look(np.array([1.0, 0.0]), STEP)
    for k in range(round(2 * PATIENCE / STEP)):  # 3 cm/s is on its way
        progress.look(np.array([1.0 + 0.003 * k, 0.0]), STEP)
        assert not progress.stale
    for _ in range(round(PATIENCE / STEP) + 1):
        progress.look(np.array([1.15, 0.0]), STEP)
    assert progress.stale


def test_5_ways_keep_room_beyond_the_radius() -> None:
    from anysim_navigation.agent import Agent
    from anysim_navigation.maps import NavMaps
    from tests.plugins.navigation.test_navmesh import AREA, blocks

    assert ROOM[0] == 0.12
    world = blocks(((0.5, 0.5, 0.5), (0, 0, 0.5)))
    path = NavMaps(world, Agent(0.25 + ROOM[0]), area=AREA).at().path((-2.0, 0.1), (2.0, 0.1))
    boxes = Scene(((-0.5, -0.5, 0.5, 0.5),))
    assert min(boxes.clearance(np.array([*p, 0.0])) for p in path) > 0.119


# ---------------------------------------------------------------------------------------------------- movers, control


def test_a_mover_is_let_pass_where_it_will_be_not_where_it_is() -> None:
    """It crosses from the right: who takes it for standing goes to its left, before it; who foresees it does not."""
    window, aim = DynamicWindow(limits(BaseKind.HOLONOMIC)), np.array([1.2, 0.0])
    now = np.array([0.5, 0.0, 0.0])
    field = Scene().field(np.zeros(3))
    moving = np.array([[1.0, -0.7, 0.0, 0.6, 0.2]])
    free = window.choose(field, CELL, aim[None], aim, now, now).twist
    foreseen = window.choose(field, CELL, aim[None], aim, now, now, moving).twist
    assert free[0] > 0.55
    assert foreseen[0] < free[0] - 0.1 or foreseen[1] < -0.1  # slower, or behind it
    gone = np.array([[1.0, -0.7, 0.0, -0.6, 0.2]])
    assert np.allclose(window.choose(field, CELL, aim[None], aim, now, now, gone).twist, free)


@pytest.mark.parametrize("gap", [0.3, -0.05])
@pytest.mark.parametrize("others", [[], [[-0.75, 0.0, 0.0, 0.0, 0.35]]])
def test_who_comes_is_fled_from_and_nobody_else_is_run_into(gap: float, others: list[list[float]]) -> None:
    """One who walks up from the front, near or already too near, with another one behind, or nobody there."""
    window, field = DynamicWindow(limits(BaseKind.HOLONOMIC)), Scene().field(np.zeros(3))
    movers, here, now = np.array([[0.6 + gap, 0.0, -0.5, 0.0, 0.35], *others]), np.zeros(2), np.zeros(3)
    most = window.limits.acceleration * STEP
    for _ in range(12):
        seen = movers.copy()
        seen[:, :2] -= here
        aim = np.array([0.3, 0.0]) - here
        now = now + np.clip(window.choose(field, CELL, aim[None], aim, now, now, seen).twist - now, -most, most)
        now[2] = 0.0  # it looks ahead all the time
        here = here + now[:2] * STEP
        movers[:, :2] += movers[:, 2:4] * STEP
        away = np.linalg.norm(movers[:, :2] - here, axis=1) - 0.6
        assert (away[1:] > -0.02).all()
    standing = np.hypot(*movers[0, :2]) - 0.6
    assert away[0] > standing + 0.2


def test_equal_questions_have_equal_answers() -> None:
    window, field = DynamicWindow(limits(BaseKind.HOLONOMIC)), PILLAR.field(np.zeros(3))
    way, aim, now = np.array([[0.0, 0.0], [0.9, 0.7]]), np.array([0.9, 0.7]), np.array([0.2, 0.1, 0.0])
    first = window.choose(field, CELL, way, aim, now, now)
    assert all((window.choose(field, CELL, way, aim, now, now).twist == first.twist).all() for _ in range(3))


@pytest.mark.parametrize("kind", [BaseKind.HOLONOMIC, BaseKind.DIFFERENTIAL])
@pytest.mark.parametrize("goal", [[1.0, 0.5, 1.0], [-0.2, 0.0, 0.0], [-1.0, -1.0, 3.0]])
def test_direct_control_ends_at_its_pose(kind: BaseKind, goal: list[float]) -> None:
    control, pose, last = PoseControl(limits(kind)), np.zeros(3), np.zeros(3)
    for _ in range(800):
        way = in_frame(pose, np.array([goal[:2]]))[0]
        turn = (goal[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi
        last = control.twist(way, turn, last)
        assert (last <= control.limits.high + 1e-9).all()
        assert (last >= control.limits.low - 1e-9).all()
        c, s = np.cos(pose[2]), np.sin(pose[2])
        pose = pose + 0.02 * np.array([c * last[0] - s * last[1], s * last[0] + c * last[1], last[2]])
    assert np.hypot(*(pose[:2] - goal[:2])) < 0.011
    assert abs((goal[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi) < 0.01


def test_channels_get_what_they_take() -> None:
    twist = np.array([[0.4, 0.0, 0.2]])
    car = limits(BaseKind.ACKERMANN)
    assert kind_of(("speed", "steering")) is BaseKind.ACKERMANN
    assert kind_of(("speed", "turn")) is BaseKind.DIFFERENTIAL
    assert kind_of(("forward", "left", "turn"), legs=4) is BaseKind.QUADRUPED
    assert (output_of(car, ("speed", "turn"), twist) == [[0.4, 0.2]]).all()
    assert np.allclose(output_of(car, ("speed", "steering"), twist, 0.5), [[0.4, np.arctan(0.25)]])
    with pytest.raises(AnysimError, match=r"a channel of \(knee\) drives no base"):
        kind_of(("knee",))
    with pytest.raises(AnysimError, match="turning_radius"):
        limits_of(BaseKind.ACKERMANN, DISC, speed=1.0, turn=1.0)


def corners(low: Sequence[float], high: Sequence[float]) -> Array:
    return np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])


@pytest.mark.parametrize("size", [(0.6, 0.5), (1.1, 0.4), (0.3, 1.0)])
def test_discs_cover_a_rectangle(size: tuple[float, float]) -> None:
    low, high = np.array([-0.1, 0.2]), np.array([-0.1, 0.2]) + size
    discs = discs_over(corners(low, high))
    points = np.random.default_rng(0).uniform(low, high, (500, 2))
    off = np.hypot(points[:, None, 0] - discs[:, 0], points[:, None, 1] - discs[:, 1])
    assert (off <= discs[:, 2] + 1e-9).any(axis=1).all()


def test_discs_are_as_narrow_as_what_they_cover() -> None:
    """The hull of a body and its wheels lacks the corners of the rectangle around it."""
    hexagon = np.array([(0.3, 0.1), (0.3, -0.1), (0.0, 0.3), (0.0, -0.3), (-0.3, 0.1), (-0.3, -0.1)])
    (disc,) = discs_over(hexagon)
    assert np.allclose(disc, [0.0, 0.0, np.hypot(0.3, 0.1)])


def test_who_is_wider_than_deep_keeps_its_width_from_things() -> None:
    """Discs beside each other are narrow, but the base that they cover is not."""
    wide = limits_of(BaseKind.HUMANOID, discs_over(corners((-0.1, -0.3), (0.1, 0.3))), speed=0.25, turn=0.3)
    assert wide.radius >= 0.3
    assert wide.discs[:, 2].max() < 0.2
    long = limits_of(BaseKind.QUADRUPED, discs_over(corners((-0.3, -0.1), (0.3, 0.1))), speed=0.5, turn=0.8)
    assert long.radius == pytest.approx(long.discs[:, 2].max())


def test_a_walk_takes_its_sway_as_well() -> None:
    world = compile_world({"world": {"robots": {"g1": {"robot": "unitree_g1"}}}})
    at = world.initial_body_pose[world.entities[world.entity_numbers["g1"]].root]
    wide = [discs_of(world, "g1", at, sway=sway) for sway in (0.0, SWAY[BaseKind.HUMANOID])]
    narrow, swaying = (float((np.abs(discs[:, 1]) + discs[:, 2]).max()) for discs in wide)
    assert swaying - narrow > 0.9 * SWAY[BaseKind.HUMANOID]


def test_what_touches_nothing_takes_no_room() -> None:
    world = compile_world({"world": {"objects": {"eye": {"source": {"procedural": "camera_body"}, "fixed": True}}}})
    at = world.initial_body_pose[world.entities[world.entity_numbers["eye"]].root]
    assert np.allclose(outline_of(world, "eye", at, 0.3), [[0.0, 0.0]])
