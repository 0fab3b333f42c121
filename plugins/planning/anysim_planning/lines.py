"""Straight lines of tools: joint positions along a line, by inverse kinematics from point to point."""

from dataclasses import replace

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.planning.motion import PlanRequest, Scene
from anysim_planning.goals import GoalSolver

STEPS = (40, 80, 160, 320)
"""Points of a line, tried until the tool stays near enough between them."""
JUMP = 0.25
"""[rad] or [m] that no joint moves between two points: more is another posture."""


def between(start: Array, end: Array, parts: Array) -> Array:
    """Poses (n, 7) at `parts` (n,) of the way from one pose to another, the position straight."""
    turn = P.rotation_vector(P.multiply(P.conjugate(start[3:]), end[3:]))
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle > 1e-12 else np.array([1.0, 0.0, 0.0])
    turns = P.from_axis_angle(np.tile(axis, (len(parts), 1)), angle * parts)
    position = start[:3] + parts[:, None] * (end[:3] - start[:3])
    return np.concatenate([position, P.multiply(np.tile(start[3:], (len(parts), 1)), turns)], axis=1)


def straight_line(solver: GoalSolver, request: PlanRequest, scene: Scene, chosen: tuple[int, ...]) -> Array | None:
    """(T, K) joint positions on which every tool goes straight to its pose; None if no posture follows the line."""
    deviation = request.straight or 0.0
    for steps in STEPS:
        path = np.tile(np.asarray(request.start, dtype=float), (steps + 1, 1))
        worst = 0.0
        for goal, candidate in zip(request.goals, chosen, strict=True):
            if not goal.enabled:
                continue
            arm = solver.arm(request, replace(goal, slide=(0.0, 0.0, 0.0)))
            base, chain = solver.base(arm, scene), arm.solver.chain
            q = path[0, arm.columns]
            begin = chain.tool_pose(base, q)
            line = between(begin, np.asarray(goal.poses, dtype=float)[candidate], np.linspace(0.0, 1.0, steps + 1))
            for k in range(1, steps + 1):
                answer = arm.solver.solve(
                    line[k : k + 1],
                    base[None],
                    q[None],
                    random_restarts=0,
                    rng_seeds=np.zeros(1, np.uint64),
                    rotation_weight=goal.rotation_weight,
                )
                if not answer.converged[0] or np.abs(answer.joint_pos[0] - q).max() > JUMP:
                    return None
                q = answer.joint_pos[0]
                path[k, arm.columns] = q
            middle = chain.tool_pose(np.tile(base, (steps, 1)), 0.5 * (path[1:] + path[:-1])[:, arm.columns])
            worst = max(worst, _off_line(middle[:, :3], line[0, :3], line[-1, :3]))
        if worst <= deviation:
            return path
    return None


def _off_line(points: Array, start: Array, end: Array) -> float:
    way = end - start
    part = np.clip((points - start) @ way / max(float(way @ way), 1e-18), 0.0, 1.0)
    return float(np.linalg.norm(points - start - part[:, None] * way, axis=1).max())
