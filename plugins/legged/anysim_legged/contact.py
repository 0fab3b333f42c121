"""Efforts of the drives: inverse dynamics of the whole body with the ground's forces shared by the feet."""

import numpy as np

from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.kinematics.pinocchio_model import pinocchio, se3
from anysim_legged.wholebody import WholeBody


class Pushes:
    """Feed-forward of all drives of a robot that stands on one or both of its feet."""

    def __init__(self, whole: WholeBody, robot: ControlledRobot, soles: Array) -> None:
        self._whole = whole
        self._soles = soles
        world, first = robot.world, int(robot.joints[0])
        joints = [world.joints[j] for j in robot.joints]
        driven = {int(column): d for d, column in enumerate(robot.drive_columns)}
        self._gather = np.zeros((len(robot.drives), len(joints)))
        """What acts on a joint, at the drive that carries it: its own, or its leader's."""
        for column, joint in enumerate(joints):
            if column in driven:
                self._gather[driven[column], column] = 1.0
            elif joint.mimic is not None and joint.mimic.joint - first in driven:
                self._gather[driven[joint.mimic.joint - first], column] = joint.mimic.multiplier
        self.effort = np.zeros(len(robot.drives))
        self.wrenches = np.zeros((2, 6))
        """What the ground is expected to give each foot at the middle of its sole: force and torque, world axes."""

    def required(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Efforts (nv,) of inverse dynamics; force (3,) and torque about the origin (3,) that the ground owes.

        The acceleration of joints that others move comes from their measured motion. Their weight on the ground obeys
        it, their own drives do not: an effort that follows what is measured takes their inertia away, and light gains
        then swing up by themselves.
        """
        pin = pinocchio()
        efforts = self._whole.model.inverse_dynamics(q, v, a)
        owed = se3(q[:7]).act(pin.Force(efforts[:6]))
        others = 6 + self._whole.others
        if others.size:
            planned = a.copy()
            planned[others] = 0.0
            efforts[others] = self._whole.model.inverse_dynamics(q, v, planned)[others]
        return efforts, np.array(owed.linear), np.array(owed.angular)

    def solve(
        self, q: Array, efforts: Array, force: Array, torque: Array, places: Array, lift: Array, shares: Array
    ) -> Array:
        """Efforts (D,) of the robot's drives where the ground gives that force and torque (about the origin).

        Args:
            q: configuration (nq,) of the inverse dynamics.
            efforts: what `required` found (nv,).
            force, torque: of the ground on the robot, in all.
            places, lift: where the feet are.
            shares: (2,) of each foot in the force; they sum to 1.
        """
        pin = pinocchio()
        model, data = self._whole.model.model, self._whole.model.data
        middles = np.concatenate([self._whole.middles(places), lift[:, None]], axis=1)
        left = torque - (shares[:, None] * np.cross(middles, force)).sum(axis=0)
        efforts = efforts.copy()
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for k, share in enumerate(shares):
            if share <= 0.0:
                self.wrenches[k] = 0.0
                continue
            own = share * force
            about = self._within(k, places[k, 2] + self._whole.yaws[k], own[2], share * left)
            self.wrenches[k] = [*own, *about]
            frame = data.oMf[self._whole.feet[k]]
            arm = middles[k] - frame.translation
            at_frame = np.concatenate([own, about + np.cross(arm, own)])
            jacobian = pin.getFrameJacobian(model, data, self._whole.feet[k], pin.LOCAL_WORLD_ALIGNED)
            efforts -= jacobian.T @ at_frame
        self.effort = self._gather @ efforts[6:]
        return self.effort

    def _within(self, k: int, yaw: float, normal: float, torque: Array) -> Array:
        """The torque at the middle of a sole, with its centre of pressure kept inside."""
        if normal <= 1.0:
            return np.zeros(3)
        half = (self._soles[k, [1, 3]] - self._soles[k, [0, 2]]) / 2.0
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = -torque[1] / normal, torque[0] / normal
        x, y = np.clip(c * x + s * y, -half[0], half[0]), np.clip(-s * x + c * y, -half[1], half[1])
        return np.array([normal * (s * x + c * y), -normal * (c * x - s * y), torque[2]])


def pressure(force: Array, torque: Array) -> Array:
    """Where a force and a torque about the origin cross the ground: centre of pressure (2,)."""
    return np.array([-torque[1], torque[0]]) / force[2]


def shifted(force: Array, torque: Array, by: Array, com: Array) -> tuple[Array, Array]:
    """The ground's force with its centre of pressure moved by (2,), its torque about the centre of mass kept.

    A pendulum whose foot moves: the horizontal force that belongs to it acts at the centre of mass (3,).
    """
    more = np.array([-force[2] * by[0] / com[2], -force[2] * by[1] / com[2], 0.0])
    return force + more, torque + np.cross(com, more)


def share_of(cop: Array, middles: Array) -> Array:
    """Shares (2,) of two feet in the force: where the pressure's centre (2,) is between their middles."""
    across = middles[0] - middles[1]
    left = float(np.clip((cop - middles[1]) @ across / max(float(across @ across), 1e-9), 0.0, 1.0))
    return np.array([left, 1.0 - left])
