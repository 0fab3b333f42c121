"""Reward terms: `(scene, *, parameters) -> (n,)`; the task multiplies by the weight and adds up."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.joints import RangedJointView
from anysim.task.references import Conditions, ContactView
from anysim.task.scene import Frame, RobotView, SceneView
from anysim.task.terms.geometry import Axes, Axis, along, axis_of, turned_by


def distance(scene: SceneView, *, a: Frame, b: Frame, axes: Axes = "xyz") -> Array:
    """Distance of two frames' origins [m], along these axes of the world."""
    return along(b.position - a.position, axes)


@at_most(1.0)
def tanh_distance(
    scene: SceneView,
    *,
    a: Frame,
    b: Frame,
    scale: Annotated[float, Field(gt=0, description="distance at which the reward has dropped to 0.24 [m]")] = 0.1,
    axes: Axes = "xyz",
) -> Array:
    """1 - tanh(distance / scale): 1 when the frames coincide, 0 far away, along these axes of the world."""
    return 1.0 - np.tanh(along(b.position - a.position, axes) / scale)


@at_most(1.0)
def joint_progress(
    scene: SceneView,
    *,
    joint: RangedJointView,
    target: Annotated[float, Field(ge=0, le=1, description="share of the range; 0 is closed")] = 1.0,
) -> Array:
    """1 - |opening - target|: 1 where the joint is open as far as wanted, 0 where it is the whole range away."""
    return 1.0 - np.abs(joint.opening - target)


def action_l2(scene: SceneView) -> Array:
    """Sum of the squared action components."""
    action = scene.last_action[scene.rows]
    return P.dot(action, action) if action.shape[1] else np.zeros(len(action))


def action_rate(scene: SceneView) -> Array:
    """The older name of `action_l2`, which tasks and their recordings keep; the rate itself is `action_rate_l2`."""
    return action_l2(scene)


class ActionRateL2:
    """Sum of the squared changes of the action's components since the control step before; the first is from zero."""

    def __init__(self, scene: SceneView) -> None:
        width = max((columns.stop for columns in scene.action_columns.values()), default=0)
        self._scene, self._update = scene, scene.memory(width + 1)  # the action, and what the change came to

    def __call__(self) -> Array:
        return self._update(self._change)[:, -1]

    def _change(self, before: Array, first: Array) -> Array:
        action = self._scene.last_action[self._scene.rows]
        return np.concatenate([action, np.sum((action - before[:, :-1]) ** 2, axis=1, keepdims=True)], axis=1)


@at_most(1.0)
def alive(scene: SceneView) -> Array:
    """1 in each control step."""
    return np.ones(len(scene.env_ids))


def angle(scene: SceneView, *, a: Frame, b: Frame, symmetry: Annotated[int, Field(ge=1)] = 1) -> Array:
    """Angle between two frames [rad]; b may be the same after each 1/symmetry of a turn about its z axis."""
    return turned_by(a.quaternion, b.quaternion, symmetry)


def axis_angle(scene: SceneView, *, a: Frame, b: Frame, axis: Axis = "z") -> Array:
    """Angle between the same axis of two frames [rad]."""
    return np.arccos(np.clip(P.dot(axis_of(a.quaternion, axis), axis_of(b.quaternion, axis)), -1.0, 1.0))


def height(scene: SceneView, *, a: Frame, b: Frame) -> Array:
    """Height of a's origin over b's, along the world's z [m]."""
    return a.position[:, 2] - b.position[:, 2]


def speed(scene: SceneView, *, frame: Frame) -> Array:
    """Speed of a frame's origin [m/s]."""
    return P.norm(frame.twist[:, :3])


@at_most(1.0)
def contact_force(
    scene: SceneView,
    *,
    sensor: ContactView,
    limit: Annotated[float, Field(gt=0, description="the force counts up to it [N]")] = 100.0,
) -> Array:
    """What a contact sensor feels, as a share of a limit: 0 without contact, at most 1."""
    return np.minimum(sensor.strength / limit, 1.0)


@at_most(1.0)
def stage(scene: SceneView, *, of: Conditions) -> Array:
    """Share of the predicates, in their order, that hold before the first that does not: how far a task has come."""
    return np.logical_and.accumulate(of.each(), axis=0).mean(axis=0)


def joint_speed(scene: SceneView, *, robot: RobotView) -> Array:
    """Sum of the squared velocities of a robot's joints [rad²/s², m²/s²]."""
    return P.dot(robot.joint_vel, robot.joint_vel)


def effort(scene: SceneView, *, robot: RobotView) -> Array:
    """Sum of the squared efforts that a robot's drives exerted in the last substep [N² m², N²]."""
    efforts = scene.state.joint_effort[scene.rows, robot.joints]
    return P.dot(efforts, efforts)


def joint_limit(
    scene: SceneView,
    *,
    robot: RobotView,
    margin: Annotated[float, Field(gt=0, le=0.5, description="of the range, at each end")] = 0.05,
) -> Array:
    """How far a robot's joints are in the margins of their ranges: summed up, 1 for each that is at a limit."""
    limited = np.isfinite(robot.upper - robot.lower)
    position, lower, upper = robot.joint_pos[:, limited], robot.lower[limited], robot.upper[limited]
    left = np.minimum(position - lower, upper - position) / (upper - lower)
    return np.sum(np.clip(1.0 - left / margin, 0.0, 1.0), axis=1)
