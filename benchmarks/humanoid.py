"""Standing and walking of the G1 on every engine, as a table.

    python benchmarks/humanoid.py [ENGINE ...]

Columns: largest joint error after five seconds of standing [rad]; falls in eight pushes of 0.3 m/s; pelvis height at
the end of a squat of 18 cm, relative to home [m]; where the centre of mass went in ten seconds of walking at 0.2 m/s,
and where the plan had it at that instant, forward and to the left [m].
"""

import argparse
from typing import Any

import numpy as np

import anysim
from anysim.task.env import TaskEnv


def env(engine: str, controller: str, num_envs: int = 1) -> TaskEnv:
    """A G1 on a plane, reset."""
    robots = {"g1": {"robot": "unitree_g1", "actions": {"base": controller}}}
    spec: dict[str, Any] = {
        "physics": {"dt": 0.002, "control_dt": 0.02},
        "world": {"name": "humanoid", "terrain": "plane", "robots": robots},
        "task": {"horizon": 10_000, "observations": {"policy": ["joint_pos"]}},
    }
    made = anysim.make(spec, engine=engine, num_envs=num_envs)
    made.reset(seed=0)
    return made


def row(engine: str) -> str:
    """The line of an engine."""
    made = env(engine, "humanoid_balance")
    root = made.engine.index.entity("g1").root
    home, start = np.array(made.engine.get_state().joint_pos), made.engine.get_state().body_pose[0, root].copy()
    hold(made, np.zeros(6), 5.0)
    error = float(np.abs(made.engine.get_state().joint_pos - home).max())
    hold(made, np.array([-0.18, 0, 0, 0, 0, 0]), 3.0)
    squat = float(made.engine.get_state().body_pose[0, root, 2] - start[2])
    made.close()
    made = env(engine, "humanoid_balance", num_envs=8)
    hold(made, np.zeros(6), 0.2)
    state = made.engine.get_state()
    pose, twist = state.body_pose[:, [root]].copy(), state.body_twist[:, [root]].copy()
    side = np.arange(8) * np.pi / 4.0
    twist[:, 0, :2] += 0.3 * np.stack([np.cos(side), np.sin(side)], axis=1)
    made.engine.set_body_state(pose, twist, np.arange(8), [root])
    hold(made, np.zeros(6), 2.0)
    falls = int((np.abs(made.engine.get_state().body_pose[:, root, 2] - start[2]) > 0.1).sum())
    made.close()
    made = env(engine, "lipm_walk")
    walk: Any = made.actions.slice_of("g1", "base").controller
    planned, begin = walk.planned()[0], centre(walk)
    hold(made, np.array([0.2, 0.0, 0.0]), 10.0)
    end = made.engine.get_state().body_pose[0, root]
    far, plan = centre(walk) - begin, walk.planned()[0] - planned
    fell = " (fell)" if abs(end[2] - start[2]) > 0.1 else ""
    made.close()
    walked = f"{far[0]:.3f}, {far[1]:.3f} of {plan[0]:.3f}, {plan[1]:.3f}{fell}"
    return f"| {engine} | {error:.4f} | {falls} of 8 | {squat:.3f} | {walked} |"


def centre(walk: Any) -> np.ndarray:
    """Where the measured centre of mass is (2,) [m]."""
    robot, whole = walk.robot, walk.tracker.whole
    base = robot.base_pose(None)[0]
    q = whole.model.q(robot.joint_pos(None)[0], base)
    v = whole.model.v(robot.joint_vel(None)[0], base, robot.base_twist(None)[0])
    return np.array(whole.measured(q, v)[0][:2])


def hold(made: TaskEnv, action: np.ndarray, seconds: float) -> None:
    """Give one action for a time."""
    rows = np.tile(action, (made.num_envs, 1))
    for _ in range(round(seconds / 0.02)):
        made.step(rows)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("engines", nargs="*", default=["mujoco", "pybullet", "sapien"])
    options = parser.parse_args()
    print("| engine | stand 5 s [rad] | pushes 0.3 m/s, falls | squat 0.18 m [m] | walk 10 s at 0.2 m/s [m] |")
    print("|---|---|---|---|---|")
    for engine in options.engines:
        print(row(engine), flush=True)


if __name__ == "__main__":
    main()
