"""Speeds of trotting quadrupeds on every engine: those reached per robot, engine and command, one controller for all.

    python benchmarks/trot.py [ROBOT ...] [--engines mujoco,sapien] [--seconds 7]

Each row is one run of three envs: forward, sideways and turning at once. Means of the last 60 %, in the heading frame.
The walks are deterministic; no figure is a time.
"""

import argparse

import numpy as np

from anysim.testing.quadrupeds import QUADRUPEDS, WITH_ARM, made, walk

SLOW = {"solo12": 0.3, "hyq": 0.4, "anymal_kinova": 0.4}
"""[m/s] forward where half a metre a second is too fast: small, short of torque, and with a swaying load."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", default=[*QUADRUPEDS, *WITH_ARM])
    parser.add_argument("--engines", default="mujoco,pybullet,sapien")
    parser.add_argument("--seconds", type=float, default=7.0)
    arguments = parser.parse_args()
    print("robot          engine     forward: m/s of asked   left: m/s of asked   turn: rad/s of asked   tilt   falls")
    for robot in arguments.robots:
        forward = SLOW.get(robot, 0.5)
        side = 0.15 if robot == "anymal_kinova" else 0.5 * forward
        commands = np.diag([forward, side, 0.6])
        for engine in arguments.engines.split(","):
            with made(robot, engine, 3) as env:
                walked = walk(env, commands, arguments.seconds)
            v = np.diagonal(walked.velocity)
            print(
                f"{robot:14s} {engine:9s}      {v[0]:5.3f} of {forward:5.3f}        {v[1]:5.3f} of {side:5.3f}"
                f"         {v[2]:5.3f} of 0.600      {np.rad2deg(walked.tilt.max()):4.1f}°   {int(walked.fell.sum())}",
                flush=True,
            )


if __name__ == "__main__":
    main()
