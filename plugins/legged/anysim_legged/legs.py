"""Legs of three joints: a hip that turns about x, then a thigh and a knee that turn about y. Closed-form both ways.

Everything is elementwise over (E, L): E envs, L legs, so a row's bits do not depend on the rows beside it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P

ALIGNED = 1e-6
"""How far [rad] an axis may be off x or y. Files give angles in a few digits; `inverse` makes good for those."""


class Postures(NamedTuple):
    """Joint positions for feet, and what the legs can do there."""

    joints: Array
    """(E, L, 3) [rad]"""
    jacobian: Array
    """(E, L, 3, 3) [m/rad]: velocity of the foot in the base frame, last axis per joint rate."""
    reached: Array
    """(E, L) bool: false where the foot is out of reach; the joints then stretch towards it."""


@dataclass(frozen=True)
class Legs:
    """The legs of one robot, in its base frame at zero joint positions. Arrays have one entry for each leg (L).

    `points` (L, 4, 3) are where the axes of hip, thigh and knee pass, and the foot; `axes` (L, 3, 3) their directions;
    `signs` (L, 3) those along +x, +y, +y; `bend` (L,) the side to which the knee bends; `home` (L, 3) [rad] the joint
    positions nearest to which solutions are chosen; `columns` (L, 3) the joints among the robot's.
    """

    names: tuple[str, ...]
    points: Array
    axes: Array
    signs: Array
    bend: Array
    home: Array
    lower: Array
    upper: Array
    columns: Array

    @classmethod
    def of(cls, robot: ControlledRobot) -> Self:
        """The legs that the catalogue gives a robot.

        Raises:
            TaskError: it has none, or legs of another kind; names the leg and the joint.
        """
        legs, model, where = robot.entry.legs, robot.kinematics, f"robot '{robot.name}' ({robot.entry.name})"
        if not legs or not robot.floating:
            lack = "its base is bolted down" if legs else "its catalogue entry has no `legs`"
            raise TaskError(f"{where} cannot walk: {lack}")
        columns = np.array([_joints(robot, name, spec.joints, where) for name, spec in legs.items()])
        points, axes = np.empty((len(legs), 4, 3)), np.empty((len(legs), 3, 3))
        zero = model.q(np.zeros(len(model.joints)))
        for i, spec in enumerate(legs.values()):
            points[i, 3] = model.frame_pose(zero, model.frame(spec.foot))[:3]
            jacobian = model.frame_jacobian(zero, model.frame(spec.foot))
            for k, column in enumerate(columns[i]):
                points[i, k] = model.data.oMi[model.model.getJointId(model.joint_names[column])].translation
                axes[i, k] = jacobian[3:, 6 + column]
        signs = np.stack([axes[:, 0, 0], axes[:, 1, 1], axes[:, 2, 1]], axis=1)
        for i, name in enumerate(legs):
            for k, letter in enumerate("xyy"):
                if abs(abs(signs[i, k]) - 1.0) > ALIGNED**2 / 2:
                    joint, found = model.joint_names[columns[i, k]], np.round(axes[i, k], 4).tolist()
                    raise TaskError(
                        f"{where}: leg '{name}' is of another kind: at zero the axis of '{joint}' is {found}; "
                        f"expected along {letter} of the base (hip about x, thigh and knee about y)"
                    )
        made = cls(
            tuple(legs),
            points,
            axes,
            np.sign(signs),
            np.ones(len(legs)),
            model.initial[columns],
            model.lower[columns],
            model.upper[columns],
            columns,
        )
        knee = made.signs[:, 2] * made.home[:, 2] + made._angles[1] - made._angles[0]
        bend = np.where(np.sin(knee) >= 0.0, 1.0, -1.0)
        return replace(made, bend=bend)

    # ------------------------------------------------------------------ forward

    def feet(self, joints: Array) -> Array:
        """Places (E, L, 3) of the feet in the base frame [m] at joint positions (E, L, 3)."""
        return self._chain(joints)[0]

    def jacobian(self, joints: Array) -> Array:
        """(E, L, 3, 3): velocity of the foot in the base frame, last axis per joint rate."""
        return self._chain(joints)[1]

    def _chain(self, joints: Array) -> tuple[Array, Array]:
        points, axes = self.points, self.axes
        turns = [P.from_axis_angle(np.broadcast_to(axes[:, k], joints.shape), joints[..., k]) for k in range(3)]
        two = P.multiply(turns[0], turns[1])
        three = P.multiply(two, turns[2])
        thigh = points[:, 0] + P.rotate(turns[0], points[:, 1] - points[:, 0])
        knee = thigh + P.rotate(two, points[:, 2] - points[:, 1])
        foot = knee + P.rotate(three, points[:, 3] - points[:, 2])
        about = (np.broadcast_to(axes[:, 0], joints.shape), P.rotate(turns[0], axes[:, 1]), P.rotate(two, axes[:, 2]))
        through = (points[:, 0], thigh, knee)
        return foot, np.stack([P.cross(a, foot - p) for a, p in zip(about, through, strict=True)], axis=-1)

    # ------------------------------------------------------------------ inverse

    @property
    def _angles(self) -> tuple[Array, Array]:
        """(L,) of thigh and shank about y at zero positions, from the z axis on."""
        thigh, shank = self.points[:, 2] - self.points[:, 1], self.points[:, 3] - self.points[:, 2]
        return np.arctan2(thigh[:, 0], thigh[:, 2]), np.arctan2(shank[:, 0], shank[:, 2])

    def inverse(self, feet: Array) -> Postures:
        """Joint positions for feet (E, L, 3) in the base frame [m], below the hips and with the knees bent as at home.

        The hip angle brings the leg's plane over the foot, the rest is a triangle. One Newton step on the true axes
        then removes what rounded angles in the source leave, some 1e-12 m.
        """
        away = feet - self.points[:, 0]
        steps = np.diff(self.points, axis=1)
        side = steps[:, 0, 1] + steps[:, 1, 1] + steps[:, 2, 1]
        depth = away[..., 1] ** 2 + away[..., 2] ** 2 - side**2
        below = -np.sqrt(np.maximum(depth, 0.0))
        hip = np.arctan2(away[..., 2], away[..., 1]) - np.arctan2(below, side)
        thigh, shank = np.hypot(steps[:, 1, 0], steps[:, 1, 2]), np.hypot(steps[:, 2, 0], steps[:, 2, 2])
        x, z = away[..., 0] - steps[:, 0, 0], below - steps[:, 0, 2]
        cosine = (x**2 + z**2 - thigh**2 - shank**2) / (2.0 * thigh * shank)
        reached = (depth >= 0.0) & (np.abs(cosine) <= 1.0)
        knee = self.bend * np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0))
        along, bent = self._angles
        own = np.arctan2(
            thigh * np.sin(along) + shank * np.sin(along + knee), thigh * np.cos(along) + shank * np.cos(along + knee)
        )
        about = np.stack([hip, np.arctan2(x, z) - own, knee - (bent - along)], axis=-1)
        joints = self.home + P.wrapped(self.signs * about - self.home)
        foot, jacobian = self._chain(joints)
        return Postures(joints + np.where(reached[..., None], solve(jacobian, feet - foot), 0.0), jacobian, reached)


def _joints(robot: ControlledRobot, name: str, joints: tuple[str, ...], where: str) -> list[int]:
    """The robot's columns of a leg's joints."""
    known = list(robot.kinematics.joint_names)
    if len(joints) != 3:
        raise TaskError(f"{where}: leg '{name}' has {len(joints)} joints; three are expected (hip, thigh, knee)")
    unknown = [joint for joint in joints if joint not in known]
    if unknown:
        raise TaskError(f"{where}: leg '{name}' names a joint '{unknown[0]}' that the robot has not")
    return [known.index(joint) for joint in joints]


def solve(matrix: Array, right: Array) -> Array:
    """x of matrix x = right, elementwise by Cramer's rule; zero where a leg is stretched out, so nearly singular."""
    a, b, c = matrix[..., 0], matrix[..., 1], matrix[..., 2]
    bc, ca, ab = P.cross(b, c), P.cross(c, a), P.cross(a, b)
    volume = P.dot(a, bc)
    scale = P.norm(a) * P.norm(b) * P.norm(c)
    safe = np.abs(volume) > 1e-4 * scale
    found = np.stack([P.dot(bc, right), P.dot(ca, right), P.dot(ab, right)], axis=-1)
    return np.where(safe[..., None], found / np.where(safe, volume, 1.0)[..., None], 0.0)
