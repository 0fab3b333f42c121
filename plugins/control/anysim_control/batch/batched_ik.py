"""`batched_ik`: the compiled kernels as a controller: one call a control step for all envs."""

from importlib.util import find_spec
from typing import Annotated, Literal, Unpack

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.planning.api import InverseKinematics, inverse_kinematics
from anysim_control.batch.limbs import Limb, limbs
from anysim_control.tools.ik_controller import IkController, IkOptions

FREE, FIXED = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


class BatchedIk(IkController):
    """Damped steps, or whole solutions, of serial chains in compiled code; fastest where there are many envs.

    Each tool has a chain of its own: arms that share a waist are one problem, which `pink_ik` solves. With `full`
    each control step searches the joint positions of the target from where the reference is, with restarts where that
    fails; the reference goes there within the velocity limits. Use it where targets are far apart.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        solve: Annotated[Literal["step", "full"], Field(description="what is computed in a control step")] = "step",
        solver: Annotated[
            Literal["numba_ik", "numpy_ik"] | None,
            Field(description="numba_ik if not given and numba is installed; the answers differ in their last digits"),
        ] = None,
        damping: Annotated[float, Field(gt=0, description="[m/rad] larger is calmer near singularities")] = 0.02,
        posture_gain: Annotated[
            float,
            Field(
                ge=0, le=1, description="step: the part of the distance to the posture at the reset covered in a step"
            ),
        ] = 0.02,
        restarts: Annotated[int, Field(ge=0, description="full: random starts where the first does not get there")] = 5,
        **options: Unpack[IkOptions],
    ) -> None:
        super().__init__(channel, num_envs, **options)
        self._limbs = limbs(self.frames)
        name = solver or ("numba_ik" if find_spec("numba") else "numpy_ik")
        self._solvers: list[InverseKinematics] = [inverse_kinematics(limb.chain, name) for limb in self._limbs]
        self._weight = FIXED if self.targets.oriented else FREE
        self._full, self._restarts = solve == "full", restarts
        self._damping, self._gain = damping, posture_gain

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        now = joint_pos[:, self.channel.joint_columns]
        answer = np.array(now)
        for number, (limb, ik) in enumerate(zip(self._limbs, self._solvers, strict=True)):
            mine = answer[:, limb.columns]
            most = self.max_step[limb.columns]
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
