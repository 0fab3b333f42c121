"""Arms of one plan: their joints side by side, and what inverse kinematics says of where their tools can go."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.planning.api import InverseKinematics
from anysim.task.env import TaskEnv

RESTARTS = 20
LINE_POINTS = 8
"""Of each straight line after a planned move, from which its joint positions are interpolated."""
JUMP = 0.5
"""[rad] that no joint moves between two of them: more is another posture."""
POSTURES = 24
"""Seeds of other postures at a goal, where the lines after it cannot be gone from the nearest one."""


class PlannedArm(NamedTuple):
    """One arm of a plan, by the names of its robot and its tool; `joints` (N, K) is what it tells its joints."""

    robot: str
    tool: str
    solver: InverseKinematics
    joints: Array


class PlannedArms:
    """The arms of one plan in all envs. A row of joints has those of all of them, each once.

    Attributes:
        arms: one, or several that move at once.
        joint_names: (K) of the row.
        numbers: (K,) those of the joints in the World.
        lower, upper: (K,) limits.
        holder: the number of the body that holds what is in the hand of the first arm.
        behind: (K,) [s] by which a joint that moves evenly is behind its target: damping over stiffness of its drive.
    """

    def __init__(self, env: TaskEnv, arms: Sequence[PlannedArm]) -> None:
        self._env, self.arms = env, tuple(arms)
        chains = [arm.solver.chain for arm in self.arms]
        self.joint_names = tuple(dict.fromkeys(name for chain in chains for name in chain.joint_names))
        self._columns = [np.array([self.joint_names.index(name) for name in chain.joint_names]) for chain in chains]
        self.numbers = np.zeros(len(self.joint_names), dtype=int)
        self.lower, self.upper = np.zeros((2, len(self.joint_names)))
        for chain, columns in zip(chains, self._columns, strict=True):
            self.numbers[columns] = chain.joints
            self.lower[columns], self.upper[columns] = chain.lower, chain.upper
        world = env.engine.world
        drives = {a.joint: a.kd / a.kp for a in world.actuators if a.kp > 0}
        self.behind = np.array([drives.get(j, 0.0) for j in self.numbers.tolist()])
        first = self.arms[0]
        self.holder = world.sites[env.engine.index.robot(first.robot).tools[first.tool]].body

    def told(self, ids: Array) -> Array:
        """(n, K) what the joints are told."""
        row = np.zeros((len(ids), len(self.joint_names)))
        for arm, columns in zip(self.arms, self._columns, strict=True):
            row[:, columns] = arm.joints[ids]
        return row

    def tell(self, env: int, row: Array) -> None:
        """Tell the joints (K,) where to be."""
        for arm, columns in zip(self.arms, self._columns, strict=True):
            arm.joints[env] = row[columns]

    def reach(self, env: int, goals: Array) -> bool:
        """Whether all arms reach one of the candidates (A, G, 7) of tool poses, free or not."""
        reached, count = np.ones(goals.shape[1], dtype=bool), goals.shape[1]
        keys = np.full(count, self._env.streams.episode_seed[env])
        for (_, base, solver), poses in zip(self._each(env), goals, strict=True):
            seeds = np.tile(solver.chain.initial, (count, 1))
            bases = np.tile(base, (count, 1))
            reached &= solver.solve(poses, bases, seeds, random_restarts=RESTARTS, rng_seeds=keys).converged
        return bool(reached.any())

    def postures(self, env: int, goal: Array, seed: int) -> Array:
        """(n, K) joint positions with which the tools are at poses (A, 7), from random starts."""
        rng = np.random.default_rng(seed)
        rows = rng.uniform(self.lower, self.upper, (POSTURES, len(self.joint_names)))
        good, keys = np.ones(POSTURES, dtype=bool), np.zeros(POSTURES, dtype=np.uint64)
        for (columns, base, solver), pose in zip(self._each(env), goal, strict=True):
            poses, bases = np.tile(pose, (POSTURES, 1)), np.tile(base, (POSTURES, 1))
            found = solver.solve(poses, bases, rows[:, columns], random_restarts=0, rng_seeds=keys)
            rows[:, columns] = found.joint_pos
            good &= found.converged
        return rows[good]

    def lines(self, env: int, joints: Array, ends: Array) -> Array | None:
        """(T, K) joint positions along straight lines of all tools at once, to poses (A, S, 7) one after the other.

        They begin at joint positions (K,); None where an arm cannot go them in one posture.
        """
        keys = np.zeros(1, dtype=np.uint64)
        begin = [solver.chain.tool_pose(base, joints[columns]) for columns, base, solver in self._each(env)]
        rows = [joints]
        for number in range(ends.shape[1]):
            for part in np.linspace(0.0, 1.0, LINE_POINTS)[1:]:
                row = rows[-1].copy()
                for (columns, base, solver), one, end in zip(self._each(env), begin, ends[:, number], strict=True):
                    reach, turn = P.norm((end - one)[None, :3])[0], 2 * np.pi
                    pose = P.step_toward(one[None], end[None], part * reach, part * turn)
                    seed = rows[-1][None, columns]
                    found = solver.solve(pose, base[None], seed, random_restarts=0, rng_seeds=keys)
                    if not found.converged[0] or np.abs(found.joint_pos[0] - seed[0]).max() > JUMP:
                        return None
                    row[columns] = found.joint_pos[0]
                rows.append(row)
            begin = list(ends[:, number])
        return np.array(rows)

    def _each(self, env: int) -> Iterator[tuple[Array, Array, InverseKinematics]]:
        """Of each arm its columns of a row, the pose (7,) of its root, and its solver."""
        poses = self._env.scene.state.body_pose[env]
        for arm, columns in zip(self.arms, self._columns, strict=True):
            yield columns, poses[arm.solver.chain.root], arm.solver
