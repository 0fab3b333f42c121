"""Stopping distances in physics: a base drives, somebody is in its way all at once, and it stops."""

from typing import Any, NamedTuple

import numpy as np

from anysim.api import make
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim_mobile.guarded_base import stopping_distance

STEP = 0.02
"""[s] a control step."""
STILL = 0.005
"""[m/s] below which a base has stopped."""
LATE = 300
"""Control steps that it may take to stop."""
RADIUS, HEIGHT = 0.25, 0.5
"""[m] of the ball that stands for somebody in the way."""
CLEAR = 0.5
"""[m] that the guard is to leave."""
LESS = 0.1
"""[m] that are missing to that when somebody steps in: so it has to stop at once, and as fast as it can."""
BASES: dict[str, tuple[str, float]] = {
    "mobile_panda": ("holonomic_drive", 0.7),
    "differential_base": ("differential_drive", 1.0),
}
"""Bases that are measured: their controllers, and the acceleration with which these brake [m/s^2]."""


class Stop(NamedTuple):
    """One stop.

    Attributes:
        robot, engine: what drove, and where.
        speed: [m/s] that it had.
        latency: [s] of its guard.
        distance: [m] that it went on from the moment in which somebody was there.
        formula: [m] speed * latency + speed^2 / (2 * braking), of the speed that it was told.
        left: [m] to the one in the way when it has stopped; at least CLEAR - LESS by the formula.
    """

    robot: str
    engine: str
    speed: float
    latency: float
    distance: float
    formula: float
    left: float


def stop(robot: str, engine: str, speed: float, latency: float) -> Stop:
    """Have a base drive at a speed [m/s], put somebody into its way, and measure how far it goes on."""
    controller, braking = BASES[robot]
    formula = float(stopping_distance(np.array(speed), braking, latency))
    gap = formula + CLEAR - LESS
    with make(_run(robot, controller, speed, latency, braking), engine=engine, num_envs=1) as env:
        env.reset(seed=0)
        policy = SkillPolicy(env)
        policy.begin(np.array([0]))
        for _ in range(round((1.5 + speed / braking) / STEP)):
            _go(env, policy)
        base = env.scene.frame("base")
        here, pace = float(base.position[0, 0]), float(base.twist[0, 0])
        front = float(env.scene.entity_shape("base").bounds(np.array([0.0, 0, 0, 0, 0, 0, 1.0]))[1][0])
        place = [here + front + gap + RADIUS, float(base.position[0, 1]), HEIGHT, 0.0, 0.0, 0.0, 1.0]
        env.engine.set_body_state(np.array([[place]]), None, None, [env.engine.index.entity("somebody").root])
        moved = still = 0
        while moved < LATE and still < 10:
            _go(env, policy)
            moved, still = moved + 1, still + 1 if abs(base.twist[0, 0]) < STILL else 0
        distance = float(base.position[0, 0]) - here
    return Stop(robot, engine, pace, latency, distance, formula, gap - distance)


def _go(env: TaskEnv, policy: SkillPolicy) -> None:
    env.step(policy.act(np.array([0])))
    env.scene.look(None)


def _run(robot: str, controller: str, speed: float, latency: float, braking: float) -> dict[str, Any]:
    options = {"people": ["somebody"], "clear": CLEAR, "braking": braking, "latency": latency, "speed": speed}
    drive: dict[str, Any] = {"controller": controller, "params": {"acceleration": braking}}
    return {
        "physics": {"dt": 0.002, "control_dt": STEP},
        "world": {
            "robots": {"base": {"robot": robot, "actions": {"base": drive}}},
            "objects": {"somebody": {"source": {"sphere": RADIUS}, "fixed": True}},
            "layout": {"somebody": {"position": [40.0, 40.0, HEIGHT]}},
        },
        "task": {
            "horizon": 2000,
            "command": {"goal": {"term": "goal_pose", "position": [30.0, 0.0, 0.1]}},
            "observations": {"policy": [{"term": "relative_pose", "a": "base", "b": "goal"}]},
            "success": {"there": {"term": "near", "a": "base", "b": "goal", "tolerance": 0.1, "axes": "xy"}},
            "expert": {"skill": "drive_guarded", "robot": "base", "goal": "goal", **options},
        },
        "record": {"cameras": []},
    }
