"""Batched inverse kinematics on the kernels: `NumbaIk`, the planner `numba_ik`."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain
from anysim.planning.api import IkRequest, IkResult, IkStep, InverseKinematics
from anysim.threads import shared, usable_cores
from anysim_control.batch.frames import LENGTH_PER_REACH, canonical_frames

BLOCK = 64
"""Rows a thread takes at a time. A row with restarts costs ten times another: blocks keep threads equally busy."""

SHARED_FROM = 4 * BLOCK
"""Rows from which on a batch is shared between threads; below, starting them costs more than they bring."""


class NumbaIk(InverseKinematics):
    """Damped least squares within the joint limits, compiled with numba; runs without the interpreter lock.

    The first solver of a process compiles the kernels or reads them from numba's cache, so that no later call waits.
    One solver may be used from several threads.
    """

    def __init__(
        self,
        chain: Chain,
        *,
        position_tolerance: float = 1e-4,
        rotation_tolerance: float = 1e-4,
        max_iterations: int = 40,
        threads: int | None = None,
    ) -> None:
        """Make a solver for a chain.

        Args:
            chain: the joints and the tool.
            position_tolerance: [m] a row has converged below both.
            rotation_tolerance: [rad]
            max_iterations: of one start; most converge within 10.
            threads: how many share a batch; None for the cores this process may use. The results do not depend on it.

        Raises:
            AnysimError: an option that is not positive.
        """
        super().__init__(chain)
        options = {
            "position_tolerance": position_tolerance,
            "rotation_tolerance": rotation_tolerance,
            "max_iterations": max_iterations,
            "threads": 1 if threads is None else threads,
        }
        for name, value in options.items():
            if not value > 0:
                raise AnysimError(f"{name} of numba_ik: expected a positive number, got {value}")
        from anysim_control.batch import kernels

        self._kernels = kernels
        self._tolerance = np.array([position_tolerance, rotation_tolerance])
        self._max_iterations = int(max_iterations)
        self._frames = canonical_frames(chain)
        self._length = LENGTH_PER_REACH * (np.sqrt((self._frames[:, :, 3] ** 2).sum(axis=1)).sum() or 1.0)
        self._spread = np.where(chain.prismatic, 1.0, np.pi)  # random starts of joints without limits
        self._threads = threads or usable_cores()
        self._warm_up()

    def _solve(self, request: IkRequest, random_restarts: int, rng_seeds: Array) -> IkResult:
        rows, joints = request.seeds.shape
        result = IkResult(
            np.empty((rows, joints)), np.empty(rows, bool), np.empty(rows), np.empty(rows), np.empty(rows, np.int64)
        )
        weight = request.rotation_weight * self._length

        def block(part: slice) -> None:
            chain = self.chain
            self._kernels.solve_rows(
                self._frames,
                chain.prismatic,
                chain.lower,
                chain.upper,
                self._spread,
                weight,
                self._tolerance,
                random_restarts + 1,
                self._max_iterations,
                request.targets[part],
                request.base[part],
                request.seeds[part],
                rng_seeds[part],
                *(array[part] for array in result),
            )

        if self._threads == 1 or rows < SHARED_FROM:
            block(slice(0, rows))
        else:
            shared(block, [slice(i, i + BLOCK) for i in range(0, rows, BLOCK)], self._threads)
        return result

    def _step(self, request: IkRequest, max_step: Array, posture: Array, posture_gain: float, damping: float) -> IkStep:
        rows, joints = request.seeds.shape
        result = IkStep(np.empty((rows, joints)), np.empty(rows), np.empty(rows))
        weight = request.rotation_weight * self._length
        self._kernels.step_rows(
            self._frames,
            self.chain.prismatic,
            self.chain.lower,
            self.chain.upper,
            weight,
            max_step,
            posture_gain,
            damping,
            request.targets,
            request.base,
            request.seeds,
            posture,
            *result,
        )
        return result

    def _warm_up(self) -> None:
        identity = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
        seed = self.chain.initial[None]
        self.solve(identity, identity, seed, random_restarts=0, rng_seeds=np.zeros(1, np.uint64))
        self.step(identity, identity, seed, max_step=1.0)
