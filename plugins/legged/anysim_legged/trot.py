"""The controller `trot`: a velocity of the base becomes steps of a quadruped."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim_legged.gait import FootTargets, GaitParameters, Motion, Trot
from anysim_legged.legs import Legs, solve
from anysim_legged.weight import Balance, shares

Limits = tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]]


class TrotController(Controller):
    """The action is the velocity of the base in its own frame: forward [m/s], left [m/s], turn to the left [rad/s].

    Diagonal pairs of legs step in turn, and at zero all feet stand. Feet follow targets in the base frame through exact
    leg kinematics and the drives' law; feed-forward torques carry the weight, shared by the feet that stand. Three
    feedbacks: a swinging foot lands further out the faster the base drifts (Raibert), standing legs push the low side
    of the base up, and a lasting error of the velocity is added to what the feet are told.
    """

    labels = ("forward", "left", "turn")

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        frequency: Annotated[float, Field(gt=0, description="strides a second [1/s]")] | None = None,
        clearance: Annotated[float, Field(gt=0, description="height of a swinging foot's path [m]")] | None = None,
        limits: Annotated[Limits, Field(description="largest velocities [m/s, m/s, rad/s]")] | None = None,
        duty: Annotated[float, Field(ge=0.5, lt=1, description="share of a stride that a foot stands")] = 0.6,
        placement: Annotated[float, Field(ge=0, description="feet land further by this times the drift [s]")] = 0.1,
        levelling: Annotated[float, Field(ge=0, description="share of a tilt that standing legs push against")] = 0.4,
        tracking: Annotated[float, Field(ge=0, description="how fast lasting errors of speed are mended [1/s]")] = 0.5,
        ramp: Annotated[float, Field(gt=0, description="time from zero to a limit [s]")] = 0.5,
        in_place: Annotated[bool, Field(description="go on stepping at zero velocity")] = False,
        period: Annotated[float, Field(gt=0, description="time between commands [s]; a control step")] | None = None,
    ) -> None:
        super().__init__(channel, num_envs)
        if frequency is None or clearance is None or limits is None:
            lack = [
                n for n, v in {"frequency": frequency, "clearance": clearance, "limits": limits}.items() if v is None
            ]
            raise TaskError(
                f"trot needs {listing(lack)} of '{self.robot.name}.{channel.name}'; give them in `params`, or under "
                f"channels.{channel.name}.controllers.trot in the robot's catalogue entry"
            )
        self._dt, self.period = self._times(period)
        self.dim, self.high = 3, np.array(limits, dtype=float)
        self.low = -self.high
        self.legs = Legs.of(self.robot)
        self._order = self._drives()
        self._balance = Balance(self.robot, self.legs.columns)
        self._fastest = self.channel.velocity_limit[self._order]
        nominal = self.legs.feet(self.legs.home[None])[0]
        nominal[:, 2] = nominal[:, 2].mean()
        parameters = GaitParameters(frequency, clearance, duty, placement, levelling, tracking, in_place)
        self.gait = Trot(nominal, num_envs, self.high, ramp, parameters)
        gravity = np.array(self.robot.world.physics.gravity)
        self._weight = -self.robot.kinematics.mass * gravity
        self._command = np.zeros((num_envs, 3))

    def _times(self, period: float | None) -> tuple[float, float | None]:
        """The time from one command to the next, and `period` where that is not the control step."""
        dt, control_dt = self.robot.dt, self.robot.control_dt
        if period is None or abs(period - control_dt) < 1e-9:
            return control_dt, None
        for whole, part, names in ((period, dt, "period / physics.dt"), (control_dt, period, "control_dt / period")):
            ratio = whole / part
            if abs(ratio - round(ratio)) > 1e-6 or ratio < 1.0:
                raise TaskError(
                    f"the period of trot is {period:g} s, so {names} is {ratio:g}; expected a whole number "
                    f"(physics.dt {dt:g}, physics.control_dt {control_dt:g})"
                )
        return period, period

    def _drives(self) -> Array:
        """(L, 3) which of the channel's drives moves each joint of the legs."""
        there = {int(column): i for i, column in enumerate(self.channel.joint_columns)}
        wanted = set(self.legs.columns.ravel().tolist())
        names = self.robot.kinematics.joint_names
        if set(there) != wanted:
            extra = [names[c] for c in sorted(set(there) ^ wanted)]
            raise TaskError(
                f"trot drives the joints of the legs and no others: channel '{self.channel.name}' of "
                f"'{self.robot.name}' and the entry's `legs` differ in {listing(extra)}"
            )
        return np.array([[there[int(column)] for column in leg] for leg in self.legs.columns])

    # ------------------------------------------------------------------ the contract

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._command[env_ids] = 0.0
        self.gait.reset(env_ids, self.legs.feet(targets[:, self._order]))

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        self._command[_rows(env_ids)] = action
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        rows = _rows(env_ids)
        pose, twist = self.robot.base_pose(env_ids), self.robot.base_twist(env_ids)
        targets = self.gait.tick(rows, self._command[rows], _motion(pose, twist), self._dt)
        return self._drive(pose, self._balance.com(env_ids, len(pose)), targets)

    def _drive(self, pose: Array, com: Array, targets: FootTargets) -> Command:
        """Positions of the legs' drives, and the torques that carry the weight."""
        postures = self.legs.inverse(targets.feet)
        joints = np.minimum(np.maximum(postures.joints, self.legs.lower), self.legs.upper)
        up = P.rotate_inverse(pose[:, 3:], np.broadcast_to(self._weight, (len(pose), 3)))
        share = shares(targets.stance, targets.feet, com)
        force = up[:, None] * share[..., None]  # of the ground on each foot
        jacobian = postures.jacobian
        effort = -np.stack([P.dot(jacobian[..., k], force) for k in range(3)], axis=-1)
        rates = solve(jacobian, targets.velocity)
        rates = np.minimum(np.maximum(rates, -self._fastest), self._fastest)
        joints = joints - 0.5 * self._dt * rates  # held for a whole tick: where they shall be in its middle
        command = [np.empty((len(pose), self._order.size)) for _ in range(3)]
        for values, of_legs in zip(command, (joints, rates, effort), strict=True):
            values[:, self._order] = of_legs
        return Command(*command)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"command": self._command[env_ids]} | self.gait.snapshot(env_ids)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._command[env_ids] = data["command"]
        self.gait.restore(env_ids, data)


def _motion(pose: Array, twist: Array) -> Motion:
    """Roll, pitch and the velocity in the heading frame of bases with poses (E, 7) and twists (E, 6)."""
    roll, pitch, yaw = P.to_roll_pitch_yaw(pose[:, 3:]).T
    c, s = np.cos(yaw), np.sin(yaw)
    velocity = np.stack([c * twist[:, 0] + s * twist[:, 1], c * twist[:, 1] - s * twist[:, 0], twist[:, 5]], axis=1)
    return Motion(velocity, roll, pitch)


def _rows(env_ids: Array | None) -> slice | Array:
    return slice(None) if env_ids is None else env_ids
