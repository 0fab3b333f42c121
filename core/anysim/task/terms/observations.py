"""Observation terms: `(scene, *, parameters) -> (n, k)`."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim.task.joints import RangedJointView
from anysim.task.references import Conditions, ContactView, PointsView, SensorView
from anysim.task.scene import DrawnView, Frame, ObjectView, RobotView, SceneView
from anysim.task.slot_frames import CategoryView
from anysim.task.terms.geometry import least_turn
from anysim_schemas.base import Number, Positive

_DOWN = np.array([0.0, 0.0, -1.0])


def base_pose(scene: SceneView, *, robot: RobotView) -> Array:
    """Pose of the base's frame in the world [m, xyzw]; the quaternion's scalar part is never negative."""
    return P.unsigned(robot.base.pose)


def base_lin_vel(scene: SceneView, *, robot: RobotView) -> Array:
    """Velocity of the base's origin in the base's own axes [m/s]."""
    return P.rotate_inverse(robot.base.quaternion, robot.base.twist[:, :3])


def base_ang_vel(scene: SceneView, *, robot: RobotView) -> Array:
    """Rate of the base in its own axes [rad/s], as a gyroscope there reads."""
    return P.rotate_inverse(robot.base.quaternion, robot.base.twist[:, 3:])


def projected_gravity(scene: SceneView, *, robot: RobotView) -> Array:
    """The world's direction downwards in the base's axes: (0, 0, -1) upright. A measure of tilt that ignores yaw."""
    turn = robot.base.quaternion
    return P.rotate_inverse(turn, np.broadcast_to(_DOWN, (len(turn), 3)))


def tool_pose(
    scene: SceneView, *, robot: RobotView, tool: str = "tool", frame: Literal["world", "base"] = "world"
) -> Array:
    """Pose of a tool in the world or in the base's frame [m, xyzw]; the quaternion's scalar part is never negative."""
    pose = robot.tool(tool).pose
    return P.unsigned(pose if frame == "world" else P.compose(P.inverse(robot.base.pose), pose))


def tool_twist(
    scene: SceneView, *, robot: RobotView, tool: str = "tool", frame: Literal["world", "base"] = "world"
) -> Array:
    """Velocity of a tool's origin and its rate [m/s, rad/s]: in the world, or as seen from the base, in its axes."""
    moving = robot.tool(tool)
    if frame == "world":
        return moving.twist
    base = robot.base
    arm = moving.position - base.position
    linear = moving.twist[:, :3] - base.twist[:, :3] - P.cross(base.twist[:, 3:], arm)
    angular = moving.twist[:, 3:] - base.twist[:, 3:]
    turn = base.quaternion
    return np.concatenate([P.rotate_inverse(turn, linear), P.rotate_inverse(turn, angular)], axis=1)


def channel_joint_pos(
    scene: SceneView, *, robot: RobotView, channel: str = "arm", relative: Literal["home", "zero"] = "home"
) -> Array:
    """Joint positions of a channel [rad, m], less the nominal home or as they are."""
    own = robot.channel_columns(channel)
    position = scene.state.joint_pos[scene.rows][:, own.joints]
    return position if relative == "zero" else position - own.home


def channel_joint_vel(scene: SceneView, *, robot: RobotView, channel: str = "arm") -> Array:
    """Joint velocities of a channel [rad/s, m/s]."""
    return scene.state.joint_vel[scene.rows][:, robot.channel_columns(channel).joints]


def channel_action(scene: SceneView, *, robot: RobotView, channel: str = "arm") -> Array:
    """The last action of a channel, clipped to its bounds; zero right after a reset."""
    robot.channel(channel)
    columns = scene.action_columns.get(f"{robot.name}.{channel}")
    if columns is None:
        raise TaskError(
            f"the channel '{robot.name}.{channel}' has no controller, so it has no action; add "
            f"world.robots.{robot.name}.actions.{channel} (channels with one: {listing(scene.action_columns)})"
        )
    return scene.last_action[scene.rows][:, columns]


def commanded_velocity(scene: SceneView, *, robot: RobotView, channel: str = "base") -> Array:
    """The velocities that the drives of a channel are commanded now [rad/s, m/s]; 0 where only positions are."""
    return scene.engine.control.velocity[scene.rows][:, robot.channel_columns(channel).drives]


def commanded_position(scene: SceneView, *, robot: RobotView, channel: str = "arm") -> Array:
    """The joint targets of a channel's drives now [rad, m]."""
    return scene.engine.control.position[scene.rows][:, robot.channel_columns(channel).drives]


def gripper_width(scene: SceneView, *, robot: RobotView, channel: str = "eef") -> Array:
    """How far a gripper is open [m], of fingers that turn [rad]: the sum over its joints from where it is closed."""
    own = robot.channel(channel)
    if own.closed is None:
        grippers = [name for name, one in robot.model.channels.items() if one.closed is not None]
        raise TaskError(
            f"the channel '{robot.name}.{channel}' is no gripper: its entry in the catalogue has no `closed` "
            f"(grippers: {listing(grippers)})"
        )
    fingers = [scene.engine.world.joints[joint] for joint in own.joints]
    closed = np.clip(own.closed, [j.lower for j in fingers], [j.upper for j in fingers])  # targets may lie beyond
    position = scene.state.joint_pos[scene.rows][:, robot.channel_columns(channel).joints]
    return np.abs(position - closed).sum(axis=1, keepdims=True)


def joint_pos(scene: SceneView, *, robot: RobotView) -> Array:
    """Joint positions of a robot [rad, m]."""
    return robot.joint_pos


def joint_vel(scene: SceneView, *, robot: RobotView) -> Array:
    """Joint velocities of a robot [rad/s, m/s]."""
    return robot.joint_vel


def object_joint_pos(scene: SceneView, *, object: ObjectView) -> Array:
    """Joint positions of an articulated object [rad, m]."""
    return object.joint_pos


def object_joint_vel(scene: SceneView, *, object: ObjectView) -> Array:
    """Joint velocities of an articulated object [rad/s, m/s]."""
    return object.joint_vel


def joint_opening(scene: SceneView, *, joint: RangedJointView) -> Array:
    """How far a joint is open: 0 at the limit that is nearer to zero, 1 at the other."""
    return joint.opening[:, None]


def frame_pose(scene: SceneView, *, frame: Frame) -> Array:
    """Pose of a frame in the world [m, xyzw]; the quaternion's scalar part is never negative."""
    return P.unsigned(frame.pose)


def _flat(rows: Array) -> Array:
    """(n, K, k) as (n, K k), also of no env."""
    return rows.reshape(len(rows), rows.shape[1] * rows.shape[2])


def frame_twist(scene: SceneView, *, frame: Frame) -> Array:
    """Velocity of a frame's origin and its rate, world axes [m/s, rad/s]."""
    return frame.twist


def drawn(scene: SceneView, *, value: DrawnView) -> Array:
    """What `collect.bind` has drawn: the number; of words or flags one column for each, 1 for the one that it is."""
    return value.rows[value.index[scene.env_ids]]


def goal_position(scene: SceneView, *, goal: Frame) -> Array:
    """Position of a goal in the world [m]."""
    return goal.position


def offset(scene: SceneView, *, a: Frame, b: Frame) -> Array:
    """From a to b, in the axes of a [m]."""
    return P.rotate_inverse(a.quaternion, b.position - a.position)


def relative_pose(scene: SceneView, *, a: Frame, b: Frame) -> Array:
    """Pose of b in the axes of a [m, xyzw]; the quaternion's scalar part is never negative."""
    return P.unsigned(P.compose(P.inverse(a.pose), b.pose))


def relative_rotation(scene: SceneView, *, a: Frame, b: Frame, symmetry: Annotated[int, Field(ge=1)] = 1) -> Array:
    """Turn from a to b in the axes of a, as a rotation vector [rad]; b may look the same 1/symmetry of a turn on.

    Of the turns about its z axis that b may be given without a difference it is to the nearest.
    """
    return least_turn(a.quaternion, b.quaternion, symmetry)


def points(scene: SceneView, *, points: PointsView, frame: Frame) -> Array:
    """Points one after the other, in the axes of a frame [m]; zero for those that are not there."""
    return _offsets(frame, points.positions, points.present)


def _offsets(frame: Frame, positions: Array, present: Array) -> Array:
    apart = positions - frame.position[:, None]
    turn = np.broadcast_to(frame.quaternion[:, None], (*apart.shape[:2], 4))
    return _flat(np.where(present[..., None], P.rotate_inverse(turn, apart), 0.0))


def contact_force(
    scene: SceneView,
    *,
    sensor: ContactView,
    limit: Annotated[float, Field(gt=0, description="each component is cut off at it [N]")] = 100.0,
) -> Array:
    """The net force on the body of a contact sensor, world axes [N]."""
    return np.clip(sensor.force, -limit, limit)


def sensor(scene: SceneView, *, of: SensorView) -> Array:
    """What is seen of a sensor: one field of it, `imu.acceleration`, or all but its `time` and `valid`."""
    return of.values()


def holds(scene: SceneView, *, of: Conditions) -> Array:
    """1 for each of the predicates that holds, 0 for the others, in order: how far a task has come."""
    return of.each().T.astype(np.float64)


class Progress:
    """Share of the predicates that are behind: each counts once it holds after all before it did, until the end."""

    def __init__(self, scene: SceneView, *, of: Conditions) -> None:
        self._of, self._update = of, scene.memory()

    def __call__(self) -> Array:
        return self._update(self._pass) / len(self._of)

    def _pass(self, before: Array, first: Array) -> Array:
        behind = before[:, 0]
        for number, holds in enumerate(self._of.each()):
            behind = behind + ((behind == number) & holds)
        return behind[:, None]


def time_left(scene: SceneView, *, steps: Annotated[int, Field(ge=1, description="the horizon")]) -> Array:
    """Share of so many control steps that is left of the episode: 1 at its beginning."""
    return np.clip(1.0 - scene.elapsed[scene.rows, None] / steps, 0.0, 1.0)


def present(scene: SceneView, *, object: ObjectView) -> Array:
    """1 where an object is there, 0 where it is not."""
    return object.present[:, None].astype(float)


def category_present(scene: SceneView, *, category: CategoryView) -> Array:
    """For each instance of a category 1 where it is there, 0 where it is not: the mask of the terms below."""
    return category.present.astype(float)


def category_pose(scene: SceneView, *, category: CategoryView) -> Array:
    """Poses of all instances of a category, one after the other [m, xyzw]; absent ones have the world's own frame."""
    return _flat(P.unsigned(category.poses))


def category_twist(scene: SceneView, *, category: CategoryView) -> Array:
    """Velocities of all instances of a category, one after the other [m/s, rad/s]; zero for absent ones."""
    return _flat(category.twists)


def category_offset(scene: SceneView, *, frame: Frame, category: CategoryView) -> Array:
    """From a frame to each instance of a category, in the frame's axes [m]; zero for absent ones."""
    return _offsets(frame, category.positions, category.present)


def height_scan(
    scene: SceneView,
    *,
    frame: Frame,
    length: Positive = 1.6,
    width: Positive = 1.0,
    spacing: Positive = 0.1,
    offset: Number = 0.0,
    limit: Positive = 1.0,
) -> Array:
    """How far the ground lies below a frame [m], on a grid around it that turns with its yaw.

    From the world's own geometry, so the same on every engine. The grid is `length` along the frame's heading times
    `width` across, points `spacing` apart: first along, then across, both from the lowest. `offset` is taken off, what
    is left is clipped to [-limit, limit]; where there is no ground it is `limit`.
    """
    along, across = (np.arange(round(extent / spacing) + 1) * spacing - extent / 2 for extent in (length, width))
    x, y = (values.ravel() for values in np.meshgrid(along, across))
    turn = frame.quaternion
    yaw = np.arctan2(
        2.0 * (turn[:, 3] * turn[:, 2] + turn[:, 0] * turn[:, 1]), 1.0 - 2.0 * (turn[:, 1] ** 2 + turn[:, 2] ** 2)
    )[:, None]
    cosine, sine = np.cos(yaw), np.sin(yaw)
    at = frame.position
    points = np.stack([at[:, :1] + cosine * x - sine * y, at[:, 1:2] + sine * x + cosine * y], axis=-1)
    below = at[:, 2:] - scene.engine.world.ground.heights_at(points) - offset
    return np.clip(np.nan_to_num(below, nan=limit), -limit, limit)


def last_action(scene: SceneView) -> Array:
    """The last action, clipped to its bounds; zero right after a reset."""
    return scene.last_action[scene.rows]
