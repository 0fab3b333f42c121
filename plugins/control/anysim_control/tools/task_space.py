"""The arithmetic of operational space control for one robot state."""

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.pinocchio_model import pinocchio
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.link_effort import LinkEffort

SINGULAR = 1e-4
"""[1/kg], [1/(kg m^2)] added to the inverse inertia of the tools. An arm that cannot move its tool in a direction has
none there; with this it is finite, and the pull on such a direction bounded."""


class TaskSpace:
    """Not safe for two threads at once."""

    def __init__(
        self,
        frames: ToolFrames,
        *,
        stiffness: float,
        damping_ratio: float,
        posture_stiffness: float,
        max_speed: float,
        max_turn_rate: float,
        oriented: bool,
        carry_weight: bool | None,
    ) -> None:
        self._frames, self._model = frames, frames.robot.kinematics
        self._floating = 6 if self._model.floating else 0
        self._kp, self._kd = stiffness, 2.0 * damping_ratio * np.sqrt(stiffness)
        self._own_kp, self._own_kd = posture_stiffness, 2.0 * np.sqrt(posture_stiffness)
        self._max_speed, self._max_turn_rate = max_speed, max_turn_rate
        self._axes = 6 if oriented else 3
        self._links = LinkEffort(frames.robot, carry_weight)
        self._still = np.zeros(len(frames.robot.joints))
        self._data = self._model.model.createData()

    def effort(
        self,
        joint_pos: Array,
        joint_vel: Array,
        targets: Array,
        twist: Array,
        acceleration: Array,
        posture: Array,
        base: Array,
    ) -> tuple[Array, Array]:
        """Efforts (K,) of the channel's drives, and the accelerations (K,) that they give where nothing is touched.

        Args:
            joint_pos: (J,) measured.
            joint_vel: (J,) measured.
            targets: (T, 7) where tools are to be now, base frame.
            twist: (T, 6) how fast, base axes.
            acceleration: (T, 6) and how fast that changes.
            posture: (K,) where joints go as far as tools leave them free.
            base: (7,) world pose of the base: its attitude says which way the weight pulls.
        """
        spread, columns = self._frames.spread, self._frames.channel.joint_columns
        places, jacobian = self._frames.poses_and_jacobians(joint_pos)
        error = self._frames.errors(places, targets)
        flat = jacobian[:, : self._axes].reshape(-1, spread.shape[1])
        own_rate = joint_vel[columns]
        rate = (jacobian @ own_rate).reshape(-1, 6)
        towards = self._towards(error) + twist
        wanted = acceleration + self._kd * (towards - rate) - self._drift(joint_pos, joint_vel)
        mass = spread.T @ self._inertia(joint_pos) @ spread
        inverse = np.linalg.inv(mass)
        mobility = flat @ inverse @ flat.T
        load = np.linalg.inv(mobility + SINGULAR * np.eye(len(mobility)))
        tool = flat.T @ (load @ wanted[:, : self._axes].reshape(-1))
        pull = mass @ (self._own_kp * (posture - joint_pos[columns]) - self._own_kd * own_rate)
        free = pull - flat.T @ (load @ (flat @ (inverse @ pull)))
        moving = tool + free
        # The rates at which springs and dampers are in balance tell which way dry friction will be overcome; measured
        # ones would say nothing of a joint that sticks.
        back = inverse @ flat.T @ load
        aim = self._own_kp / self._own_kd * (posture - joint_pos[columns])
        aim = aim + back @ (towards[:, : self._axes].reshape(-1) - flat @ aim)
        carried = self._links.of(joint_pos, joint_vel, self._still, base, spread @ aim)
        return moving + spread.T @ carried, inverse @ moving

    def _towards(self, error: Array) -> Array:
        """(T, 6) speeds at which the spring and the damper are in balance, no faster than allowed."""
        speed = self._kp / self._kd * error
        size = np.sqrt((speed.reshape(-1, 2, 3) ** 2).sum(axis=2))
        most = np.array([self._max_speed, self._max_turn_rate])
        return (speed.reshape(-1, 2, 3) * (most / np.maximum(size, most))[:, :, None]).reshape(-1, 6)

    def _drift(self, joint_pos: Array, joint_vel: Array) -> Array:
        """(T, 6) accelerations of the tools at constant joint rates, base axes."""
        pin, model, data = pinocchio(), self._model.model, self._data
        rates = self._model.v(joint_vel)
        pin.forwardKinematics(model, data, self._model.q(joint_pos), rates, np.zeros(model.nv))
        return np.array(
            [
                pin.getFrameClassicalAcceleration(model, data, int(f), pin.LOCAL_WORLD_ALIGNED).vector
                for f in self._frames.frames
            ]
        )

    def _inertia(self, joint_pos: Array) -> Array:
        """(J, J) on a base that stands still."""
        return self._model.mass_matrix(self._model.q(joint_pos))[self._floating :, self._floating :]
