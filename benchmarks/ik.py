"""Speed of inverse kinematics, in problems a second: the compiled solver and its numpy twin against plain loops.

    python benchmarks/ik.py [--rows 4000] [--threads 2]

Problems are poses of a Panda at uniformly random joint positions, so all can be reached; solved means within 1e-4 m and
1e-4 rad and within the limits. Seeds are uniformly random too, or within 0.1 rad of a solution. Times are the best of
three. `cpu us` is what all threads together take, which a machine that does other things changes least. The last column
compares it with that of the loop over problems that calls Pinocchio for kinematics and Jacobians, the usual way to do
it, with the same method and restarts, in the same run.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.chain import Chain
from anysim.kinematics.pinocchio_model import RobotModel, pinocchio
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.api import inverse_kinematics
from anysim.testing.arms import panda_arm
from anysim_control.batch.frames import canonical_frames

RESTARTS = 60
ROOT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class NumpyLoop:
    """One problem at a time in small numpy matrices: the same method and restarts. Revolute joints only."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.frames = np.tile(np.eye(4), (len(chain) + 1, 1, 1))
        self.frames[:, :3] = canonical_frames(chain)

    def residual_and_jacobian(self, q: Array, rotation: Array, position: Array) -> tuple[Array, Array]:
        pose = np.eye(4)
        axes, points = np.empty((len(q), 3)), np.empty((len(q), 3))
        for k, angle in enumerate(q):
            pose = pose @ self.frames[k]
            axes[k], points[k] = pose[:3, 2], pose[:3, 3]
            c, s = np.cos(angle), np.sin(angle)
            pose = pose @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        pose = pose @ self.frames[-1]
        turn = P.rotation_vector(P.from_matrix(rotation @ pose[:3, :3].T))
        jacobian = np.concatenate([np.cross(axes, pose[:3, 3] - points), axes], axis=1).T
        return np.concatenate([position - pose[:3, 3], turn]), jacobian

    def solve(self, target: Array, seed: Array, rng: np.random.Generator) -> bool:
        rotation, position = P.to_matrix(target[3:]), target[:3]
        q = seed
        for _ in range(RESTARTS + 1):
            error, jacobian = self.residual_and_jacobian(q, rotation, position)
            factor = 0.1
            for _ in range(30):
                if np.linalg.norm(error[:3]) < 1e-4 and np.linalg.norm(error[3:]) < 1e-4:
                    return True
                damping = (factor * (error @ error) + 1e-8) * np.eye(len(q))
                move = np.linalg.solve(jacobian.T @ jacobian + damping, jacobian.T @ error)
                trial = np.clip(q + move, self.chain.lower, self.chain.upper)
                new_error, new_jacobian = self.residual_and_jacobian(trial, rotation, position)
                if new_error @ new_error < error @ error:
                    q, error, jacobian, factor = trial, new_error, new_jacobian, 0.4 * factor
                else:
                    factor *= 4.0
            q = rng.uniform(self.chain.lower, self.chain.upper)
        return False


class PinocchioLoop(NumpyLoop):
    """One problem at a time, kinematics and Jacobians by Pinocchio."""

    def __init__(self, chain: Chain, world: World) -> None:
        super().__init__(chain)
        self.robot = RobotModel(world, "panda")
        self.tool = self.robot.frame("tool")

    def residual_and_jacobian(self, q: Array, rotation: Array, position: Array) -> tuple[Array, Array]:
        pin, model, data = pinocchio(), self.robot.model, self.robot.data
        jacobian = pin.computeFrameJacobian(model, data, q, self.tool, pin.LOCAL_WORLD_ALIGNED)
        place = pin.updateFramePlacement(model, data, self.tool)
        error = np.concatenate([position - place.translation, pin.log3(rotation @ place.rotation.T)])
        return error, jacobian


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """The shortest time [s] of some calls."""
    times: list[float] = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=4000, help="problems in a batch")
    parser.add_argument("--loop-rows", type=int, default=100, help="problems for the numpy loop")
    parser.add_argument("--threads", type=int, default=2, help="the largest number of threads")
    options = parser.parse_args()
    world = panda_arm()
    chain = Chain.from_world(world, "panda", "arm", "tool")
    rng = np.random.default_rng(0)
    n = options.rows
    base = np.tile(ROOT, (n, 1))
    goals = rng.uniform(chain.lower, chain.upper, (n, len(chain)))
    targets = chain.tool_pose(base, goals)
    near = np.clip(goals + rng.uniform(-0.1, 0.1, goals.shape), chain.lower, chain.upper)
    seeds = {"random": rng.uniform(chain.lower, chain.upper, goals.shape), "near": near}
    keys = np.arange(n, dtype=np.uint64)

    header = f"{'solver':24} {'seeds':7} {'rows':>6} {'solved':>8} {'steps':>6}"
    header += f" {'us/solve':>9} {'cpu us':>9} {'solves/s':>9}"
    print(f"{header} {'x Pinocchio':>11}")
    reference: dict[str, float] = {}

    def line(name: str, kind: str, rows: int, solved: float, steps: float, seconds: float, cpu: float) -> None:
        each = seconds / rows
        reference.setdefault(kind, cpu / rows)
        figures = (
            f"{rows:6} {100 * solved:7.2f}% {steps:6.1f} {1e6 * each:9.2f} {1e6 * cpu / rows:9.2f} {1 / each:9.0f}"
        )
        print(f"{name:24} {kind:7} {figures} {reference[kind] * rows / cpu:11.1f}")

    loop_rows = min(n, options.loop_rows)
    for name, loop in (("pinocchio, loop", PinocchioLoop(chain, world)), ("numpy, loop", NumpyLoop(chain))):
        for kind, start in seeds.items():
            start_time, cpu_time = time.perf_counter(), time.process_time()
            solved = [loop.solve(targets[i], start[i], rng) for i in range(loop_rows)]
            line(
                name,
                kind,
                loop_rows,
                float(np.mean(solved)),
                float("nan"),
                time.perf_counter() - start_time,
                time.process_time() - cpu_time,
            )
    solvers = [
        (f"numba_ik, {t} thread(s)", inverse_kinematics(chain, threads=t)) for t in range(1, options.threads + 1)
    ]
    for name, ik in (*solvers, ("numpy_ik", inverse_kinematics(chain, "numpy_ik"))):
        for kind, start in seeds.items():

            def work(ik=ik, start=start):
                return ik.solve(targets, base, start, random_restarts=RESTARTS, rng_seeds=keys)

            cpu_time = time.process_time()
            result = work()
            cpu_time = time.process_time() - cpu_time
            line(name, kind, n, result.converged.mean(), result.iterations.mean(), best_of(3, work), cpu_time)

    ik = inverse_kinematics(chain, threads=1)
    print(f"\n{'one call':24} {'rows':>6} {'us/call':>9}")
    for rows in (1, 16, 64):
        put = (targets[:rows], base[:rows], near[:rows])
        step = best_of(500, lambda put=put: ik.step(*put, max_step=0.04, posture=chain.initial))
        print(f"{'step':24} {rows:6} {1e6 * step:9.1f}")
        solve = best_of(500, lambda put=put, n=rows: ik.solve(*put, random_restarts=5, rng_seeds=keys[:n]))
        print(f"{'solve, near seeds':24} {rows:6} {1e6 * solve:9.1f}")


if __name__ == "__main__":
    main()
