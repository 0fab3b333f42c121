"""Standing on two feet: squat, lean and turn the trunk, with arms that another controller moves."""

from collections.abc import Mapping

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim_legged.tracking import Tracker
from anysim_legged.wholebody import Targets, about_z


class HumanoidBalance(Controller):
    """Keeps both feet where they are. The action says how the trunk differs from home; zero stands at home.

    Components: `height` of the pelvis [m], `lean_x` and `lean_y` of the centre of mass on the ground [m], and `roll`,
    `pitch`, `yaw` of the pelvis [rad], all in the axes that the feet have at home. They are followed smoothly
    (`response`). The joints of other channels are where they are: their weight and motion are balanced, and the
    feed-forward of their drives comes from here as well.

    Method: whole-body inverse kinematics, inverse dynamics of its motion as feed-forward with the ground's forces
    shared by the feet, and the centre of pressure moved by `gain` times the error of the capture point (divergent
    component of motion), as far as the soles allow.

    Args:
        channel, num_envs: as for every controller.
        height, lean, tilt: bounds of the components: lowest and highest height [m], lean [m], angles [rad].
        response: [rad/s] of the critically damped filter that smooths the action.
        gain: of the capture point's error; above 1 to be stable.
        margin: rim of the soles that is not relied on [m].

    Raises:
        TaskError: a robot without two flat feet, or whose home does not stand.
    """

    labels = ("height", "lean_x", "lean_y", "roll", "pitch", "yaw")
    period: float = 0.01

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        height: tuple[float, float] = (-0.25, 0.02),
        lean: float = 0.05,
        tilt: float = 0.3,
        response: float = 3.0,
        gain: float = 3.0,
        margin: float = 0.005,
    ) -> None:
        super().__init__(channel, num_envs)
        if gain <= 1.0:
            raise TaskError(f"humanoid_balance: gain must be above 1 to balance, got {gain:g}")
        self.tracker = Tracker(channel, num_envs, self.period, gain, margin)
        self._response = response
        self.dim = len(self.labels)
        self.high = np.array([height[1], lean, lean, tilt, tilt, tilt])
        self.low = np.array([height[0], -lean, -lean, -tilt, -tilt, -tilt])
        self._wanted = np.zeros((num_envs, self.dim))
        self._state = np.zeros((num_envs, 2, self.dim))
        """The smoothed action and its rate."""
        self._feet = np.zeros((num_envs, 2, 3))
        whole = self.tracker.whole
        com, _, places = whole.measured(whole.home, np.zeros(whole.model.model.nv))
        self._com = np.array(com[:2])
        self._height = float(whole.home[2])
        self._home_feet = places

    def reset(self, env_ids: Array, targets: Array) -> None:
        positions, bases = self.robot.joint_pos(env_ids), self.robot.base_pose(env_ids)
        for row, env in enumerate(env_ids):
            self._feet[env] = self.tracker.begin(int(env), positions[row], bases[row])
        self._wanted[env_ids], self._state[env_ids] = 0.0, 0.0

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        self._wanted[slice(None) if env_ids is None else env_ids] = action
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        envs = np.arange(self.num_envs) if env_ids is None else env_ids
        robot, model = self.robot, self.tracker.whole.model
        positions, rates = robot.joint_pos(env_ids), robot.joint_vel(env_ids)
        bases, twists = robot.base_pose(env_ids), robot.base_twist(env_ids)
        orders = []
        for row, env in enumerate(envs):
            seen = model.q(positions[row], bases[row]), model.v(rates[row], bases[row], twists[row])
            orders.append(self.tracker.follow(int(env), self._targets(int(env)), (True, True), seen))
        return Command(
            np.array([o.position for o in orders]),
            np.array([o.velocity for o in orders]),
            None,
            np.array([o.effort for o in orders]),
        )

    def _targets(self, env: int) -> Targets:
        tick, w = self.tracker.tick, self._response
        value, rate = self._state[env]
        rate += tick * (w * w * (self._wanted[env] - value) - 2.0 * w * rate)
        value += tick * rate
        feet = self._feet[env]
        middle = feet[:, :2].mean(axis=0)
        across = feet[0, :2] - feet[1, :2]
        turn = about_z(float(np.arctan2(-across[0], across[1])))
        com = middle + turn[:2, :2] @ (self._com + value[1:3])
        roll, pitch, yaw = value[3:]
        tilt = about_z(yaw) @ _about(1, pitch) @ _about(0, roll)
        height = self._height + value[0]
        return Targets(feet, np.zeros(2), com, float(height), turn @ tilt @ self.tracker.whole.upright)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        own = {"wanted": self._wanted, "state": self._state, "stance": self._feet}
        return self.tracker.snapshot(env_ids) | {name: a[env_ids].copy() for name, a in own.items()}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self.tracker.restore(env_ids, data)
        self._wanted[env_ids], self._state[env_ids] = data["wanted"], data["state"]
        self._feet[env_ids] = data["stance"]


def _about(axis: int, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    if axis == 0:
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
