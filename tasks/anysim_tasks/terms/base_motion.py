"""Motion, height, posture and effort of walking robots: terms beside those of the velocity itself."""

from fnmatch import fnmatchcase
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim.task.scene import RobotView, SceneView
from anysim_tasks.terms.gait import Feet

Share = Annotated[float, Field(gt=0, description="of its height at home")]


def lin_vel_z_l2(scene: SceneView, *, robot: RobotView) -> Array:
    """Squared velocity of the base along its own z axis [m²/s²]."""
    base = robot.base
    return P.rotate_inverse(base.quaternion, base.twist[:, :3])[:, 2] ** 2


def ang_vel_xy_l2(scene: SceneView, *, robot: RobotView) -> Array:
    """Squared rate at which the base rolls and pitches [rad²/s²]."""
    base = robot.base
    return (P.rotate_inverse(base.quaternion, base.twist[:, 3:])[:, :2] ** 2).sum(axis=1)


def flat_orientation_l2(scene: SceneView, *, robot: RobotView) -> Array:
    """Squared sine of the angle by which the base is off level."""
    x, y = robot.base.quaternion[:, 0], robot.base.quaternion[:, 1]
    return 1.0 - (1.0 - 2.0 * (x * x + y * y)) ** 2


def _over_ground(scene: SceneView, robot: RobotView) -> Array:
    """(n,) height of the base over the mean ground under its feet, as a share of that at home.

    Not over the ground under the base: that rises at once where a robot begins to climb a step.
    """
    feet = Feet.of(scene, robot)
    return (robot.base.position[:, 2] - feet.ground.mean(axis=1)) / feet.height


def base_height_l2(scene: SceneView, *, robot: RobotView, share: Share = 0.93) -> Array:
    """Squared error of the base's height over the ground, as a share of that at home."""
    return (_over_ground(scene, robot) - share) ** 2


def base_sunk(scene: SceneView, *, robot: RobotView, share: Share = 0.5) -> Array:
    """The base is lower over the ground than a share of its height at home."""
    return _over_ground(scene, robot) < share


class JointDeviationL2:
    """Sum of the squared differences of a robot's joints from its home [rad²]."""

    def __init__(
        self,
        scene: SceneView,
        *,
        robot: RobotView,
        joints: Annotated[
            str, Field(description="which, by name; `*` matches any part, and `hips` is the first joint of each leg")
        ] = "*",
    ) -> None:
        world, entry = scene.engine.world, robot.model.entry
        names = [joint.name.removeprefix(f"{robot.name}.") for joint in world.joints[robot.joints]]
        hips = {leg.joints[0] for leg in entry.legs.values()} if entry is not None else set[str]()
        found = [k for k, n in enumerate(names) if (n in hips if joints == "hips" else fnmatchcase(n, joints))]
        if not found:
            raise TaskError(f"no joint of '{robot.name}' is '{joints}' (joints: {listing(names, 20)})")
        self._robot, self._columns = robot, np.array(found)
        self._home = np.array([world.joints[robot.joints][k].initial for k in found])

    def __call__(self) -> Array:
        return ((self._robot.joint_pos[:, self._columns] - self._home) ** 2).sum(axis=1)


class EffortShareL2:
    """Sum of the squared efforts of a robot's drives in the last substep, as shares of their limits."""

    def __init__(self, scene: SceneView, *, robot: RobotView) -> None:
        own = range(robot.joints.start, robot.joints.stop)
        drives = [one for one in scene.engine.world.actuators if one.joint in own]
        self._scene, self._joints = scene, np.array([one.joint for one in drives])
        self._limit = np.array([one.effort_limit for one in drives], dtype=float)
        if not np.isfinite(self._limit).all():
            raise TaskError(f"drives of '{robot.name}' have no effort limit to compare with; use the term `effort`")

    def __call__(self) -> Array:
        effort = self._scene.state.joint_effort[self._scene.rows][:, self._joints]
        return ((effort / self._limit) ** 2).sum(axis=1)
