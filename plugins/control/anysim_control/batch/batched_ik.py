"""`batched_ik`: the compiled kernels as a controller: one call a control step for all envs."""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.planning.api import InverseKinematics, inverse_kinematics
from anysim_control.batch.limbs import Limb, limbs
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.link_effort import CarryWeight
from anysim_control.tools.servo import FeedForward, ToolServo, VelocityScale
from anysim_control.tools.target import (
    CommandName,
    FrameName,
    Speed,
    StepAngle,
    StepLength,
    ToolNames,
    ToolTargets,
    TurnRate,
)

FREE, FIXED = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


class BatchedIk(Controller):
    """Damped steps, or whole solutions, of serial chains in compiled code; fastest where there are many envs.

    Each tool has a chain of its own: arms that share a waist are one problem, which `pink_ik` solves. With `full`
    each control step searches the joint positions of the target from where the reference is, with restarts where that
    is no way; the reference goes there within the velocity limits. Use it where targets are far apart.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        tool: ToolNames = None,
        frame: FrameName = "base",
        command: CommandName = "pose",
        step_length: StepLength = 0.02,
        step_angle: StepAngle = 0.1,
        speed: Speed = 0.5,
        turn_rate: TurnRate = 1.5,
        velocity_scale: VelocityScale = 1.0,
        feed_forward: FeedForward = "effort",
        carry_weight: CarryWeight = None,
        solve: Annotated[Literal["step", "full"], Field(description="what is computed in a control step")] = "step",
        solver: Annotated[
            Literal["numba_ik", "numpy_ik"] | None,
            Field(description="numba_ik if not given and numba is installed; the answers differ in their last digits"),
        ] = None,
        damping: Annotated[float, Field(gt=0, description="[m/rad] larger is calmer near singularities")] = 0.02,
        posture_gain: Annotated[
            float, Field(ge=0, le=1, description="step: the part of the way to the posture at the reset in a step")
        ] = 0.02,
        restarts: Annotated[int, Field(ge=0, description="full: random starts where the first does not get there")] = 5,
    ) -> None:
        super().__init__(channel, num_envs)
        frames = ToolFrames(channel, tool)
        targets = ToolTargets(
            frames,
            num_envs,
            command=command,
            frame=frame,
            step_length=step_length,
            step_angle=step_angle,
            speed=speed,
            turn_rate=turn_rate,
        )
        self._servo = ToolServo(
            frames,
            targets,
            self._solve,
            num_envs,
            feed_forward=feed_forward,
            velocity_scale=velocity_scale,
            carry_weight=carry_weight,
        )
        self.dim, self.low, self.high, self.labels = targets.dim, targets.low, targets.high, targets.labels
        self._limbs = limbs(frames)
        name = solver or ("numba_ik" if find_spec("numba") else "numpy_ik")
        self._solvers: list[InverseKinematics] = [inverse_kinematics(limb.chain, name) for limb in self._limbs]
        self._weight = FIXED if targets.oriented else FREE
        self._full, self._restarts = solve == "full", restarts
        self._damping, self._gain = damping, posture_gain

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._servo.reset(env_ids, targets)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return self._servo.apply(action, env_ids)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        return self._servo.action_for(targets, env_ids)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return self._servo.snapshot(env_ids)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._servo.restore(env_ids, data)

    def _solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        now = joint_pos[:, self.channel.joint_columns]
        answer = np.array(now)
        for number, (limb, ik) in enumerate(zip(self._limbs, self._solvers, strict=True)):
            mine = answer[:, limb.columns]
            most = self._servo.max_step[limb.columns]
            wanted = (self._searched if self._full else self._stepped)(
                limb, ik, targets[:, number], joint_pos, mine, posture, most
            )
            answer[:, limb.columns] = wanted
        return answer

    def _stepped(
        self,
        limb: Limb,
        ik: InverseKinematics,
        target: Array,
        joint_pos: Array,
        now: Array,
        posture: Array,
        most: Array,
    ) -> Array:
        return ik.step(
            target,
            limb.base(joint_pos),
            now,
            max_step=most,
            posture=posture[:, limb.columns],
            posture_gain=self._gain,
            damping=self._damping,
            rotation_weight=self._weight,
        ).joint_pos

    def _searched(
        self,
        limb: Limb,
        ik: InverseKinematics,
        target: Array,
        joint_pos: Array,
        now: Array,
        posture: Array,
        most: Array,
    ) -> Array:
        # The same seed in every row and step: an env's random starts must not depend on its number or its past.
        keys = np.zeros(len(now), dtype=np.uint64)
        found = ik.solve(
            target,
            limb.base(joint_pos),
            now,
            random_restarts=self._restarts,
            rng_seeds=keys,
            rotation_weight=self._weight,
        )
        way = found.joint_pos - now
        ratio = (np.abs(way) / most).max(axis=1, initial=1.0)
        return now + way / ratio[:, None]
