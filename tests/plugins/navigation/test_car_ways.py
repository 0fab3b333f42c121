"""Ways of cars: arcs no tighter than the turning circle, off everything, backwards where there is no other way."""

import numpy as np
import pytest

from anysim_navigation.agent import Agent, NoRoute
from anysim_navigation.car_ways import car_way
from anysim_navigation.limits import BaseKind, limits_of
from anysim_navigation.maps import NavMaps
from tests.plugins.navigation.test_navmesh import AREA, blocks

DISCS = np.array([[0.0, 0.0, 0.25], [0.35, 0.0, 0.25]])
CAR = limits_of(BaseKind.ACKERMANN, DISCS, speed=0.6, turn=1.0, turning_radius=0.6)
SLIM = Agent(0.25)


def test_a_car_turns_round_by_going_backwards_or_in_a_circle() -> None:
    mesh = NavMaps(blocks(((0.1, 0.1, 0.5), (2.8, 2.8, 0.5))), SLIM, area=AREA).at()
    way = car_way(mesh, CAR, np.array([0.0, 0.0, 0.0]), np.array([-1.0, 0.0]))
    assert [gear for _, gear in way] == [-1.0]  # straight back
    assert np.abs(way[0][0][:, 1]).max() < 0.05
    ahead = car_way(mesh, CAR, np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.0]))
    assert [gear for _, gear in ahead] == [1.0]
    [(there, _)] = car_way(mesh, CAR, np.array([0.0, 0.0, 0.0]), np.array([0.05, 0.0]))
    np.testing.assert_allclose(there, [[0.0, 0.0], [0.05, 0.0]])


def test_curvature_and_clearance_are_kept_between_boxes() -> None:
    boxes = (((0.1, 1.2, 0.5), (-0.8, -1.0, 0.5)), ((0.1, 1.2, 0.5), (0.9, 1.0, 0.5)))
    mesh = NavMaps(blocks(*boxes), SLIM, area=AREA).at()
    way = car_way(mesh, CAR, np.array([-2.0, -2.0, 1.57]), np.array([2.2, 2.0]))
    for points, _ in way:
        run = np.diff(points, axis=0)
        turn = np.diff(np.unwrap(np.arctan2(run[:, 1], run[:, 0])))
        assert (np.abs(turn) / 0.15 <= 1.0 / CAR.turning_radius + 1e-6).all()
        for half, middle in boxes:
            off = np.maximum(np.abs(points - middle[:2]) - half[:2], 0.0)
            assert np.hypot(*off.T).min() > 0.25
    assert np.hypot(*(way[-1][0][-1] - [2.2, 2.0])) < 0.13


def test_a_place_that_is_closed_off_is_refused() -> None:
    mesh = NavMaps(blocks(((0.1, 3.2, 0.5), (0, 0, 0.5))), SLIM, area=AREA).at()
    with pytest.raises(NoRoute, match=r"no way of a car with a turning circle of 0.6 m from \(-2.00, 0.00\)"):
        car_way(mesh, CAR, np.array([-2.0, 0.0, 0.0]), np.array([2.0, 0.0]))
