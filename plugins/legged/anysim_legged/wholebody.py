"""Whole-body inverse kinematics: damped least squares over feet, centre of mass, pelvis and posture.

One model of the robot, its two flat feet, and the joints that the controller may move; the others (arms that somebody
else moves) are where they are. The base is free in the problem: its pose follows from the feet.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.kinematics.pinocchio_model import RobotModel, from_se3, pinocchio, se3
from anysim.math import pose as P
from anysim_legged.support import sole_corners, turned

FEET = (20.0, 10.0)
"""Weights of a foot's place [1/m] and turn [1/rad]: what stands must not move."""
COM, HEIGHT, PELVIS, POSTURE = 10.0, 10.0, 3.0, 0.1
DAMPING = 1e-4
"""Of the normal equations; far below the weights squared, so that it only matters where nothing else decides."""


class Targets(NamedTuple):
    """What a posture must do. Places are (x, y, heading) of the feet seen from above: 0 as at home."""

    feet: Array
    """(2, 3) [m, rad]."""
    lift: Array
    """(2,) of the soles above the ground [m]."""
    com: Array
    """(2,) [m]."""
    height: float
    """of the pelvis above the ground [m]."""
    turn: Array
    """(3, 3) orientation of the pelvis."""


class WholeBody:
    """The robot seen by a controller of its legs.

    Attributes:
        model: of the robot.
        feet: Pinocchio's indices of the two feet's frames, left and right.
        soles: (2, 4) x_min, x_max, y_min, y_max in the foot's frame.
        free: (K,) velocity columns of the joints that may move.
        yaws: (2,) of the feet's frames where the robot heads along x, which need not be zero.
        home: (nq,) the configuration at home, heading along x (left foot at positive y), soles on the ground z = 0 and
            the midpoint of the feet at the origin.
        upright: (3, 3) orientation of the pelvis there.
    """

    def __init__(self, model: RobotModel, channel: ChannelView) -> None:
        robot = channel.robot
        legs = robot.entry.legs
        where = f"'{robot.name}' ({robot.entry.name})"
        if not model.floating:
            raise TaskError(f"{where} is bolted down; balance is for robots whose base floats")
        if set(legs) != {"left", "right"} or any(leg.sole is None for leg in legs.values()):
            raise TaskError(
                f"{where} cannot be balanced: it needs the legs 'left' and 'right', each with a flat `sole`, in its "
                f"catalogue entry (legs: {', '.join(f'{n}{_kind(leg.sole)}' for n, leg in legs.items()) or 'none'})"
            )
        self.model = model
        self.feet = [model.frame(legs[side].foot) for side in ("left", "right")]
        self.soles = np.array([legs[side].sole for side in ("left", "right")])
        self.sole_heights = np.array([legs[side].sole_height for side in ("left", "right")])
        self.columns = np.asarray(channel.joint_columns)
        self.free = 6 + self.columns
        self.others = np.setdiff1d(np.arange(len(model.joints)), self.columns)
        self._lower, self._upper = model.lower[self.columns], model.upper[self.columns]
        self._picked = np.concatenate([np.arange(6), self.free])
        self.yaws = np.zeros(2)
        self.home = self._grounded(where)
        self.upright = np.array(model.data.oMi[1].rotation)
        self.yaws = self.places(self.home)[:, 2]
        places = self.places(self.home)
        self.stance = float(np.hypot(*(places[0, :2] - places[1, :2])))
        """Distance between the feet at home [m]."""
        self.mass = model.mass

    def _grounded(self, where: str) -> Array:
        """The home configuration; refuses one whose soles are not flat on one plane."""
        pin = pinocchio()
        q = self.model.q(self.model.initial)
        pin.framesForwardKinematics(self.model.model, self.model.data, q)
        frames = [self.model.data.oMf[f] for f in self.feet]
        tilt = [float(np.degrees(np.arccos(min(1.0, f.rotation[2, 2])))) for f in frames]
        bottoms = [f.translation[2] - h for f, h in zip(frames, self.sole_heights, strict=True)]
        if max(tilt) > 2.0 or abs(bottoms[0] - bottoms[1]) > 0.005:
            raise TaskError(
                f"{where} does not stand at home: its soles lean by {tilt[0]:.1f} and {tilt[1]:.1f} degrees and differ "
                f"in height by {abs(bottoms[0] - bottoms[1]):.3f} m; change `home` until both are flat"
            )
        middle = (frames[0].translation + frames[1].translation) / 2.0
        across = frames[0].translation - frames[1].translation
        heading = np.arctan2(-across[0], across[1])
        there = pin.SE3(about_z(-heading), np.zeros(3)) * pin.SE3(
            np.eye(3), -np.array([middle[0], middle[1], (bottoms[0] + bottoms[1]) / 2.0])
        )
        q[:7] = from_se3(there * se3(q[:7]))
        pin.framesForwardKinematics(self.model.model, self.model.data, q)
        return q

    def places(self, q: Array) -> Array:
        """(2, 3) x, y, heading of the feet of a configuration."""
        pin = pinocchio()
        pin.framesForwardKinematics(self.model.model, self.model.data, q)
        return self._seen()

    def _seen(self) -> Array:
        frames = [self.model.data.oMf[f] for f in self.feet]
        yaws = [np.arctan2(f.rotation[1, 0], f.rotation[0, 0]) for f in frames]
        return np.array(
            [[*f.translation[:2], P.wrapped(y - o)] for f, y, o in zip(frames, yaws, self.yaws, strict=True)]
        )

    def corners(self, places: Array, standing: Sequence[bool], soles: Array) -> Array:
        """Corners (P, 2) on the ground of those soles (2, 4) that stand."""
        picked = [sole_corners(turned(places[k], 0, 0, self.yaws[k]), soles[k]) for k in range(2) if standing[k]]
        return np.concatenate(picked)

    def middles(self, places: Array) -> Array:
        """(2, 2) middles of the soles on the ground, of the feet's places (2, 3)."""
        x, y = self.soles[:, :2].mean(axis=1), self.soles[:, 2:].mean(axis=1)
        c, s = np.cos(places[:, 2] + self.yaws), np.sin(places[:, 2] + self.yaws)
        return np.stack([places[:, 0] + c * x - s * y, places[:, 1] + s * x + c * y], axis=1)

    def measured(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Centre of mass (3,), its velocity (3,) and the feet's places (2, 3) of a configuration and velocity."""
        pin = pinocchio()
        model, data = self.model.model, self.model.data
        pin.centerOfMass(model, data, q, v, False)
        com, rate = np.array(data.com[0]), np.array(data.vcom[0])
        pin.updateFramePlacements(model, data)
        return com, rate, self._seen()

    def solve(self, q: Array, targets: Targets, posture: Array, iterations: int = 2) -> Array:
        """The configuration near `q` (nq,) that does what is wanted; joints of others stay as in `q`.

        Args:
            q: where to begin.
            targets: what to reach.
            posture: (K,) where the free joints go as far as nothing else decides.
            iterations: Gauss-Newton steps; two suffice from one control tick to the next.
        """
        pin = pinocchio()
        model, data = self.model.model, self.model.data
        q = q.copy()
        size = 6 + len(self.columns)
        step = np.zeros(model.nv)
        for _ in range(iterations):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            rows, errors = [], []
            for k, frame in enumerate(self.feet):
                placed = data.oMf[frame]
                jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:, self._picked]
                x, y, heading = targets.feet[k]
                turn = about_z(heading + self.yaws[k])
                wanted = np.array([x, y, targets.lift[k] + self.sole_heights[k]])
                rows += [FEET[0] * jacobian[:3], FEET[1] * jacobian[3:]]
                errors += [FEET[0] * (wanted - placed.translation), FEET[1] * _rotation_error(turn, placed.rotation)]
            com = pin.jacobianCenterOfMass(model, data, q, False)[:2, self._picked]
            rows.append(COM * com)
            errors.append(COM * (targets.com - data.com[0][:2]))
            root = data.oMi[1]
            pelvis = np.zeros((4, size))
            pelvis[0, :3] = HEIGHT * root.rotation[2]  # velocity columns of the base are in its own axes
            pelvis[1:, 3:6] = PELVIS * root.rotation
            rows.append(pelvis)
            errors.append([HEIGHT * (targets.height - root.translation[2])])
            errors.append(PELVIS * _rotation_error(targets.turn, root.rotation))
            jacobian = np.concatenate(rows)
            error = np.concatenate(errors)
            normal = jacobian.T @ jacobian
            right = jacobian.T @ error
            own = np.arange(6, size)
            normal[own, own] += POSTURE**2
            right[6:] += POSTURE**2 * (posture - q[7 + self.columns])
            normal[np.diag_indices(size)] += DAMPING
            step[self._picked] = np.linalg.solve(normal, right)
            q = pin.integrate(model, q, step)
            q[7 + self.columns] = np.clip(q[7 + self.columns], self._lower, self._upper)
        return q

    def swing_pressure(self) -> Array:
        """(2, 2, 3) what an acceleration (x, y, up) of each foot adds to the centre of pressure [s^2], at home.

        A foot that moves while the centre of mass stays turns the body's angular momentum, and the ground has to give
        that: its pressure moves by the rate of angular momentum over the weight.
        """
        added = np.zeros((2, 2, 3))
        for foot in range(2):
            for axis in range(3):
                by = np.zeros((2, 3))
                by[foot, axis] = 1e-3
                added[foot, :, axis] = self._turned(by, np.zeros(2)) / 1e-3
        return added

    def pendulum_height(self) -> Array:
        """(2,) height [m] of the pendulum that moves as the robot does when it sways along x and along y.

        A sway turns the legs about the feet, so that the pressure is not where a point mass would need it: the same
        relation holds with another height.
        """
        com, _, _ = self.measured(self.home, np.zeros(self.model.model.nv))
        gravity = float(np.linalg.norm(self.model.model.gravity.linear))
        sway = [self._turned(np.zeros((2, 3)), by)[k] / 1e-3 for k, by in enumerate(1e-3 * np.eye(2))]
        return float(com[2]) - gravity * np.array(sway)

    def _turned(self, feet: Array, com: Array) -> Array:
        """How far the pressure (2,) moves per 1/s^2 while feet (2, 3; x, y, up) and centre of mass (2,) move so."""
        pin = pinocchio()
        model, data = self.model.model, self.model.data
        present, _, places = self.measured(self.home, np.zeros(model.nv))
        places[:, :2] += feet[:, :2]
        targets = Targets(places, feet[:, 2], present[:2] + com, float(self.home[2]), self.upright)
        moved = self.solve(self.home, targets, self.home[7 + self.columns], iterations=4)
        pin.computeCentroidalMomentum(model, data, self.home, self.difference(self.home, moved))
        lx, ly, _ = data.hg.angular
        return np.array([-ly, lx]) / (self.mass * float(np.linalg.norm(model.gravity.linear)))

    def difference(self, before: Array, after: Array) -> Array:
        """Velocity (nv,) that leads from one configuration to another in a second."""
        return np.array(pinocchio().difference(self.model.model, before, after))


def _kind(sole: object) -> str:
    return " (no sole)" if sole is None else ""


def about_z(yaw: float) -> Array:
    """The rotation (3, 3) by an angle about the vertical."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rotation_error(wanted: Array, present: Array) -> Array:
    """Rotation vector in the world's axes that turns the present orientation into the wanted one."""
    return np.array(pinocchio().log3(wanted @ present.T))
