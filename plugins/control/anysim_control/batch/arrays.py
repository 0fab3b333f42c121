"""`numpy_ik`: the method of the kernels in arrays, for where numba cannot be installed. Ten times slower."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.planning.api import IkRequest, IkResult, IkStep, InverseKinematics
from anysim_control.batch.draws import uniform_rows
from anysim_control.batch.frames import LENGTH_PER_REACH, canonical_frames

ROUNDS = (1, 2, 4, 8, 16)
"""How many random starts are tried at once: few rows need many, and those that need none should not pay for them."""

MAX_MOVE, STALLS = 1.0, 3


class NumpyIk(InverseKinematics):
    """Damped least squares within the joint limits, on whole batches.

    Every operation is elementwise or one small system a row, so a row's answer is the same bits in any batch.
    """

    def __init__(
        self,
        chain: Chain,
        *,
        position_tolerance: float = 1e-4,
        rotation_tolerance: float = 1e-4,
        max_iterations: int = 40,
    ) -> None:
        """Make a solver for a chain; tolerances in [m] and [rad], `max_iterations` of one start.

        Raises:
            AnysimError: an option that is not positive.
        """
        super().__init__(chain)
        options = {
            "position_tolerance": position_tolerance, "rotation_tolerance": rotation_tolerance,
            "max_iterations": max_iterations,
        }  # fmt: skip
        for name, value in options.items():
            if not value > 0:
                raise AnysimError(f"{name} of numpy_ik: expected a positive number, got {value}")
        self._frames = canonical_frames(chain)
        self._length = LENGTH_PER_REACH * (np.sqrt((self._frames[:, :, 3] ** 2).sum(axis=1)).sum() or 1.0)
        self._spread = np.where(chain.prismatic, 1.0, np.pi)
        self._tolerance = (position_tolerance, rotation_tolerance)
        self._max_iterations = int(max_iterations)

    def _solve(self, request: IkRequest, random_restarts: int, rng_seeds: Array) -> IkResult:
        rows = len(request.seeds)
        seeds = np.clip(request.seeds, self.chain.lower, self.chain.upper)
        best = self._descend(request, np.arange(rows), seeds)
        tried = 0
        for width in (*ROUNDS, *[ROUNDS[-1]] * random_restarts):
            open_rows = np.flatnonzero(~best.converged)
            width = min(width, random_restarts - tried)
            if width <= 0 or not len(open_rows):
                break
            where = np.repeat(open_rows, width)
            attempt = np.tile(np.arange(tried, tried + width), len(open_rows))
            found = self._descend(request, where, self._starts(seeds[where], rng_seeds[where], attempt))
            self._keep(best, found, open_rows, width)
            tried += width
        return best

    def _starts(self, seeds: Array, keys: Array, attempt: Array) -> Array:
        """The starts of the kernels: random start `attempt` of each row."""
        chain, joints = self.chain, len(self.chain)
        counter = attempt[:, None] * joints + np.arange(joints)
        draw = uniform_rows(keys[:, None], counter)
        bounded = np.isfinite(chain.lower) & np.isfinite(chain.upper)
        lower, upper = np.where(bounded, chain.lower, 0.0), np.where(bounded, chain.upper, 0.0)
        value = np.where(bounded, lower + (upper - lower) * draw, seeds + self._spread * (2.0 * draw - 1.0))
        return np.clip(value, chain.lower, chain.upper)

    @staticmethod
    def _keep(best: IkResult, found: IkResult, rows: Array, width: int) -> None:
        """Of each row's attempts the first that converged, else the nearest, if that is better than what there is."""
        score = np.where(found.converged, -1.0, found.position_error + found.rotation_error).reshape(-1, width)
        pick = np.arange(len(rows)) * width + score.argmin(axis=1)
        better = score.min(axis=1) < best.position_error[rows] + best.rotation_error[rows]
        for mine, theirs in zip(best[:4], found[:4], strict=True):
            mine[rows[better]] = theirs[pick[better]]
        best.iterations[rows] += found.iterations.reshape(-1, width).sum(axis=1)

    def _descend(self, request: IkRequest, where: Array, start: Array) -> IkResult:
        """Levenberg-Marquardt of all rows together; those that are done or stuck drop out."""
        chain, weight = self.chain, request.rotation_weight * self._length
        goal = P.compose(P.inverse(request.base[where]), request.targets[where])
        q = np.array(start)
        error, vector, jac = self._linear(q, goal, weight)
        cost, factor = (error * error).sum(axis=1), np.full(len(q), 0.1)
        used, stalled = np.zeros(len(q), dtype=np.int64), np.zeros(len(q), dtype=np.int64)
        counted = (weight > 0).astype(float)
        live = ~self._there(error, vector, counted)
        for _ in range(self._max_iterations):
            at = np.flatnonzero(live)
            if not len(at):
                break
            move = bounded_moves(
                jac[at], error[at], factor[at] * cost[at] + 1e-8, chain.lower - q[at], chain.upper - q[at]
            )
            longest = np.abs(move).max(axis=1, initial=1e-300)
            trial = np.clip(q[at] + move * np.minimum(1.0, MAX_MOVE / longest)[:, None], chain.lower, chain.upper)
            new_error, new_vector, new_jac = self._linear(trial, goal[at], weight)
            new_cost = (new_error * new_error).sum(axis=1)
            down = new_cost < cost[at]
            stalled[at] = np.where(down & (new_cost <= 0.8 * cost[at]), 0, stalled[at] + down)
            factor[at] = np.where(down, np.maximum(0.4 * factor[at], 1e-6), 4.0 * factor[at])
            used[at] += 1
            kept = at[down]
            q[kept], error[kept], vector[kept] = trial[down], new_error[down], new_vector[down]
            jac[kept], cost[kept] = new_jac[down], new_cost[down]
            live[at] = ~self._there(error[at], vector[at], counted) & (factor[at] < 1e4) & (stalled[at] < STALLS)
        distance, angle = P.norm(error[:, :3]), P.norm(vector * counted)
        return IkResult(q, self._there(error, vector, counted), distance, angle, used)

    def _there(self, error: Array, vector: Array, counted: Array) -> Array:
        return (P.norm(error[:, :3]) < self._tolerance[0]) & (P.norm(vector * counted) < self._tolerance[1])

    def _step(self, request: IkRequest, max_step: Array, posture: Array, posture_gain: float, damping: float) -> IkStep:
        chain, weight = self.chain, request.rotation_weight * self._length
        q = np.clip(request.seeds, chain.lower, chain.upper)
        goal = P.compose(P.inverse(request.base), request.targets)
        error, vector, jac = self._linear(q, goal, weight)
        square = np.full(len(q), damping * damping)
        pull = posture_gain * (posture - q)
        move = bounded_moves(jac, error, square, chain.lower - q, chain.upper - q, pull)
        scale = 1.0 / np.maximum(np.abs(move) / max_step, 1.0).max(axis=1, initial=1.0)
        after = np.clip(q + scale[:, None] * move, chain.lower, chain.upper)
        return IkStep(after, P.norm(error[:, :3]), P.norm(vector * (weight > 0)))

    def _linear(self, q: Array, goal: Array, weight: Array) -> tuple[Array, Array, Array]:
        """Weighted errors (n, 6), bare rotation vectors (n, 3) in tool axes, and what joints take off (n, K, 6)."""
        rotation, position, axes, points = self._forward(q)
        vector = P.rotation_vector(P.multiply(P.conjugate(rotation), goal[:, 3:]))
        error = np.concatenate([goal[:, :3] - position, weight * vector], axis=1)
        prismatic = self.chain.prismatic[:, None]
        linear = np.where(prismatic, axes, P.cross(axes, position[:, None] - points))
        own = np.where(prismatic, 0.0, P.rotate(P.conjugate(rotation)[:, None], axes))
        # log(exp(-d) exp(v)) = v - L d with L = 1 - [v]/2 + c [v]^2
        angle = P.norm(vector)
        safe = np.where(angle > 1e-3, angle, 1.0)
        c = np.where(angle > 1e-3, 1.0 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe)), 1.0 / 12.0 + angle**2 / 720.0)
        v = np.broadcast_to(vector[:, None], own.shape)
        once = P.cross(v, own)
        turned = own - 0.5 * once + c[:, None, None] * P.cross(v, once)
        return error, vector, np.concatenate([linear, weight * turned], axis=2)

    def _forward(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Quaternion (n, 4) and position (n, 3) of the tool, axes and points on them (n, K, 3); root frame."""
        n, joints = q.shape
        axes, points = np.empty((n, joints, 3)), np.empty((n, joints, 3))
        turn, position = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)), np.zeros((n, 3))
        z = np.array([0.0, 0.0, 1.0])
        for k, frame in enumerate(self._frames):
            position = position + P.rotate(turn, np.broadcast_to(frame[:, 3], (n, 3)))
            turn = P.multiply(turn, np.broadcast_to(P.from_matrix(frame[:, :3]), (n, 4)))
            if k == joints:
                break
            axes[:, k] = P.rotate(turn, np.broadcast_to(z, (n, 3)))
            points[:, k] = position
            if self.chain.prismatic[k]:
                position = position + axes[:, k] * q[:, k, None]
            else:
                turn = P.multiply(turn, P.from_axis_angle(np.broadcast_to(z, (n, 3)), q[:, k]))
        return P.normalize(turn), position, axes, points


def bounded_moves(
    jac: Array, error: Array, damping: Array, lower: Array, upper: Array, pull: Array | None = None
) -> Array:
    """The least |J^T move - error|^2 + damping |move - pull|^2 with lower <= move <= upper, (n, K).

    A joint that would leave its bounds is set on them, and the others are solved again to make up for it.

    Args:
        jac: (n, K, 6) what a unit of each joint takes off the error.
        error: (n, 6).
        damping: (n,) > 0.
        lower: (n, K) <= 0.
        upper: (n, K) >= 0.
        pull: (n, K), none if not given.
    """
    n, joints = lower.shape
    free, move = np.ones((n, joints), dtype=bool), np.zeros((n, joints))
    if pull is None:  # joints at their limits that would go on out need not be tried
        pull, downhill = np.zeros((n, joints)), np.zeros((n, joints))
        for i in range(6):
            downhill = downhill + jac[:, :, i] * error[:, i, None]
        free &= ~(((lower >= 0.0) & (downhill < 0.0)) | ((upper <= 0.0) & (downhill > 0.0)))
    at = np.arange(n)
    for _ in range(joints + 1):
        known = np.where(free[at], pull[at], move[at])
        wanted, matrix = np.array(error[at]), damping[at, None, None] * np.eye(6)
        for k in range(joints):
            wanted = wanted - jac[at, k] * known[:, k, None]
            column = np.where(free[at, k, None], jac[at, k], 0.0)
            matrix = matrix + column[:, :, None] * column[:, None, :]
        solution = np.linalg.solve(matrix, wanted[:, :, None])[:, :, 0]
        step = np.array(pull[at])
        for i in range(6):
            step = step + jac[at, :, i] * solution[:, i, None]
        step = np.where(free[at], step, move[at])
        low, high = free[at] & (step < lower[at]), free[at] & (step > upper[at])
        move[at] = np.where(low, lower[at], np.where(high, upper[at], step))
        over = low | high
        free[at] &= ~over
        at = at[over.any(axis=1)]
        if not len(at):
            break
    return move
