"""Inverse kinematics as skills ask for it: problems, answers and solvers, which are found by name.

A solver answers a batch of independent problems. Row i of an answer depends on row i of the question alone: not on the
rows beside it, their order, or the number of threads; that is part of the contract.
"""

from abc import ABC, abstractmethod
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain

ALL_AXES = (1.0, 1.0, 1.0)


class IkRequest(NamedTuple):
    """n checked problems on one chain. Arrays are C-contiguous copies of what the caller passed.

    Attributes:
        targets: (n, 7) wanted world poses of the tool.
        base: (n, 7) world poses of the chain's root body.
        seeds: (n, K) joint positions to start from.
        rotation_weight: (3,) weight of the rotation error about each axis of the tool; 0 leaves that rotation free.
    """

    targets: Array
    base: Array
    seeds: Array
    rotation_weight: Array


class IkResult(NamedTuple):
    """The best joint positions found. All finite, whether converged or not.

    Attributes:
        joint_pos: (n, K) within the limits.
        converged: (n,) bool, both errors are within the solver's tolerances.
        position_error: (n,) [m] distance from the tool to its target.
        rotation_error: (n,) [rad] length of the rotation vector from tool to target, over the axes of nonzero weight.
        iterations: (n,) int64, steps over all restarts.
    """

    joint_pos: Array
    converged: Array
    position_error: Array
    rotation_error: Array
    iterations: Array


class IkStep(NamedTuple):
    """One step towards the targets.

    Attributes:
        joint_pos: (n, K) positions to command next, within the limits.
        position_error: (n,) [m] before the step.
        rotation_error: (n,) [rad] before the step, over the axes of nonzero weight.
    """

    joint_pos: Array
    position_error: Array
    rotation_error: Array


class InverseKinematics(ABC):
    """Joint positions for tool poses, on one chain. A solver writes `_solve` and `_step`; the public methods check.

    Raises (both methods):
        AnysimError: an array of the wrong shape, values that are not finite, quaternions that are not unit.
    """

    def __init__(self, chain: Chain) -> None:
        self.chain = chain

    def solve(
        self,
        targets: Array,
        base: Array,
        seeds: Array,
        *,
        random_restarts: int,
        rng_seeds: Array,
        rotation_weight: tuple[float, float, float] | Array = ALL_AXES,
    ) -> IkResult:
        """Search from the seeds; where that fails, from up to `random_restarts` random positions within the limits.

        Args:
            targets: (n, 7) wanted world poses of the tool.
            base: (n, 7) world poses of the chain's root body.
            seeds: (n, K) joint positions to start from.
            random_restarts: how many more starts a row may use.
            rng_seeds: (n,) uint64, what a row's random starts are drawn from.
            rotation_weight: (3,) weights of the rotation error about the tool's axes; (1, 1, 0) leaves the tool free to
                turn about its z.
        """
        request = self._checked(targets, base, seeds, rotation_weight)
        rng_seeds = np.array(rng_seeds)
        if rng_seeds.shape != (len(request.targets),) or rng_seeds.dtype.kind not in "ui":
            raise AnysimError(
                f"rng_seeds of {self.chain.name}: expected {len(request.targets)} unsigned integers, one a row, "
                f"got shape {rng_seeds.shape} of {rng_seeds.dtype}"
            )
        if random_restarts < 0:
            raise AnysimError(f"random_restarts of {self.chain.name}: expected 0 or more, got {random_restarts}")
        return self._solve(request, int(random_restarts), rng_seeds.astype(np.uint64))

    def step(
        self,
        targets: Array,
        base: Array,
        joint_pos: Array,
        *,
        max_step: float | Array,
        posture: Array | None = None,
        posture_gain: float = 0.1,
        damping: float = 0.02,
        rotation_weight: tuple[float, float, float] | Array = ALL_AXES,
    ) -> IkStep:
        """One damped step for servoing; call it each control step with the positions of now.

        Args:
            targets: (n, 7) wanted world poses of the tool.
            base: (n, 7) world poses of the chain's root body.
            joint_pos: (n, K) positions now; clipped to the limits first.
            max_step: () or (K,) [rad] or [m], the most a joint may move, usually its velocity limit times the control
                step. A longer step is scaled as a whole, so that the tool keeps its direction.
            posture: (K,) or (n, K) positions that the freedom left by the tool pulls to; None for no pull.
            posture_gain: the part of the distance to `posture` asked for in a step.
            damping: [m/rad] larger is slower and calmer near singular configurations.
            rotation_weight: (3,) as for `solve`.
        """
        request = self._checked(targets, base, joint_pos, rotation_weight)
        joints = len(self.chain)
        if posture is None:
            posture, posture_gain = request.seeds, 0.0
        goal = np.asarray(posture, dtype=float)
        if goal.shape not in ((joints,), request.seeds.shape):
            raise AnysimError(
                f"posture of {self.chain.name}: expected shape ({joints},) or {request.seeds.shape}, got {goal.shape}"
            )
        limit = np.asarray(max_step, dtype=float)
        if limit.shape not in ((), (joints,)) or not np.all(limit > 0):
            raise AnysimError(
                f"max_step of {self.chain.name}: expected a positive number or {joints} of them, got {max_step}"
            )
        if not (damping > 0 and 0 <= posture_gain <= 1):
            raise AnysimError(
                f"step of {self.chain.name}: expected damping > 0 and posture_gain in [0, 1], "
                f"got damping {damping} and posture_gain {posture_gain}"
            )
        goal = np.array(np.broadcast_to(goal, request.seeds.shape))
        limit = np.array(np.broadcast_to(limit, (joints,)))
        return self._step(request, limit, goal, float(posture_gain), float(damping))

    @abstractmethod
    def _solve(self, request: IkRequest, random_restarts: int, rng_seeds: Array) -> IkResult:
        """Answer checked problems; `rng_seeds` is (n,) uint64."""

    @abstractmethod
    def _step(self, request: IkRequest, max_step: Array, posture: Array, posture_gain: float, damping: float) -> IkStep:
        """One step on checked problems: `request.seeds` are the positions now, max_step (K,), posture (n, K)."""

    def _checked(self, targets: Array, base: Array, seeds: Array, rotation_weight: Any) -> IkRequest:
        request = IkRequest(
            *(np.array(a, dtype=np.float64, order="C") for a in (targets, base, seeds, rotation_weight))
        )
        rows = len(request.targets) if request.targets.ndim else 0
        shapes = ((rows, 7), (rows, 7), (rows, len(self.chain)), (3,))
        for label, array, shape in zip(request._fields, request, shapes, strict=True):
            if array.shape != shape:
                raise AnysimError(f"{label} of {self.chain.name}: expected shape {shape}, got {array.shape}")
            if not isfinite(np.vdot(array, array)) and not np.isfinite(array).all():  # a skill asks in every step
                bad = np.flatnonzero(~np.isfinite(array).reshape(len(array), -1).all(axis=1))
                raise AnysimError(f"{label} of {self.chain.name}: not finite in rows {bad[:8].tolist()}")
        for label, array in (("targets", request.targets), ("base", request.base)):
            turn = array[:, 3:]
            away = np.abs(np.add.reduce(turn * turn, axis=1) - 1.0)
            if np.maximum.reduce(away, initial=0.0) > 1e-3:
                row = int(np.argmax(away))
                raise AnysimError(
                    f"{label} of {self.chain.name}: the quaternion of row {row} has length "
                    f"{np.linalg.norm(turn[row]):.6g}; expected a unit quaternion (x, y, z, w)"
                )
        if np.minimum.reduce(request.rotation_weight) < 0:
            raise AnysimError(f"rotation_weight of {self.chain.name}: expected 3 numbers >= 0, got {rotation_weight}")
        return request


def inverse_kinematics(chain: Chain, solver: str = "numba_ik", **options: Any) -> InverseKinematics:
    """A solver by name for a chain.

    Raises:
        PluginError: no solver of that name is installed; the message names the package to install.
    """
    made = registry.load("planners", solver)
    with registry.using("planners", solver, (TypeError,)):  # of an option that it does not have
        return made(chain, **options)
