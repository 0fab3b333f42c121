"""Bases that do what they are told some time later: where they are then, and what is seen from there."""

import numpy as np
import pytest

from anysim_navigation.delay import later, seen_from
from anysim_navigation.dynamic_window import STEP, DynamicWindow
from anysim_navigation.limits import BaseKind, limits_of
from anysim_navigation.pose_control import in_frame
from anysim_navigation.progress import Progress
from tests.plugins.navigation.test_local_planning import CELL, DISC, Scene

ROOM = Scene(((1.0, -1.0, 1.4, 0.3), (-0.6, 1.2, 2.0, 1.5), (-1.2, -0.8, -1.0, 0.6)))

CORNER = Scene(((-1.0, -0.9, 1.6, -0.4), (1.6, -0.9, 2.0, 3.0), (-1.0, 0.4, 0.8, 3.0)))
"""Of a passage of 0.8 m, to the left."""


def test_velocities_that_are_yet_to_come_lead_along_an_arc() -> None:
    pose = np.array([[1.0, 2.0, 0.5], [0.0, 0.0, -1.0]])
    told = np.tile(np.array([0.4, 0.1, 0.6]), (2, 20, 1))
    turn = 0.6 * 20 * STEP
    there = np.array([0.4 * np.sin(turn) + 0.1 * (np.cos(turn) - 1), 0.4 * (1 - np.cos(turn)) + 0.1 * np.sin(turn)])
    found = later(pose, told)
    for before, after in zip(pose, found, strict=True):
        assert in_frame(before, after[None, :2])[0] == pytest.approx(there / 0.6, abs=1e-3)
        assert after[2] - before[2] == pytest.approx(turn)
    assert np.array_equal(later(pose, told[:, :0]), pose)


@pytest.mark.parametrize("there", [(0.4, 0.1, 0.7), (-0.3, 0.2, -2.5), (0.0, 0.0, 0.0)])
def test_a_field_about_another_pose_is_that_of_a_scan_from_there(there: tuple[float, float, float]) -> None:
    here = np.array([0.2, -0.1, 0.3])
    c, s = np.cos(here[2]), np.sin(here[2])
    pose = here + np.array([c * there[0] - s * there[1], s * there[0] + c * there[1], there[2]])
    moved, scan = seen_from(ROOM.field(here), CELL, here, pose), ROOM.field(pose)
    near = scan < 0.8
    assert np.abs(moved - scan)[near].max() < 1.5 * CELL
    assert near.sum() > 2000


def nearest(delay: float, known: float) -> tuple[float, float]:
    """[m] the least between a walker that is late by one time and things, and to its goal, if it knows another."""
    made = limits_of(BaseKind.HUMANOID, DISC, speed=0.25, turn=0.3)
    window, goal = DynamicWindow(made), [1.2, 1.8]
    progress = Progress(np.array([[0.0, 0.0], [1.2, 0.0], goal]))
    told, pose, least = [np.zeros(3)] * (round(delay / STEP) + 1), np.zeros(3), np.inf
    for _ in range(300):
        ahead = np.array(told[len(told) - round(known / STEP) :]).reshape(1, -1, 3)
        there = later(pose[None], ahead)[0]
        field = seen_from(CORNER.field(pose), CELL, pose, there)
        progress.look(there[:2], STEP)
        path, aim = window.ahead(progress, there, field, CELL)
        twist = window.choose(field, CELL, path, aim, told[-1], told[-1]).twist
        told.append(twist)
        pose = later(pose[None], told.pop(0)[None, None])[0]
        least = min(least, CORNER.clearance(pose))
        if np.hypot(*(goal - pose[:2])) < 0.2:
            break
    return least, float(np.hypot(*(goal - pose[:2])))


def test_who_is_late_gets_round_a_corner_if_that_is_known() -> None:
    """At 0.25 m/s 0.45 m are walked before what is told now is done; the passage leaves 0.15 m to each side."""
    least, left = nearest(1.8, 1.8)
    assert (least > 0.03, left < 0.2) == (True, True)
    assert nearest(1.8, 0.0)[0] < 0.0
