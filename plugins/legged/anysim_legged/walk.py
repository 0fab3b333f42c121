"""Walking on flat ground: footsteps, a pendulum that follows them, and the whole body that follows the pendulum."""

from collections.abc import Mapping

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim_legged.catch import HELD, STANDS, beyond, lowered
from anysim_legged.footsteps import Feet, Footsteps, Gait
from anysim_legged.preview import Preview
from anysim_legged.tracking import Tracker
from anysim_legged.wholebody import Targets, about_z

HORIZON = 2.2
"""[s] of footsteps that the pendulum knows ahead: beyond, exp(-omega HORIZON) is below a thousandth."""

LATER = 2.5
"""Steps after which a velocity is walked: of the next one the place is known when it begins, and the body gets there
with the one after it. Measured with the G1 on changing velocities: 1.8 to 2 s, at 0.7 s a step."""


class LipmWalk(Controller):
    """Walks with the velocity (vx, vy, turn rate) of the action [m/s, rad/s], in the robot's heading; zero stands.

    Method: footsteps, the centre of mass of a linear inverted pendulum with a preview of the centre of pressure
    (Kajita et al. 2003), whole-body inverse kinematics, inverse dynamics of the reference motion as feed-forward, and
    the centre of pressure moved by `gain` times the error of the capture point, relative to the measured stance foot. A
    push that the pressure does not hold is caught by steps (`catch`), from standing as well; a walk then begins anew.

    Args:
        channel, num_envs: as for every controller.
        forward, sideways, turning: largest speeds [m/s], [m/s], [rad/s].
        double, single: [s] of a step with both feet and with one foot on the ground.
        clearance: how high a foot is lifted [m].
        acceleration: how fast the speed that is walked follows the action, in units of the largest speed per second.
        gain: of the capture point's error; above 1 to be stable.
        margin: rim of the soles that is not relied on [m].

    Raises:
        TaskError: a robot without two flat feet, or whose home does not stand.
    """

    labels = ("forward", "left", "turn")
    period: float = 0.01

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        forward: float = 0.3,
        sideways: float = 0.1,
        turning: float = 0.3,
        double: float = 0.2,
        single: float = 0.5,
        clearance: float = 0.05,
        acceleration: float = 0.7,
        gain: float = 2.0,
        margin: float = 0.005,
    ) -> None:
        super().__init__(channel, num_envs)
        if gain <= 1.0 or min(double, single) <= 0.0:
            raise TaskError(
                f"lipm_walk: gain must be above 1, double and single above 0; got {gain:g}, {double:g}, {single:g}"
            )
        self.delay = LATER * (double + single)
        self.tracker = Tracker(channel, num_envs, self.period, gain, margin)
        whole = self.tracker.whole
        self.dim = len(self.labels)
        self.high = np.array([forward, sideways, turning])
        self.low = -self.high
        self._slew = acceleration * self.high
        self._height = float(whole.home[2])
        com, _, places = whole.measured(whole.home, np.zeros(whole.model.model.nv))
        omega = np.sqrt(-self.robot.world.physics.gravity[2] / whole.pendulum_height())
        self._omega = omega
        self._steps = Footsteps(
            Gait(double, single, clearance, 1.0, whole.stance), self.tracker.tick, num_envs, whole.swing_pressure()
        )
        self._preview = Preview(omega, self.tracker.tick, HORIZON)
        middles = whole.middles(places)
        self._offset = middles - places[:, :2]
        self._lean = np.array(com[:2]) - middles.mean(axis=0)
        """Where the centre of mass is at home relative to the middle of the soles; walking begins and ends there."""
        self._offset[:, 0] += self._lean[0]
        self._under = places[:, :2] - np.array(com[:2])
        """(2, 2) where the feet are at home, seen from the centre of mass."""
        self._wanted, self._command = np.zeros((num_envs, 3)), np.zeros((num_envs, 3))
        self._com = np.zeros((num_envs, 2))
        self._seen = np.zeros((num_envs, 2, 2))
        """The capture point's error, and where the pressure was to be without it."""
        self._excess = np.zeros((num_envs, 2))
        """What of that error the pressure under the standing feet does not hold [m]."""

    def planned(self, env_ids: Array | None = None) -> Array:
        """Where the centre of mass of the plan is now (E, 2) [m], in the world, had no foot ever slipped."""
        envs = np.arange(self.num_envs) if env_ids is None else env_ids
        return np.array([self._steps.planned(int(env), self._com[env]) for env in envs])

    def reset(self, env_ids: Array, targets: Array) -> None:
        positions, bases = self.robot.joint_pos(env_ids), self.robot.base_pose(env_ids)
        for row, env in enumerate(env_ids):
            places = self.tracker.begin(int(env), positions[row], bases[row])
            self._steps.begin(int(env), places)
            self._com[env] = self._middles(places).mean(axis=0)
        for values in (self._wanted, self._command, self._seen, self._excess):
            values[env_ids] = 0.0

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
            targets, standing, jump = self._targets(int(env))
            orders.append(self.tracker.follow(int(env), targets, standing, seen, jump))
            error, pressure, corners = orders[-1].error, orders[-1].pressure, orders[-1].corners
            part = STANDS if self._steps.stands(int(env)) else HELD
            self._seen[env] = error, pressure
            self._excess[env] = beyond(error, pressure, corners, part)
        return Command(
            np.array([o.position for o in orders]),
            np.array([o.velocity for o in orders]),
            None,
            np.array([o.effort for o in orders]),
        )

    def _targets(self, env: int) -> tuple[Targets, tuple[bool, bool], Array | None]:
        slew = self._slew * self.tracker.tick
        self._command[env] += np.clip(self._wanted[env] - self._command[env], -slew, slew)
        feet = self._steps.now(env)
        command = self._command[env]
        com = self._planned(env)
        jump = self._catch(env, com, feet) if self._excess[env].any() else None
        self._com[env] = com if jump is None else com + self.tracker.tick * jump
        self._steps.advance(env, command, self._middles(feet.places), self.tracker.lead[env])
        feet = self._steps.now(env)
        left, right = feet.places
        heading = right[2] + P.wrapped(left[2] - right[2]) / 2.0
        turn = about_z(heading)
        aside = feet.places[:, :2] - self._com[env] - self._under @ turn[:2, :2].T
        height = self._height - lowered(aside, feet.lift)
        upright = turn @ self.tracker.whole.upright
        return Targets(feet.places, feet.lift, self._com[env].copy(), height, upright), feet.standing, jump

    def _planned(self, env: int, further: float = 0.0) -> Array:
        """The centre of mass (2,) a tick from now, if the swinging foot lands that much further than planned."""
        pressure = self._steps.pressure(env, self._command[env], self._preview.times, self._offset, further)
        return self._preview.next(self._com[env], pressure)

    def _catch(self, env: int, com: Array, feet: Feet) -> Array | None:
        """Move a step, or begin one, so that the plan holds what the pressure does not.

        Returns by how much (2,) the speed of the centre of mass is another in the new plan [m/s], with whose old one it
        would be at `com` (2,) next.
        """
        steps, metre = self._steps, self.tracker.tick * self._omega
        error, pressure = self._seen[env]
        if steps.stands(env):
            middles = self._middles(feet.places)
            across = middles[0] - middles[1]
            steps.start(env, 0 if error @ across >= 0.0 else 1, middles, self._command[env])
        elif not steps.catches(env):
            return None
        corners = self.tracker.corners(feet.places, feet.standing)
        least, chosen, shift, after = np.inf, 1.0, np.zeros(2), com
        for rate in steps.rates(env):
            steps.pace(env, rate)
            new = self._planned(env)
            per_metre = self._planned(env, 1.0) - new
            by = metre * beyond(error - (new - com) / metre, pressure, corners, HELD) / per_metre
            further, done = steps.landing(env, by)
            left = float(np.abs((by - done) * per_metre / metre).sum())
            if left < least - 1e-3:
                least, chosen, shift, after = left, rate, further, new + per_metre * done
        steps.pace(env, chosen)
        steps.send(env, shift)
        self._command[env] = 0.0
        return (after - com) / self.tracker.tick

    def _middles(self, places: Array) -> Array:
        """(2, 2) where each foot, at its place, is pressed on when it carries alone."""
        c, s = np.cos(places[:, 2]), np.sin(places[:, 2])
        x, y = self._offset.T
        return places[:, :2] + np.stack([c * x - s * y, s * x + c * y], axis=1)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        own = {name: values[env_ids].copy() for name, values in self._arrays().items()}
        return self.tracker.snapshot(env_ids) | self._steps.snapshot(env_ids) | own

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self.tracker.restore(env_ids, data)
        self._steps.restore(env_ids, data)
        for name, values in self._arrays().items():
            values[env_ids] = data[name]

    def _arrays(self) -> dict[str, Array]:
        return {
            "wanted": self._wanted,
            "command": self._command,
            "com": self._com,
            "seen": self._seen,
            "excess": self._excess,
        }
