"""Weight of the body: shares of the standing feet, and the place of the centre of mass."""

import numpy as np

from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array

FLAT = 1e-6
"""[m^2] Keeps the spread of feet invertible where all stand on one line."""


def shares(stance: Array, feet: Array, com: Array) -> Array:
    """Which part (E, L) of the weight each standing foot carries, so that the pressure is below the centre of mass.

    Of all such shares those nearest to equal; two feet can only balance along the line between them. Feet (E, L, 3) and
    centres of mass (E, 3) in the base frame, whose tilt is taken to be small. Feet only push.
    """
    count = np.maximum(stance.sum(axis=1), 1)
    there = stance.astype(float)
    x, y = feet[..., 0], feet[..., 1]
    middle_x, middle_y = (x * there).sum(axis=1) / count, (y * there).sum(axis=1) / count
    dx, dy = there * (x - middle_x[:, None]), there * (y - middle_y[:, None])
    xx, xy, yy = (dx * dx).sum(axis=1) + FLAT, (dx * dy).sum(axis=1), (dy * dy).sum(axis=1) + FLAT
    off_x, off_y = com[:, 0] - middle_x, com[:, 1] - middle_y
    area = xx * yy - xy * xy
    along_x, along_y = (yy * off_x - xy * off_y) / area, (xx * off_y - xy * off_x) / area
    pushed = np.maximum(there / count[:, None] + dx * along_x[:, None] + dy * along_y[:, None], 0.0)
    return pushed / np.maximum(pushed.sum(axis=1), FLAT)[:, None]


class Balance:
    """The centre of mass of a robot in its base frame, as its joints stand."""

    def __init__(self, robot: ControlledRobot, legs: Array) -> None:
        """`legs` are the columns of the joints of its legs; what moves beside them counts as measured."""
        self._robot = robot
        model = robot.kinematics
        self._others = np.setdiff1d(np.arange(len(model.joints)), legs)
        self._posture = model.initial.copy()
        self._home = model.com(model.q(self._posture))

    def com(self, env_ids: Array | None, rows: int) -> Array:
        """(E, 3) [m]. Legs count as at home: their own steps cancel over a stride."""
        if not len(self._others):
            return np.tile(self._home, (rows, 1))
        measured = self._robot.joint_pos(env_ids)[:, self._others]
        model, centres = self._robot.kinematics, np.empty((rows, 3))
        for row, joints in enumerate(measured):
            self._posture[self._others] = joints
            centres[row] = model.com(model.q(self._posture))
        return centres
